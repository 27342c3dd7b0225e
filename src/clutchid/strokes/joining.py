"""`joined`: chosen sections as one `Log` with holes between them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from clutchid.errors import DataError
from clutchid.log import HOLE, Log, concatenated
from clutchid.strokes.edges import joined_edges
from clutchid.strokes.section import Section


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
    >>> from clutchid.strokes.cutting import cut
    >>> t = np.arange(0.0, 4.0, 1e-3)
    >>> log = Log(t, {"position": np.interp(t, [1.5, 1.6, 2.0, 2.3], [0.0, 0.02, 0.02, 0.0])})
    >>> first, stroke, last = cut(log)
    >>> len(joined([last, first])), np.array_equal(joined([first, stroke, last])["position"], log["position"])
    (2700, True)
    """
    ordered = sorted(sections, key=lambda section: section.first)
    if not ordered:
        raise DataError("no section is given; at least one is needed.")
    logs = [section.log for section in ordered]
    names = tuple(logs[0].columns)
    for one, other in pairwise(logs):
        if set(other.columns) != set(names):
            raise DataError(
                f"{other.name}: sections with different columns cannot be joined; join sections of one recording only."
            )
        if not other.time[0] > one.time[-1]:
            raise DataError(
                f"{other.name}: a section begins at {other.time[0]:.6g} s, but the one before ends at "
                f"{one.time[-1]:.6g} s; join disjoint sections of one recording."
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
