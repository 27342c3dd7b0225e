"""Common style of all figures: sizes, colours, and display units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Display units in SI: millimetre and bar. A force is shown in N everywhere, as on the command line and in files.
MM, BAR = 1e-3, 1e5


@dataclass(frozen=True, slots=True)
class Style:
    """Sizes in inches and points, colours that colour-blind readers can distinguish (Okabe and Ito).

    A figure is as wide as its page allows: its text is 11 px high on a page of 500 px, 16 px where it is widest.
    """

    width: float = 6.0
    dpi: int = 144
    font_size: float = 10.0
    ink: str = "#1a1a1a"
    grid: str = "#e3e3e3"
    measured: str = "#8c8c8c"
    blue: str = "#0072b2"
    orange: str = "#e69f00"
    green: str = "#009e73"
    red: str = "#d55e00"
    purple: str = "#cc79a7"
    span: str = "#fdf3d7"
    #: Dark to light, for an increasing parameter.
    ordered: tuple[str, ...] = ("#440154", "#3b528b", "#21918c", "#43b244", "#c8b400")


STYLE = Style()


@dataclass(frozen=True, slots=True)
class Line:
    """How a curve is drawn; without `label` it is not in the legend, a higher `layer` is drawn on top."""

    colour: str
    label: str = ""
    width: float = 1.1
    dash: str | tuple[float, Sequence[float]] = "-"
    opacity: float = 1.0
    layer: float = 2.0
