"""Travel in a reading against that of its calibration: whether the gain of a position may be wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator

from clutchid.estimation.assess.evidence import Reason
from clutchid.estimation.result import Fit
from clutchid.strokes.travel import TravelChange, travel_change, travel_of


def travel_changes(fit: Fit) -> dict[str, TravelChange]:
    """The change of travel of each recording of a reading; none where that of the calibration is not known."""
    before = fit.baseline.travel if fit.baseline else None
    if before is None or fit.departure is None or not math.isfinite(before.reach):
        return {}
    return {
        name: travel_change(before, travel_of(recording.measured), recording.subtracted)
        for name, recording in fit.recordings.items()
    }


def travel_reasons(fit: Fit) -> Iterator[Reason]:
    """Travels that have changed by more than wear explains."""
    for name, change in travel_changes(fit).items():
        if change.suspect:
            yield Reason(f"{name}: {change.sentence}")


def unchecked_gains(fit: Fit) -> list[str]:
    """That the gain of a position cannot be checked, a sentence for each recording without the far stop."""
    return [
        f"{name}: {change.sentence}"
        for name, change in travel_changes(fit).items()
        if not change.suspect and not change.checked
    ]
