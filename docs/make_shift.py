"""Draw docs/images/shift.png, a shift of the virtual truck beside the paper's: ``python docs/make_shift.py``.

The model gets the duty cycles that the controller gave, the paper's Appendix A, and the truck's own load as well as
three splines hold it. What differs is physics, not estimation.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from clutchid import Actuator, Load, Log, simulate
from clutchid.documents.figures import draw, label, legend, new_figure
from clutchid.documents.style import STYLE, Line
from clutchid.truck import GRID, Truck, drive

IMAGE = Path(__file__).parent / "images" / "shift.png"
SPAN = (0.2, 2.2)


def fitted_load(force: np.ndarray) -> Load:
    """The three splines nearest to a load on the grid."""
    theta = np.linalg.lstsq(Load().phi(GRID), force, rcond=None)[0]
    return Load(tuple(theta.tolist()))


def main() -> None:
    """Drive, simulate, draw, and print the differences."""
    driven = drive(Truck(), manoeuvre="gear-shift", seconds=3.0, seed=4)
    truth, t = driven.truth.states, driven.truth.time
    load = fitted_load(driven.truth.load(GRID))
    inputs = {name: driven.log[name] for name in ("duty_supply", "duty_exhaust")}
    model = simulate(Actuator(load=load), Log(driven.log.time, inputs)).log
    at = (t >= SPAN[0]) & (t <= SPAN[1])
    plant, paper = Line(STYLE.blue, "virtual truck", width=1.8), Line(STYLE.red, "paper's model", width=1.4, dash="--")
    figure, axes = new_figure([1.1, 2.0, 2.0, 1.5])
    for name, text, colour in (("duty_supply", "supply", STYLE.green), ("duty_exhaust", "exhaust", STYLE.purple)):
        draw(axes[0], t[at], inputs[name][at], Line(colour, text, width=1.2))
    label(axes[0], y="duty cycle [1]")
    for axis, column, scale, words in (
        (axes[1], "position", 1e-3, "position [mm]"),
        (axes[2], "pressure_a", 1e5, "pressure A [bar]"),
    ):
        draw(axis, t[at], truth[column][at] / scale, plant)
        draw(axis, t[at], model[column][at] / scale, paper)
        label(axis, y=words)
    draw(axes[3], t[at], truth["temperature_a"][at], plant)
    draw(axes[3], t[at], np.full(at.sum(), 293.0), paper)
    label(axes[3], "time [s]", "temperature A [K]")
    legend(axes[0], 2)
    legend(axes[1])
    figure.savefig(IMAGE)
    for column, scale, unit in (("position", 1e-3, "mm"), ("pressure_a", 1e5, "bar")):
        difference = (model[column] - truth[column])[at] / scale
        print(
            f"{column}: rms {np.sqrt(np.mean(difference**2)):.2f} {unit}, largest {np.abs(difference).max():.2f} {unit}"
        )
    misfit = load.force(GRID) - driven.truth.load(GRID)
    print(f"three splines: rms {np.sqrt(np.mean(misfit**2)):.0f} N of {driven.truth.load(GRID).max():.0f} N")
    print(
        f"temperature in chamber A: {truth['temperature_a'][at].min():.0f} to {truth['temperature_a'][at].max():.0f} K"
    )


if __name__ == "__main__":
    main()
