"""The grammar of column headings: ``name [unit]``.

Names are compared without regard to case, and blanks count as underscores; units are compared exactly, without blanks.
"""

from __future__ import annotations

import difflib
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from clutchid.log import COLUMNS, INPUTS
from clutchid.units import SPELLINGS, UNITS, known_units

#: Names that have a meaning, and their SI units.
QUANTITIES: Mapping[str, str] = MappingProxyType({"time": "s", **COLUMNS})

#: Names without which a file is no recording.
REQUIRED = ("time", "position", *INPUTS)

_GRAMMAR = re.compile(r"(?P<name>[^\[]*)(?:\[(?P<unit>[^\[\]]*)\]\s*)?")
_SHOWN = 12


@dataclass(frozen=True, slots=True)
class Heading:
    """One heading: its text as written, the quantity it names (None: not known) and its unit (None: not given).

    `comment` is what the file says of the channel besides.
    """

    index: int
    text: str
    name: str | None
    unit: str | None
    comment: str = ""

    @property
    def si(self) -> str | None:
        """SI unit of the values; None where the unit is not given, not known, or one of another quantity."""
        unit = UNITS.get(self.unit or "")
        if unit is None or (self.name is not None and unit.si != QUANTITIES[self.name]):
            return None
        return unit.si


def headings(cells: Iterable[str]) -> tuple[Heading, ...]:
    """The cells of a header, understood.

    Examples
    --------
    >>> [(h.name, h.unit) for h in headings(["Time  [ms]", "pressure_A [ bar (g) ]", "gear [1]"])]
    [('time', 'ms'), ('pressure_a', 'bar(g)'), (None, '1')]
    """
    return tuple(_heading(index, cell.strip()) for index, cell in enumerate(cells))


def _heading(index: int, text: str) -> Heading:
    match = _GRAMMAR.fullmatch(text)
    name, unit = match.group("name", "unit") if match else (text.partition("[")[0], None)
    return Heading(index, shortened(text), quantity_named(name), unit_spelled(unit))


def channel(index: int, text: str, unit: str | None, comment: str = "") -> Heading:
    """The heading of a channel whose unit stands apart from its name, as in MDF.

    Examples
    --------
    >>> channel(3, "Position", " mm "), channel(0, "TravelSensor", "").unit
    (Heading(index=3, text='Position', name='position', unit='mm', comment=''), None)
    """
    return Heading(index, shortened(text, 80), quantity_named(text), unit_spelled(unit), shortened(comment, 200))


def quantity_named(name: str) -> str | None:
    """The quantity that a name of the contract means; None for any other name."""
    return _KEYS.get(_key(name))


def unit_spelled(text: str | None) -> str | None:
    """A unit as the table of units spells it, where it is a known one; None where there is no unit.

    Examples
    --------
    >>> unit_spelled("bar (g)"), unit_spelled("barg"), unit_spelled("-"), unit_spelled("Prozent"), unit_spelled(" ")
    ('bar(g)', 'bar(g)', '1', '%', None)
    """
    unit = re.sub(r"\s", "", text or "").replace("\N{GREEK SMALL LETTER MU}", "\N{MICRO SIGN}")
    return SPELLINGS.get(unit.casefold(), unit) or None


def _key(name: str) -> str:
    return re.sub(r"[\s_]+", "_", name.strip().casefold())


_KEYS = {_key(name): name for name in QUANTITIES}


def heading_problems(columns: Sequence[Heading], required: Sequence[str] = REQUIRED) -> list[str]:
    """What is wrong with the headings of a file: duplicate, without unit, in an unknown unit, or missing."""
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
    """The warning that names the columns which have no meaning here, if there are any."""
    unknown = [column.text for column in columns if column.name is None and column.text]
    if not unknown:
        return []
    subject = f"column {_some(unknown)} is" if len(unknown) == 1 else f"columns {_some(unknown)} are"
    return [f"{subject} not known and left out; known are {', '.join(QUANTITIES)}."]


def shortened(text: str, length: int = 40) -> str:
    """`text` on one line and not longer than `length`, for a message."""
    line = " ".join(text.split())
    return line if len(line) <= length else line[: length - 1] + "…"


def _duplicate(name: str, group: list[Heading]) -> str:
    where = " and ".join(str(column.index + 1) for column in group)
    texts = ", ".join(f"'{column.text}'" for column in group)
    return f"columns {where} ({texts}) all mean '{name}'; keep one of them."


def _unit_problem(column: Heading, name: str) -> str:
    si = QUANTITIES[name]
    known = known_units(si)
    if column.unit is None:
        also = f" (or another of {', '.join(known[1:])})" if known[1:] else ""
        return f"column {column.index + 1} '{column.text}' has no unit in brackets; write {name} [{si}]{also}."
    lower = {unit.casefold(): unit for unit in known}
    near = difflib.get_close_matches(column.unit.casefold(), lower, n=1)
    hint = f"did you mean [{lower[near[0]]}]? Known are" if near else "use one of"
    return (
        f"column {column.index + 1} '{column.text}': unit [{column.unit}] is not known here; {hint} {', '.join(known)}."
    )


def _missing(names: list[str], columns: Sequence[Heading]) -> str:
    unknown = {_key(column.text.partition("[")[0]): column.text for column in columns if column.name is None}
    parts = []
    for name in names:
        near = difflib.get_close_matches(name, unknown, n=1, cutoff=0.5)
        hint = f"; did you mean it by '{unknown[near[0]]}'?" if near else ""
        parts.append(f"'{name}' (write {name} [{QUANTITIES[name]}]{hint})")
    noun = "column" if len(names) == 1 else "columns"
    return f"no {noun} {', '.join(parts)}; the file has {_some([column.text for column in columns])}."


def _some(texts: Sequence[str]) -> str:
    shown = ", ".join(f"'{text}'" for text in texts[:_SHOWN])
    return shown + (f" and {len(texts) - _SHOWN} more" if len(texts) > _SHOWN else "")
