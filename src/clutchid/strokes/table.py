"""`sections_table`: strokes and rests as a text table for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from clutchid.messages import text_table
from clutchid.strokes.section import Section

_TITLES = (
    "no.", "kind", "label", "start [s]", "length [s]", "from [mm]", "to [mm]", "opening [mm/s]", "closing [mm/s]",
    "vented rest [s]", "missing",
)  # fmt: skip

#: Number of left-aligned text columns; the others are numeric.
_TEXT_COLUMNS = 3


@dataclass(frozen=True, slots=True)
class _Row:
    """One line of the table: a section, or the parts of one long rest."""

    numbers: tuple[int, int]
    section: Section
    samples: int
    end: float
    lowest: float
    highest: float
    missing: float


def sections_table(sections: Iterable[Section]) -> str:
    """Plain text table of sections, for a terminal; the parts of a long rest are one line.

    Number, kind, label, start, length, lowest and highest position from the vented rest, top speeds while opening and
    closing, vented rest before (for a rest: in it), and the fraction of samples without a position.

    Examples
    --------
    >>> import numpy as np
    >>> from clutchid.log import Log
    >>> from clutchid.strokes.cutting import sections_of
    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> y = np.interp(t, [1.5, 1.7, 2.0, 2.3], [0.0, 0.02, 0.02, 0.0])
    >>> for line in sections_table(sections_of(Log(t, {"position": y}))).splitlines():
    ...     print(line[:49])
      no.  kind    label        start [s]  length [s]
      1    rest    vented rest      0.000       0.999
      2    stroke  full stroke      1.000       1.299
      3    rest    vented rest      2.300       1.699
    """
    rows = [_TITLES, *map(_cells, _rows(sections))]
    return "\n".join(text_table(rows, _TEXT_COLUMNS))


def _rows(sections: Iterable[Section]) -> Iterator[_Row]:
    last: _Row | None = None
    for number, section in enumerate(sections, 1):
        row = _row(number, section)
        if last is not None and _goes_on(last, section):
            samples = last.samples + row.samples
            missing = (last.missing * last.samples + row.missing * row.samples) / samples
            low, high = min(last.lowest, row.lowest), max(last.highest, row.highest)
            numbers = last.numbers[0], number
            last = replace(row, numbers=numbers, section=last.section, samples=samples, lowest=low, highest=high,
                           missing=missing)  # fmt: skip
            continue
        if last is not None:
            yield last
        last = row
    if last is not None:
        yield last


def _row(number: int, section: Section) -> _Row:
    summary = section.summary
    low, high = summary.lowest - summary.level, summary.highest - summary.level
    return _Row((number, number), section, len(section), section.end, low, high, summary.missing)


def _goes_on(row: _Row, section: Section) -> bool:
    first = row.section
    same = first.kind == section.kind == "rest" and first.label == section.label
    return same and first.first + row.samples == section.first


def _cells(row: _Row) -> tuple[str, ...]:
    section, summary = row.section, row.section.summary
    first, last = row.numbers
    rest = row.end - section.start if last > first and summary.vented_rest > 0 else summary.vented_rest
    return (
        str(first) if first == last else f"{first}-{last}",
        section.kind,
        section.label,
        f"{section.start:.3f}",
        f"{row.end - section.start:.3f}",
        _scaled(row.lowest, 1e3, 2),
        _scaled(row.highest, 1e3, 2),
        _scaled(summary.opening_speed, 1e3, 0),
        _scaled(summary.closing_speed, 1e3, 0),
        f"{rest:.2f}",
        f"{100 * row.missing:.1f} %",
    )


def _scaled(value: float, factor: float, digits: int) -> str:
    """`value` times `factor`, without a sign before zero; a dash where it is unknown."""
    return f"{round(value * factor, digits) + 0.0:.{digits}f}" if math.isfinite(value) else "-"
