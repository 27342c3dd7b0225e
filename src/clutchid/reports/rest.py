"""A vented rest that has moved since the calibration, in words and as JSON."""

from __future__ import annotations

from clutchid.estimation.assess.rest import Cause, MovedRest, moved_rests
from clutchid.estimation.result import Fit

_CAUSE: dict[Cause, str] = {
    "sensor": "the position sensor or its bracket has moved, or was exchanged",
    "wear": "wear, by which the travel to the far stop has grown as much",
    "unknown": "wear or the position sensor; several recordings in clutchid track decide",
}


def rest_sentences(fit: Fit) -> list[str]:
    """A sentence for each rest that has moved."""
    return [f"{one.recording}: {rest_words(one)}." for one in moved_rests(fit)]


def rest_words(one: MovedRest) -> str:
    """How far a rest has moved, why, and what was done about it."""
    done = "subtracted, so that the load is over the travel from the rest" if one.subtracted else "kept"
    return f"the vented rest has moved by {one.shift} since the calibration ({_CAUSE[one.cause]}); {done}"


def rests_json(fit: Fit) -> dict[str, dict[str, float | str | None]]:
    """The shift of the rest of each recording in m with its 95 % interval, where known; a cause where it has moved."""
    causes = {one.recording: one.cause for one in moved_rests(fit)}
    return {
        name: {"value": rest.value, "low": rest.low, "high": rest.high, "cause": causes.get(name)}
        for name, recording in fit.recordings.items()
        if (rest := recording.rest) is not None
    }
