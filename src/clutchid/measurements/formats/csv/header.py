"""Rows above the samples of a text table: what each says of the columns, and the headings of its cells."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from clutchid.log.units import UNITS
from clutchid.measurements.columns import Heading, channel, channel_name, headings, quantity_named, unit_spelled
from clutchid.measurements.formats.csv.cells import NUMBER, is_words, numberlike, split

#: Units of other quantities, to distinguish a unit from a remark.
# fmt: off
_OTHER = frozenset((
    "N", "kN", "µN", "uN", "Nm", "V", "mV", "A", "mA", "W", "kW", "J", "Ohm", "rpm", "1/min", "U/min",
    "rev/min", "Hz", "kHz", "km/h", "km", "deg", "°", "rad", "rad/s", "°/s", "kg", "g", "g/s", "kg/s", "kg/h",
    "l", "L", "l/min", "m/s²", "m/s2", "m/s^2", "cm/s", "%rH", "mm²", "cm²", "mm³", "cm³",
))
# fmt: on

#: Types of numbers.
_TYPE = re.compile(
    r"type|[fiu][1248]|u?int(?:8|16|32|64)?|double|single|float(?:32|64)?|real(?:32|64)?|bool(?:ean)?", re.IGNORECASE
)

#: Role of a row by a mark in every cell (Simulink), or by a label in the first one (LabVIEW, ControlDesk).
_MARK = re.compile(r"(unit|einheit|type|interp|name)\s*:\s*(.*)", re.IGNORECASE)
_MARKS = {"unit": "units", "einheit": "units", "name": "names"}
_LABELS = {
    "y_unit_label": "units", "x0": "starts", "delta_x": "steps", "***end_of_header***": "end",
    "unit": "units", "path": "names", "data type": "types", "description": "types", "trace_values": "end",
}  # fmt: skip

_COMMENT = ("#", "%", "//")


def role(cells: list[str], *, comment: bool, labelled: bool) -> tuple[str, list[str]]:
    """Role of a row, empty if it holds numbers, and its cells without the mark that says so.

    A row of names is ``text``, unless it says that it is one; ``labelled`` is a table whose first column has labels.

    Examples
    --------
    >>> role(["Unit: s", "Unit: mm"], comment=False, labelled=False), role(["0", "1"], comment=False, labelled=False)
    (('units', ['s', 'mm']), ('', ['0', '1']))
    """
    filled = [cell.strip() for cell in cells if cell.strip()]
    marks = [match for cell in filled if (match := _MARK.fullmatch(cell))]
    if len(filled) == len(marks) > 1:
        return _MARKS.get(marks[0][1].casefold(), "types"), [_MARK.sub(r"\2", cell.strip()) for cell in cells]
    label = cells[0].strip().casefold()
    if labelled and label in _LABELS:
        return _LABELS[label], ["", *cells[1:]]
    if units := units_in(cells):
        return "units", units
    if comment:
        return "comment", cells
    if len(filled) > 1 and all(map(_TYPE.fullmatch, filled)):
        return "types", cells
    is_text = not numberlike(cells[0]) and is_words([cell for cell in cells if not numberlike(cell)])
    return "text" if is_text else "", cells


def is_unit(text: str | None) -> bool:
    """Whether a text is a known unit of any quantity."""
    unit = unit_spelled(text)
    return unit in UNITS or unit in _OTHER


def units_in(cells: Sequence[str]) -> list[str] | None:
    """The units in a row of units, without brackets; None if the row is not one.

    Examples
    --------
    >>> units_in(["s", "[mm]", "", "furlong"]), units_in(["Time", "Position"]), units_in(["0", "1"])
    (['s', 'mm', '', 'furlong'], None, None)
    """
    units = [re.sub(r"^\[(.*)\]$|^\((.*)\)$", r"\1\2", cell.strip()) for cell in cells]
    filled = [unit for unit in units if unit]
    spelled = [unit for unit in filled if is_unit(unit)]
    words = [unit for unit in spelled if unit not in ("-", "1")]
    if not words or 2 * len(spelled) < len(filled) or any(NUMBER.fullmatch(unit) for unit in filled if unit != "1"):
        return None
    return units if all(len(unit) <= 16 for unit in filled) else None


def heading(index: int, text: str, unit: str | None = None) -> Heading:
    """Heading of one cell, with its unit in square or round brackets, after a slash, or from a row of units.

    Examples
    --------
    >>> [(h.name, h.unit) for h in map(heading, range(4), ("Position / mm", "m/s", "t/s", "pressure_a (bar (g))"))]
    [('position', 'mm'), (None, None), (None, 's'), ('pressure_a', 'bar(g)')]
    """
    text = text.strip()
    if "[" in text:
        column = replace(headings([text])[0], index=index)
        numbered = (column.unit or "").isdigit()  # an index, where a row of units stands below
        return replace(column, unit=unit_spelled(unit)) if unit and (numbered or not column.unit) else column
    for match in re.finditer(r"/|\((?=.*\)$)", text):
        name, last = text[: match.start()], text[match.end() :]
        last = last[:-1] if match[0] == "(" else last
        if is_unit(last) and name.strip() and (match[0] == "(" or name[-1] == " " or not is_unit(name)):
            return Heading(index, channel_name(text), quantity_named(name), unit_spelled(last))
    return channel(index, text, unit)


def is_comment(line: str, separator: str) -> bool:
    """Whether a line above the samples is a comment."""
    text = line.lstrip()
    marks = _COMMENT if separator == ";" else (*_COMMENT, ";")
    return text.startswith(marks) and not text[1:].lstrip(" ").startswith(separator.strip() or "\0")


def uncommented(line: str) -> str:
    """The text of a comment."""
    return re.sub(r"\s*(?:#|%|//|;)+\s*", "", line, count=1)


def split_header(line: str, separator: str, width: int) -> list[str]:
    """Split a header into cells; with runs of blanks as separator, a name may contain blanks or precede its unit.

    Examples
    --------
    >>> split_header("Time [s]  Piston travel [mm]", " ", 2), split_header("t [s] y [mm]", " ", 2)
    (['Time [s]', 'Piston travel [mm]'], ['t [s]', 'y [mm]'])
    """
    cells = split(line, separator)
    if separator == " " and len(cells) != width:
        joined = re.sub(r"[ \t]+(?=[\[(])", "\0", line.strip(" \t"))
        ways = [re.split(r"\t+| {2,}", line.strip(" \t")), re.split(r"[ \t]+", joined)]
        cells = next((way for way in ways if len(way) == width), cells)
    while len(cells) > width and not cells[-1].strip():
        cells = cells[:-1]
    return [cell.replace("\0", " ") for cell in cells]
