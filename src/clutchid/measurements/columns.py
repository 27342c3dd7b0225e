"""Syntax of column headings: ``name [unit]``.

Names are case-insensitive, and blanks count as underscores; units are compared exactly, without blanks.
"""

from __future__ import annotations

import difflib
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from clutchid.log import COLUMNS, INPUTS
from clutchid.log.units import SPELLINGS, UNITS, known_units
from clutchid.messages import listed, shortened
from clutchid.names import printable

#: Known quantities and their SI units.
QUANTITIES: Mapping[str, str] = MappingProxyType({"time": "s", **COLUMNS})

#: Quantities that a recording must have.
REQUIRED = ("time", "position", *INPUTS)

#: Longest name of a channel; a longer one is cut.
_LONGEST_NAME = 200

#: A name and a unit, behind which pandas and polars number columns of one name: ``time [ms].1``, ``time [ms] (2)``.
_GRAMMAR = re.compile(r"(?P<name>[^\[]*)(?:\[(?P<unit>[^\[\]]*)\]\s*(?:\.\d+|\(\d+\))?)?")
#: A unit at the end of a name begins after one of these, or with a capital after a small letter.
_UNIT_START = re.compile(r"[\s_.,:;(\[/-]+|(?<=[a-z0-9])(?=[A-Z])")

#: Letters of a word that are enough for its beginning.
_BEGINNING = 3

_UNITS_ANY_CASE = frozenset(unit.casefold() for unit in UNITS)

#: Number of columns that a message lists before it counts the rest, and longest name in it.
_SHOWN_COLUMNS, _SHOWN_LENGTH, _SHOWN_OTHERS = 12, 80, 3


@dataclass(frozen=True, slots=True)
class Heading:
    """One heading: text as written, quantity (None: unknown) and unit (None: not given).

    `comment` is the comment on the channel in the file.
    """

    index: int
    text: str
    name: str | None
    unit: str | None
    comment: str = ""

    @property
    def si(self) -> str | None:
        """SI unit of the values; None if the unit is missing, unknown, or of another quantity."""
        unit = UNITS.get(self.unit or "")
        return None if unit is None or (self.name and unit.si != QUANTITIES[self.name]) else unit.si


def headings(cells: Iterable[str]) -> tuple[Heading, ...]:
    """Parse the cells of a header.

    Examples
    --------
    >>> [(h.name, h.unit) for h in headings(["Time  [ms]", "pressure_A [ bar (g) ]", "gear [1]"])]
    [('time', 'ms'), ('pressure_a', 'bar(g)'), (None, '1')]
    """
    return tuple(_heading(index, cell.strip()) for index, cell in enumerate(cells))


def _heading(index: int, text: str) -> Heading:
    match = _GRAMMAR.fullmatch(text)
    name, unit = match.group("name", "unit") if match else (text.partition("[")[0], None)
    return Heading(index, channel_name(text), *_quantity_and_unit(name, unit_spelled(unit)))


def channel(index: int, text: str, unit: str | None, comment: str = "") -> Heading:
    """Heading of a channel whose unit is separate from its name, as in MDF.

    Examples
    --------
    >>> channel(3, "Position", " mm "), channel(0, "TravelSensor", "").unit
    (Heading(index=3, text='Position', name='position', unit='mm', comment=''), None)
    """
    name, spelled = _quantity_and_unit(text, unit_spelled(unit))
    return Heading(index, channel_name(text), name, spelled, shortened(comment, 200))


def distinct(columns: Iterable[Heading]) -> tuple[Heading, ...]:
    """Headings of a time grid with a number added to a text that an earlier one has, so that a map can select each.

    Examples
    --------
    >>> [heading.text for heading in distinct(headings(["Weg [mm]", "Weg [mm]", "Weg [mm]"]))]
    ['Weg [mm]', 'Weg [mm] (2)', 'Weg [mm] (3)']
    """
    taken: dict[str, int] = {}
    headings = []
    for column in columns:
        text = column.text
        while text and text in taken:
            taken[column.text] += 1
            text = f"{column.text} ({taken[column.text]})"
        taken.setdefault(text, 1)
        headings.append(replace(column, text=text))
    return tuple(headings)


def channel_name(text: str) -> str:
    """The name of a channel in headings and maps: on one line, at most `_LONGEST_NAME` characters."""
    return shortened(text, _LONGEST_NAME)


def quantity_named(name: str) -> str | None:
    """Quantity with this standard name; None for any other name."""
    return _KEYS.get(_key(name))


def _quantity_and_unit(text: str, unit: str | None) -> tuple[str | None, str | None]:
    """Quantity with this standard name, which may end with its unit if there is no other."""
    name = quantity_named(text)
    if name is None and unit is None:
        for base, ending in _endings(text):
            name = quantity_named(base)
            unit = _unit_called(ending, QUANTITIES[name]) if name else None
            if unit is not None:
                return name, unit
        return None, None
    return name, unit


def same_word(word: str, other: str) -> bool:
    """Whether a word of a name is another, or its beginning: pos, position."""
    short, long = sorted((word, other), key=len)
    return short == long or (len(short) >= _BEGINNING and long.startswith(short))


def unit_at_end(text: str, si: str) -> str | None:
    """Unit of the quantity with the SI unit `si` at the end of a name; None if there is none.

    Examples
    --------
    >>> unit_at_end("ClutchPos_mm", "m"), unit_at_end("p_bar_g", "Pa"), unit_at_end("dutyPct", "1")
    ('mm', 'bar(g)', '%')
    >>> unit_at_end("PressurekPa", "Pa"), unit_at_end("position_m", "s"), unit_at_end("mm", "m")
    (None, None, None)
    """
    return next((unit for _, ending in _endings(text) if (unit := _unit_called(ending, si))), None)


def _endings(text: str) -> Iterator[tuple[str, str]]:
    """All ways to split a name into a beginning and an end that may be a unit, the longest end first."""
    text = text.strip()
    for match in _UNIT_START.finditer(text):
        base, ending = text[: match.start()], text[match.end() :]
        if "(" in match.group():
            ending = ending.removesuffix(")")
        prefixed = not match.group() and (base[-1:] + ending).casefold() in _UNITS_ANY_CASE  # the k of kPa
        if base and ending and not prefixed:
            yield base, ending


def _unit_called(text: str, si: str) -> str | None:
    """Unit with this spelling, in any case unless that makes another unit of it; the unit 1 is no name."""
    spelled = unit_spelled(text)
    units = [unit for unit in known_units(si) if unit != "1"]
    any_case = {unit.casefold(): unit for unit in units if len(unit) > 1 and unit != "mN"}  # MN is another
    return spelled if spelled in units else any_case.get(text.casefold())


def unit_spelled(text: str | None) -> str | None:
    """A unit in the spelling of the table of units, if known; None if there is no unit.

    Examples
    --------
    >>> unit_spelled("bar (g)"), unit_spelled("barg"), unit_spelled("-"), unit_spelled("Prozent"), unit_spelled(" ")
    ('bar(g)', 'bar(g)', '1', '%', None)
    """
    unit = printable(re.sub(r"\s", "", text or "")).replace("\N{GREEK SMALL LETTER MU}", "\N{MICRO SIGN}")
    return SPELLINGS.get(unit.casefold(), unit) or None


def _key(name: str) -> str:
    return re.sub(r"[\s_]+", "_", name.strip().casefold())


_KEYS = {_key(name): name for name in QUANTITIES}


def heading_problems(columns: Sequence[Heading], required: Sequence[str] = REQUIRED) -> list[str]:
    """Problems of the headings of a file: duplicate, without unit, with unknown unit, or missing."""
    same: dict[str, list[Heading]] = defaultdict(list)
    for column in columns:
        if column.name is not None:
            same[column.name].append(column)
    problems = [_duplicate(name, group) for name, group in same.items() if len(group) > 1]
    problems += [_unit_problem(column, column.name) for column in columns if column.name and column.si is None]
    missing = [name for name in required if name not in same]
    if missing:
        problems.append(_missing(missing, columns))
    return problems


def ignored(columns: Sequence[Heading]) -> list[str]:
    """Warning about unknown columns, if there are any."""
    unknown = [column.text for column in columns if column.name is None and column.text]
    if not unknown:
        return []
    subject = f"column {_some(unknown)} is" if len(unknown) == 1 else f"columns {_some(unknown)} are"
    return [f"{subject} unknown and left out; the known columns are {', '.join(QUANTITIES)}."]


def without_numbers(others: Sequence[tuple[str, str]]) -> list[str]:
    """Warning about channels without numbers, if there are any: their names, and what they hold.

    Examples
    --------
    >>> without_numbers([("Gear", "text")])
    ["left out channels without numbers (1): 'Gear' (text)."]
    """
    shown = listed((f"'{shortened(name)}' ({what})" for name, what in others), _SHOWN_OTHERS)
    return [f"left out channels without numbers ({len(others)}): {shown}."] if others else []


def is_unit_of(name: str, unit: str | None) -> bool:
    """Whether a unit is known and one of the quantity `name`."""
    return unit in UNITS and UNITS[unit].si == QUANTITIES[name]


def _duplicate(name: str, group: list[Heading]) -> str:
    where = " and ".join(str(column.index + 1) for column in group)
    texts = ", ".join(f"'{column.text}'" for column in group)
    return f"columns {where} ({texts}) all mean '{name}'; keep one of them, or select it with a channel map."


def _unit_problem(column: Heading, name: str) -> str:
    si = QUANTITIES[name]
    units = known_units(si)
    if column.unit is None:
        also = f" (or another of {', '.join(units[1:])})" if units[1:] else ""
        return f"column {column.index + 1} '{column.text}' has no unit in brackets; write {name} [{si}]{also}."
    lower = {unit.casefold(): unit for unit in units}
    near = difflib.get_close_matches(column.unit.casefold(), lower, n=1)
    hint = f"did you mean [{lower[near[0]]}]? Known are" if near else "use one of"
    return (
        f"column {column.index + 1} '{column.text}': unit [{column.unit}] is not known here; {hint} {', '.join(units)}."
    )


def _missing(names: list[str], columns: Sequence[Heading]) -> str:
    unknown = {_key(column.text.partition("[")[0]): column.text for column in columns if column.name is None}
    parts = []
    for name in names:
        near = difflib.get_close_matches(name, unknown, n=1, cutoff=0.5)
        hint = f"; is it '{unknown[near[0]]}'?" if near else ""
        parts.append(f"'{name}' (write {name} [{QUANTITIES[name]}]{hint})")
    noun = "column" if len(names) == 1 else "columns"
    return f"no {noun} {', '.join(parts)}; its columns are {_some([column.text for column in columns])}."


def _some(texts: Sequence[str]) -> str:
    return listed((f"'{shortened(text, _SHOWN_LENGTH)}'" for text in texts), _SHOWN_COLUMNS)
