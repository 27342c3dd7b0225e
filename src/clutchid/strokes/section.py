"""A `Section`: a stroke or rest and its summary, and chosen sections joined to one log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from clutchid.errors import DataError
from clutchid.log import HOLE, Log, concatenated
from clutchid.strokes.stream import joined_edges

SectionKind = Literal["stroke", "rest"]


@dataclass(frozen=True, slots=True)
class SectionSummary:
    """Motion of a section; positions in m as measured, times in s.

    `level` is the position of the vented rest estimated up to that time (the sensor's zero), `reach` the largest travel
    from there up to that time. `vented_rest` is the time at rest and vented before the section (for a rest: within it),
    which may be longer than the part of it in `Section.log`. `missing` is the fraction of samples without a position.
    """

    lowest: float
    highest: float
    level: float
    reach: float
    vented_rest: float
    missing: float


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """A stroke or a rest: its samples `log` from `start` to `end` in s, and the index `first` of its first sample.

    A section of kind "stroke" is the motion between two rests, with all strokes in it; one with a long hold is
    divided there. Its samples begin with up to half a second of the vented rest before it, so that a
    simulation can start there with Eq. (24); `departure` is the time in s at which the piston leaves it (`start` where
    there is none). `divided`: the stroke before goes on in this section, a long hold or the rest of too long a stroke.
    Two sections are adjacent if the last sample of one is followed by the first of the other.
    """

    kind: SectionKind
    log: Log
    start: float
    end: float
    departure: float
    first: int
    summary: SectionSummary
    divided: bool = False

    def __len__(self) -> int:
        return len(self.log)

    @property
    def seconds(self) -> float:
        """Time from the first to the last sample in s."""
        return self.end - self.start


def joined(sections: Iterable[Section]) -> Log:
    """Sections of one recording as one log in order of time, so that each is a segment of its own in a fit.

    Adjacent sections are joined without a hole. No sample is changed. Where two sections are not adjacent but the gap
    is too short to count as a hole, a sample with NaN in every column is inserted.

    Parameters
    ----------
    sections : Sections
        Disjoint, with the same columns, at least one.

    Raises
    ------
    DataError
        If there is no section, columns differ, or sections overlap.

    Examples
    --------
    >>> from clutchid.strokes.cutting import sections_of
    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> log = Log(t, {"position": np.interp(t, [1.5, 1.6, 2.0, 2.3], [0.0, 0.02, 0.02, 0.0])})
    >>> first, stroke, last = sections_of(log)
    >>> len(joined([last, first])), np.array_equal(joined([first, stroke, last])["position"], log["position"])
    (2700, True)
    """
    ordered = sorted(sections, key=lambda section: section.first)
    if not ordered:
        raise DataError("no section is given; at least one is needed.")
    logs = [section.log for section in ordered]
    names = tuple(logs[0].columns)
    for previous, other in pairwise(logs):
        if set(other.columns) != set(names) or not other.time[0] > previous.time[-1]:
            raise DataError(
                f"{other.name}: a section that begins at {other.time[0]:.6g} s overlaps with the one before, or has "
                "other columns; join disjoint sections of one recording."
            )
    steps = [np.diff(log.time) for log in logs if len(log) > 1]
    short = 2 * HOLE * float(np.median(np.concatenate(steps))) if steps else np.inf
    parts = logs[:1]
    for before, after in pairwise(ordered):
        if _needs_hole(before, after, short):
            parts.append(
                Log(np.array([0.5 * (before.end + after.start)]), {name: np.array([np.nan]) for name in names})
            )
        parts.append(after.log)
    return replace(concatenated(parts), edges=joined_edges(logs), warnings=())


def _needs_hole(before: Section, after: Section, short: float) -> bool:
    """Whether two sections are not adjacent, yet the gap may be too short to count as a hole."""
    return before.first + len(before) != after.first and after.start - before.end <= short
