"""What became of a recording: its reading, with a leak."""

from __future__ import annotations

from typing import NamedTuple

from clutchid.assess.engaging import Measurement, measured
from clutchid.estimate.result import Fit

__all__ = ["Leak", "Measurement", "Reading", "leak_of", "measured"]


class Leak(NamedTuple):
    """A leak of chamber A since its calibration.

    Its conductance in m³/(Pa·s) with the standard deviation, and the probability that it has changed.
    """

    conductance: float
    std: float
    probability: float


class Reading(NamedTuple):
    """What became of one recording: status and sentence as in every result, trust, and its measurement, if any.

    `leak` is that of chamber A, if one is probable; `departs` says that the truck is farther from its calibration than
    a change explains.
    """

    status: str
    message: str
    trust: str
    measurement: Measurement | None
    leak: Leak | None = None
    departs: bool = False

    @property
    def has_result(self) -> bool:
        """Whether the recording was read."""
        return self.status in ("ok", "warning")


def leak_of(fit: Fit) -> Leak | None:
    """The leak that a reading finds; None if it finds none, or its model has no leak."""
    found = next((change for change in fit.changes if change.name == "C_A0"), None)
    return Leak(found.after - found.before, found.std, found.probability) if found else None
