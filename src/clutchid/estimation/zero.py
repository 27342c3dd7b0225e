"""Results of fits with the shifts of the vented rests of their recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from clutchid.estimation.result import Fit, Recording
from clutchid.recordings.strokes.vented_rest import Rested


def with_rests(result: Fit, rested: Sequence[Rested]) -> Fit:
    """`result` with the shifts of the rests of its recordings."""
    known = {one.log.name: one for one in rested if one.shift is not None}

    def added(recordings: Mapping[str, Recording]) -> dict[str, Recording]:
        return {
            name: replace(one, rest=known[name].shift, subtracted=known[name].subtracted) if name in known else one
            for name, one in recordings.items()
        }

    if not known:
        return result
    return replace(result, recordings=added(result.recordings), verification=added(result.verification))
