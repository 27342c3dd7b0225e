"""`ReportTable`: rows in SI and columns with display formats, as HTML or CSV; tables of load curves."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import dataclass
from html import escape
from io import StringIO
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import quote

import numpy as np

from clutchid.documents.style import MM

if TYPE_CHECKING:
    from clutchid.estimation import LoadCurve


class Link(NamedTuple):
    """A text that leads to a file, with its path relative to the page; without a path, only the text."""

    text: str
    path: str = ""

    @property
    def address(self) -> str:
        """The path as a relative address, percent-encoded: it can neither name a server nor run anything.

        Examples
        --------
        >>> Link("", "vehicles/50 % #1.html").address, Link("", "javascript:alert(1)").address
        ('vehicles/50%20%25%20%231.html', 'javascript%3Aalert%281%29')
        >>> Link("", "//server/page.html").address
        './server/page.html'
        """
        address = quote(os.fsencode(self.path))
        return f"./{address.lstrip('/')}" if address.startswith("/") else address


Cell = str | float | int | Link | None

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class Column:
    """A column: `name` with its SI unit for files, `heading` (one or two lines) under `group` for display.

    Values are displayed divided by `scale`, with `decimals` places, or with `significant` digits and a power of ten.
    A `date` stays on one line.
    """

    name: str
    heading: str
    scale: float = 1.0
    decimals: int = 2
    significant: int | None = None
    group: str = ""
    date: bool = False

    def shown(self, value: Cell) -> str:
        """The cell as displayed; a dash for a missing value.

        Examples
        --------
        >>> Column("position_rms [m]", "rms [mm]", scale=1e-3, decimals=3).shown(9.3e-4)
        '0.930'
        >>> Column("b_2 [1]", "b₂", significant=5).shown(-3.0769e-4)
        '−3.0769·10⁻⁴'
        """
        if value is None:
            return "–"
        if isinstance(value, str):
            return value
        if isinstance(value, Link):
            return value.text
        return self._number(float(value))

    def _number(self, value: float) -> str:
        if math.isnan(value):
            return "–"
        if math.isinf(value):
            return "∞" if value > 0 else "−∞"
        if self.significant is not None:
            return scientific(value / self.scale, self.significant)
        text = f"{value / self.scale:.{self.decimals}f}"
        if float(text) == 0.0:
            text = text.lstrip("-")
        return text.replace("-", "−")


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table; `rules` are the rows with a line above, `note` is the text below."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    rules: tuple[int, ...] = ()
    note: str = ""

    def column(self, name: str) -> tuple[Cell, ...]:
        """The cells of the column whose `name` is, or starts with, `name` before the unit."""
        names = [column.name.split(" [")[0] for column in self.columns]
        wanted = name.split(" [", maxsplit=1)[0]
        return tuple(row[names.index(wanted)] for row in self.rows)


def scientific(value: float, digits: int) -> str:
    """A value with `digits` significant digits (0: all of them), and a power of ten if it is large or small.

    Examples
    --------
    >>> scientific(-2332.7016, 6), scientific(1.7e12, 2), scientific(0.0, 3), scientific(-8.4968e-3, 0)
    ('−2332.70', '1.7·10¹²', '0', '−8.4968·10⁻³')
    """
    if value == 0.0:
        return "0"
    if digits == 0:
        digits = len(f"{value:.12e}".split("e")[0].rstrip("0").replace(".", "").replace("-", ""))
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -2 <= power <= 4:
        return f"{value:.{max(0, digits - 1 - power)}f}".replace("-", "−")
    return f"{mantissa}·10{str(power).translate(_SUPERSCRIPT)}".replace("-", "−")


def to_csv(table: ReportTable) -> str:
    """The table as CSV in SI with all digits; an empty cell for a missing value."""
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([column.name for column in table.columns])
    for row in table.rows:
        writer.writerow([_plain(cell) for cell in row])
    return out.getvalue()


def _plain(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return ""
    if isinstance(cell, Link):
        return cell.text
    return cell if isinstance(cell, str) else repr(cell) if isinstance(cell, int) else repr(float(cell))


def to_html(table: ReportTable, most: int | None = None) -> str:
    """The table, or its first rows, as an HTML fragment; all text is escaped."""
    numeric = [_is_numeric(table, i) for i in range(len(table.columns))]
    first = _group_starts(table)
    body = []
    for number, row in enumerate(table.rows[:most]):
        rule = ' class="rule"' if number in table.rules else ""
        cells = []
        for i, (column, cell) in enumerate(zip(table.columns, row, strict=True)):
            opening, closing = ("th scope=row", "th") if i == 0 else ("td", "td")
            classes = _classes(numeric[i], i in first, column.date)
            cells.append(f"<{opening}{classes}>{_content(column, cell)}</{closing}>")
        body.append(f"<tr{rule}>{''.join(cells)}</tr>")
    note = f'<p class="note">{escape(table.note)}</p>' if table.note else ""
    return (
        f'<div class="table"><table><caption><span>{escape(table.title)}</span></caption>'
        f"<thead>{_heads(table, numeric, first)}</thead><tbody>{''.join(body)}</tbody></table></div>{note}"
    )


def _content(column: Column, cell: Cell) -> str:
    text = escape(column.shown(cell))
    return f'<a href="{escape(cell.address)}">{text}</a>' if isinstance(cell, Link) and cell.path else text


def _heads(table: ReportTable, numeric: list[bool], first: set[int]) -> str:
    words = [escape(column.heading).replace("\n", "<br>") for column in table.columns]
    lower = "".join(f"<th scope=col{_classes(numeric[i], i in first)}>{text}</th>" for i, text in enumerate(words))
    if not any(column.group for column in table.columns):
        return f"<tr>{lower}</tr>"
    upper, at = [], 0
    for group, members in groupby(table.columns, lambda column: column.group):
        span = len(list(members))
        mark = "group first" if at in first else "group"
        head = f'<th colspan="{span}" class="{mark}" scope=colgroup>{escape(group)}</th>'
        upper.append(head if group else f'<td colspan="{span}"></td>')
        at += span
    return f"<tr>{''.join(upper)}</tr><tr>{lower}</tr>"


def _group_starts(table: ReportTable) -> set[int]:
    groups = [column.group for column in table.columns]
    return {i for i in range(1, len(groups)) if groups[i] != groups[i - 1]}


def _classes(numeric: bool, first: bool, date: bool = False) -> str:
    names = " ".join(name for name, yes in (("n", numeric), ("first", first), ("date", date)) if yes)
    return f' class="{names}"' if names else ""


def _is_numeric(table: ReportTable, column: int) -> bool:
    cells = [row[column] for row in table.rows]
    return any(isinstance(cell, (int, float)) for cell in cells) and not any(
        isinstance(cell, (str, Link)) for cell in cells
    )


#: Step of the positions in a table of the load in m.
POSITION_STEP = 1e-3


def load_table(curve: LoadCurve, reach: float) -> ReportTable:
    """The load and its band on a grid of positions up to the reach in m."""
    columns = (
        Column("position [m]", "position [mm]", MM, 0), Column("force [N]", "load [N]", 1.0, 0),
        Column("low [N]", "from [N]", 1.0, 0, group="95 % band"),
        Column("high [N]", "to [N]", 1.0, 0, group="95 % band"),
    )  # fmt: skip
    last = min(reach, float(curve.position[-1])) if np.isfinite(reach) else 0.0
    rows: list[tuple[Cell, ...]] = []
    for position in np.arange(0.0, last + 1e-9, POSITION_STEP):
        values = (np.interp(position, curve.position, y) for y in (curve.force, curve.low, curve.high))
        rows.append((float(position), *(float(value) for value in values)))
    return ReportTable("Load over position", columns, tuple(rows), note="Up to the reach of the recordings.")
