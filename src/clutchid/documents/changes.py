"""Changes since a calibration, and a vented rest that has moved, as sentences."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby

from clutchid.documents.style import BAR
from clutchid.documents.tables import scientific
from clutchid.estimation import Change, Fit
from clutchid.estimation.assess.rest import Cause, MovedRest, moved_rests
from clutchid.estimation.assess.verdict import states_of_wear, verdict
from clutchid.inference.uncertainty.conditions import Assumption
from clutchid.inference.uncertainty.identifiability import in_words

_CAUSE: dict[Cause, str] = {
    "sensor": "the position sensor or its bracket has moved or was replaced",
    "wear": "wear: the travel to the far stop has grown by the same amount",
    "unknown": "wear or the position sensor; `clutchid track` with several recordings can tell which",
}


def rest_sentences(fit: Fit) -> list[str]:
    """A sentence for each rest that has moved."""
    return [f"{rest.recording}: {rest_words(rest)}." for rest in moved_rests(fit)]


def rest_words(rest: MovedRest) -> str:
    """Shift of a rest, its cause, and its correction."""
    correction = "subtracted, so the load is given over the travel from the rest" if rest.subtracted else "kept"
    return f"the vented rest has moved by {rest.shift} since the calibration ({_CAUSE[rest.cause]}); {correction}"


def rests_json(fit: Fit) -> dict[str, dict[str, float | str | None]]:
    """The shift of the rest of each recording in m with its 95 % interval, where known; a cause where it has moved."""
    causes = {rest.recording: rest.cause for rest in moved_rests(fit)}
    return {
        name: {"value": rest.value, "low": rest.low, "high": rest.high, "cause": causes.get(name)}
        for name, recording in fit.recordings.items()
        if (rest := recording.rest) is not None
    }


#: Most groups of changes that a summary shows with their values, and most parameters of a group.
_MOST_WITH_VALUES, _MOST_OF_A_GROUP = 2, 3

#: Probability from which on a group is said to have changed; below it may have.
_LIKELY = 0.5


def notes_of(fit: Fit) -> list[str]:
    """Notes on a result: of the verdict, changes since the calibration, what is assumed, what the data determine."""
    return [*verdict(fit).notes, *since_calibration(fit), *assumed_sentences(fit), *fit.notes]


def since_calibration(fit: Fit) -> list[str]:
    """A sentence for each vented rest that has moved, and each group of parameters that has changed, or may have."""
    return [*rest_sentences(fit), *change_sentences(fit)]


def assumed_sentences(fit: Fit) -> list[str]:
    """Assumptions on the conditions of the recordings, and how much the supply pressure moves the load."""
    return [_assumed(assumption, fit.load_per_supply, len(fit.recordings)) for assumption in fit.assumed]


def _assumed(assumption: Assumption, per_supply: float | None, of: int) -> str:
    """A sentence on a condition that is not known in some of several recordings."""
    supply = assumption.name == "P_S"
    where = f" in {', '.join(assumption.recordings)}" if len(assumption.recordings) < of else ""
    value = (
        f"{assumption.value / BAR:.2f} ± {assumption.half_width / BAR:.2f} bar"
        if supply
        else f"{assumption.value - 273.15:.0f} ± {assumption.half_width:.0f} °C"
    )
    text = f"{'supply pressure' if supply else 'air temperature'} not recorded"
    text += f"{' in the calibration' if assumption.recorded else where}: the calibrated value is assumed, {value}"
    if not supply or per_supply is None:
        return text
    text += "; outside this range the band is wrong, and the position alone cannot show that"
    return (
        f"{text}; a 1 % higher supply pressure changes this load by {per_supply:.1f} %. Record pressure_supply here "
        "and in the calibration to halve the band"
    )


def change_sentences(fit: Fit) -> list[str]:
    """A sentence for each group of parameters that has changed, or may have changed, in each recording.

    One load for several states of wear leaves a difference that changes only seem to explain.
    """
    if fit.changes and states_of_wear(fit) is not None:
        groups = in_words(list(dict.fromkeys(change.group for change in fit.changes)))
        return [
            f"one load cannot fit several states of wear, and the fit attributed the difference to {groups}: the "
            "actuator itself has not changed; estimate the recordings one by one."
        ]
    return [_sentence(fit, recording, list(members)) for (recording, _), members in _grouped(fit.changes)]


def short_changes(changes: Sequence[Change]) -> list[str]:
    """The same in a few words each, for a summary; of many groups without the values."""
    members = [(recording, list(group)) for (recording, _), group in _grouped(changes)]
    return [_short(recording, group, len(members) <= _MOST_WITH_VALUES) for recording, group in members]


def _grouped(changes: Sequence[Change]) -> Iterable[tuple[tuple[str, str], Iterable[Change]]]:
    return groupby(changes, key=lambda change: (change.recording, change.group))


def _short(recording: str, changes: Sequence[Change], with_values: bool) -> str:
    shown, others = changes[:_MOST_OF_A_GROUP], [change.name for change in changes[_MOST_OF_A_GROUP:]]
    also = f"; also {', '.join(others)}" if others else ""
    values = f": {', '.join(map(_from_to, shown))}{also}" if with_values else ""
    return f"{_state(changes[0])} in {recording} ({_probability(changes[0])}{values})"


def _sentence(fit: Fit, recording: str, changes: Sequence[Change]) -> str:
    values = ", ".join(_from_to(change, f"{fit.actuator.row(change.name).meaning}, ") for change in changes)
    return (
        f"{recording}: {_state(changes[0])} since the calibration ({_probability(changes[0])}): {values}; the load and "
        "its interval allow for it."
    )


def _state(change: Change) -> str:
    verb = "changed" if change.probability >= _LIKELY else "may have changed"
    return f"{change.group} {verb}"


def _probability(change: Change) -> str:
    return f"{'over ' if change.probability > 0.99 else ''}{100 * min(change.probability, 0.99):.0f} %"


def _from_to(change: Change, meaning: str = "") -> str:
    unit = "" if change.unit == "1" else f" {change.unit}"
    values = f"from {_rounded(change.before)} to {_rounded(change.after)}{unit}"
    return f"{meaning}{change.name}, {values}" if meaning else f"{change.name} {values}"


def _rounded(value: float) -> str:
    return scientific(float(f"{value:.4g}"), 0)
