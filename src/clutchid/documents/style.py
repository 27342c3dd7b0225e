"""Common style of all figures: sizes, colours, and display units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Display units in SI: millimetre and bar. A force is shown in N everywhere, as on the command line and in files.
MM, BAR = 1e-3, 1e5


@dataclass(frozen=True, slots=True)
class Style:
    """Sizes in inches and points, colours that colour-blind readers can distinguish.

    They are those of Okabe and Ito, with grey, green and purple moved apart: `tests/documents/test_style.py` computes
    the distances. A figure is as wide as its page allows: its text is 11 px high on a page of 500 px, 16 px where it
    is widest.
    """

    width: float = 6.0
    dpi: int = 144
    font_size: float = 10.0
    ink: str = "#1a1a1a"
    grid: str = "#e3e3e3"
    measured: str = "#b0b0b0"
    blue: str = "#0072b2"
    orange: str = "#e69f00"
    green: str = "#00a473"
    red: str = "#d55e00"
    purple: str = "#c27dd6"
    span: str = "#fdf3d7"
    #: Dark to light, for an increasing parameter.
    ordered: tuple[str, ...] = ("#5b005e", "#2342af", "#1b62fd", "#5daff9", "#94e190")


STYLE = Style()


@dataclass(frozen=True, slots=True)
class Line:
    """Style of a curve; without `label` it is not in the legend, a higher `layer` is drawn on top."""

    colour: str
    label: str = ""
    width: float = 1.1
    dash: str | tuple[float, Sequence[float]] = "-"
    opacity: float = 1.0
    layer: float = 2.0
