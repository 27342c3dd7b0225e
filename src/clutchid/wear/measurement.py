"""What became of a recording: its reading, with a leak."""

from __future__ import annotations

from typing import NamedTuple

from clutchid.estimation.assess.comparison import comparison
from clutchid.estimation.assess.engaging import Measurement, change_of, measured
from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.result import Fit
from clutchid.recordings.strokes.vented_rest import RestShift

__all__ = ["Leak", "Measurement", "Reading", "leak_of", "measured", "unmeasured"]


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
    a change explains; `rest` how far the vented rest has moved since, if that is known; `reason` is why a recording
    that was read gives no measurement, empty where it gives one.
    """

    status: str
    message: str
    trust: str
    measurement: Measurement | None
    leak: Leak | None = None
    departs: bool = False
    rest: RestShift | None = None
    reason: str = ""

    @property
    def has_result(self) -> bool:
        """Whether the recording was read."""
        return self.status in ("ok", "warning")

    @property
    def unmeasured(self) -> str:
        """Why it gives no measurement, in a sentence; empty where it gives one."""
        return "" if self.measurement is not None else self.reason or self.message


def leak_of(fit: Fit) -> Leak | None:
    """The leak that a reading finds; None if it finds none, or its model has no leak."""
    found = next((change for change in fit.changes if change.name == "C_A0"), None)
    return Leak(found.after - found.before, found.std, found.probability) if found else None


def unmeasured(fit: Fit) -> str:
    """Why a recording that was fitted from a calibration gives no measurement, in a sentence; empty if it gives one.

    A load that is only uncertain gives one with its band.
    """
    if fit.status == "failed" or not fit.converged:
        return f"its search did not converge: {fit.message}".rstrip(".") + "."
    judged, compared = verdict(fit), comparison(fit)
    if judged.flawed:
        return " ".join(judged.reasons)
    if compared is None:
        return "the calibration has no load in its file, so that there is nothing to compare with; save it again."
    if change_of(compared) is None:
        furthest = 1e3 * compared.reach
        return (
            f"the position of half load, or its interval, is not determined within the {furthest:.1f} mm that were "
            "reached; record longer strokes."
        )
    return ""
