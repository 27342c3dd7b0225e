"""Draw docs/images/loads.png, calibrated loads beside the true ones: ``python docs/make_loads.py``.

Virtual truck 7 is calibrated with pressure while its clutch is new, and read from the position alone when 1.5 mm of the
facing are worn. The truck is more detailed than the model that is fitted, and its true loads are known.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from clutchid import FitRequest, fit
from clutchid.documents.figures import draw, fill, label, legend, mark_span, new_figure
from clutchid.documents.style import MM, STYLE, Line
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.truck import Drive, drive, truck

IMAGE = Path(__file__).parent / "images" / "loads.png"
NUMBER, SECONDS, WEAR, STROKES_A_METRE = 7, 30.0, 1.5e-3, 3e8


def main() -> None:
    """Drive, calibrate, read, draw, and print the errors."""
    new = drive(truck(NUMBER), seconds=SECONDS, seed=1, name="new")
    worn = drive(
        truck(NUMBER), seconds=SECONDS, seed=2, wear=WEAR, cycles=WEAR * STROKES_A_METRE, pressure=False, name="worn"
    )
    calibrated = fit(new.log, measure=("position", "pressure_a"), free=("auto",))
    read = fit(worn.log, calibrated.actuator, request=FitRequest(calibration=calibrated.calibration))
    figure, (axis, errors) = new_figure([3.6, 1.6])
    mark_span(axis, 5.0, 8.0, "the clutch engages, 5 to 8 mm")
    mark_span(errors, 5.0, 8.0)
    for curve, driven, colour, words in (
        (calibrated.load_curve, new, STYLE.orange, "new, calibrated with pressure"),
        (read.load_curve, worn, STYLE.blue, "worn, read from the position alone"),
    ):
        x, inside = curve.position / MM, curve.position <= driven.log["position"].max()
        fill(axis, x[inside], curve.low[inside], curve.high[inside], Line(colour, opacity=0.25))
        draw(axis, x[inside], curve.force[inside], Line(colour, words, 2.0))
        true = driven.truth.load(curve.position)
        dotted = Line(STYLE.ink, "true loads" if driven is worn else "", 1.4, ":", layer=3.0)
        draw(axis, x[inside], true[inside], dotted)
        fill(errors, x[inside], (curve.low - true)[inside], (curve.high - true)[inside], Line(colour, opacity=0.25))
        draw(errors, x[inside], (curve.force - true)[inside], Line(colour, width=1.6))
        print(f"{words}: {error(curve, driven):.2f} % of the peak, rms over 5 to 8 mm")
    errors.axhline(0.0, color=STYLE.ink, linewidth=1.0, linestyle=":")
    label(axis, y="load [N]")
    label(errors, "position [mm]", "error of the\nestimate [N]")
    axis.set_xlim(0.0, 22.0)
    axis.set_ylim(bottom=0.0)
    legend(axis, 2)
    figure.align_ylabels()
    figure.savefig(IMAGE)


def error(curve: LoadCurve, driven: Drive) -> float:
    """Rms error of a load over 5 to 8 mm, in % of the true peak."""
    engaging = (curve.position >= 5e-3) & (curve.position <= 8e-3)
    true = driven.truth.load(curve.position)
    return 100.0 * float(np.sqrt(np.mean((curve.force - true)[engaging] ** 2))) / float(true.max())


if __name__ == "__main__":
    main()
