"""Headers of CSV files: position of the units, comments, and splitting of lines."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from clutchid.log.units import UNITS
from clutchid.recordings.columns import Heading, channel, channel_name, headings, quantity_named, unit_spelled
from clutchid.recordings.formats.csv.cells import NUMBER

#: Units of other quantities, to distinguish a unit from a remark.
# fmt: off
_OTHER = frozenset((
    "N", "kN", "µN", "uN", "Nm", "V", "mV", "A", "mA", "W", "kW", "J", "Ohm", "rpm", "1/min", "U/min",
    "rev/min", "Hz", "kHz", "km/h", "km", "deg", "°", "rad", "rad/s", "°/s", "kg", "g", "g/s", "kg/s", "kg/h",
    "l", "L", "l/min", "m/s²", "m/s2", "m/s^2", "cm/s", "%rH", "mm²", "cm²", "mm³", "cm³",
))
# fmt: on

_COMMENT = ("#", "%", "//")
_MARK = re.compile(r"\s*(?:#|%|//|;)+\s*")
_BLANKS = re.compile(r"[ \t]+")
_WIDE_BLANKS = re.compile(r"\t+| {2,}")


def is_unit(text: str | None) -> bool:
    """Whether a text is a known unit of any quantity."""
    unit = unit_spelled(text)
    return unit in UNITS or unit in _OTHER


def heading(index: int, text: str, unit: str | None = None) -> Heading:
    """Heading of one cell, with its unit in square or round brackets, after a slash, or from a row of units.

    Examples
    --------
    >>> [(h.name, h.unit) for h in map(heading, range(4), ("Position / mm", "m/s", "t/s", "pressure_a (bar (g))"))]
    [('position', 'mm'), (None, None), (None, 's'), ('pressure_a', 'bar(g)')]
    """
    text = text.strip()
    if "[" in text:
        found = replace(headings([text])[0], index=index)
        return found if found.unit or not unit else replace(found, unit=unit_spelled(unit))
    for name, written in _parts(text):
        if is_unit(written):
            return Heading(index, channel_name(text), quantity_named(name), unit_spelled(written))
    return channel(index, text, unit)


def _parts(text: str) -> Iterator[tuple[str, str]]:
    """All ways to split a heading into name and unit."""
    for match in re.finditer("/", text):
        name, unit = text[: match.start()], text[match.end() :]
        if name.strip() and (name[-1:] == " " or not is_unit(name)):
            yield name, unit
    if text.endswith(")"):
        for match in re.finditer(r"\(", text):
            yield text[: match.start()], text[match.end() : -1]


def units_in(cells: Sequence[str]) -> list[str] | None:
    """The units in a row of units, without brackets; None if the row is not one.

    Examples
    --------
    >>> units_in(["s", "[mm]", "", "furlong"]), units_in(["Time", "Position"]), units_in(["0", "1"])
    (['s', 'mm', '', 'furlong'], None, None)
    """
    units = [re.sub(r"^\[(.*)\]$|^\((.*)\)$", r"\1\2", cell.strip()) for cell in cells]
    given = [unit for unit in units if unit]
    known = [unit for unit in given if is_unit(unit)]
    words = [unit for unit in known if unit not in ("-", "1")]
    if not words or 2 * len(known) < len(given) or any(NUMBER.fullmatch(unit) for unit in given if unit != "1"):
        return None
    return units if all(len(unit) <= 16 for unit in given) else None


def is_comment(line: str, separator: str) -> bool:
    """Whether a line above the samples is a comment."""
    text = line.lstrip()
    marks = _COMMENT if separator == ";" else (*_COMMENT, ";")
    return text.startswith(marks) and not text[1:].lstrip(" ").startswith(separator.strip() or "\0")


def uncommented(line: str) -> str:
    """The text of a comment."""
    return _MARK.sub("", line, count=1)


def split(line: str, separator: str) -> list[str]:
    """Split a line into cells; a blank as separator means runs of blanks.

    Examples
    --------
    >>> split('0;"a;b";2', ";"), split("  0   1 ", " ")
    (['0', 'a;b', '2'], ['0', '1'])
    """
    if separator == " ":
        line = _BLANKS.sub(" ", line.strip(" \t"))
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [""])
    except csv.Error:
        return [line]


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
        ways = ([way.strip() for way in _WIDE_BLANKS.split(line.strip(" \t"))], _BLANKS.split(joined))
        cells = next((way for way in ways if len(way) == width), cells)
        cells = [cell.replace("\0", " ") for cell in cells]
    while len(cells) > width and not cells[-1].strip():
        cells = cells[:-1]
    return cells
