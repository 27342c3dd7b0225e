"""Part of a page on the innovations of an on-line observer: NIS, whiteness, correlation with the valves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from clutchid.documents.diagnosis import draw_colour
from clutchid.documents.document import Block, Picture, Text
from clutchid.documents.figures import draw, fill, label, legend, new_figure
from clutchid.documents.style import STYLE, Line
from clutchid.estimation.assess.innovations import InnovationStatistics, MeanNIS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The panels in words.
_CAPTION = (
    "Innovations, measured minus predicted, each divided by the standard deviation that the filter predicts. The "
    "first panel has the mean of their squares (NIS) over each second: if the innovations are independent and have "
    "this deviation, 19 of 20 values lie in the blue band around 1. The filter weights the samples within 10 ms as "
    "one sample, so the NIS is below 1. The other panels show the autocorrelation of the innovations and their "
    "correlation with the duty cycles; at a positive lag the innovation follows the valve. White noise is within "
    "the grey bounds at 99 of 100 lags; larger values show errors of the model."
)


def innovation_figure(statistics: InnovationStatistics) -> Figure:
    """NIS over time with its bounds, autocorrelation, and correlation with both valves."""
    figure, axes = new_figure([1.6] * 4, share_x=False)
    time, bounds = statistics.time, Line(STYLE.blue, "95 % of a chi-square", opacity=0.3)
    fill(axes[0], time, statistics.low, statistics.high, bounds)
    draw(axes[0], time, statistics.nis, Line(STYLE.red, "mean over a second", 1.2))
    axes[0].set_ylim(0.0, 1.1 * float(np.nanmax(np.append(statistics.nis, statistics.high), initial=1.0)))
    label(axes[0], "time [s]", "NIS [1]")
    legend(axes[0], 2)
    draw_colour(axes[1:], statistics.colour, "innovation")
    label(axes[-1], "lag [ms]")
    return figure


def innovation_blocks(name: str, statistics: InnovationStatistics) -> tuple[Block, ...]:
    """Sentence and figure of the innovations of a recording, nothing without a correction."""
    if not statistics.moving.corrections + statistics.resting.corrections:
        return ()
    said = [
        f"{_nis(mean)} while the piston {what}"
        for mean, what in ((statistics.moving, "moves"), (statistics.resting, "rests"))
        if mean.corrections
    ]
    words = f"NIS: {'; '.join(said)}."
    outside = statistics.colour.share_outside
    if np.isfinite(outside):
        words += f" {100 * outside:.0f} % of the lags of the autocorrelation are outside the bounds of white noise."
    alt = "NIS over time, autocorrelation of the innovations and correlation with both valves"
    return (Text(words), Picture(innovation_figure(statistics), f"{name}. {_CAPTION}", alt, dense=True))


def _nis(mean: MeanNIS) -> str:
    bounds = f"{mean.low:.2f} to {mean.high:.2f}"
    return f"{mean.mean:.2g} in {mean.corrections:,d} corrections (95 % of a chi-square: {bounds})"
