"""Changes since a calibration, as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from clutchid.estimate.changes import Change
from clutchid.estimate.result import Fit

#: Most groups of changes that a summary shows with their values.
MOST_WITH_VALUES = 2


def notes_of(fit: Fit) -> list[str]:
    """Notes on a result: changes since the calibration, then what the data determine."""
    return [*change_sentences(fit.changes), *fit.notes]


def change_sentences(changes: Sequence[Change]) -> list[str]:
    """A sentence for each group of parameters that has changed, or may have changed, in each recording."""
    groups = groupby(changes, key=lambda change: (change.recording, change.group, change.fitted, change.distance))
    return [_sentence(recording, group, list(members)) for (recording, group, *_), members in groups]


def short_changes(changes: Sequence[Change]) -> list[str]:
    """The same in a few words each, for a summary; of many groups without the values."""
    groups = groupby(changes, key=lambda change: (change.recording, change.group, change.fitted, change.distance))
    members = [(recording, list(each)) for (recording, *_), each in groups]
    return [_short(recording, each, len(members) <= MOST_WITH_VALUES) for recording, each in members]


def _short(recording: str, changes: Sequence[Change], with_values: bool) -> str:
    state = "changed" if changes[0].fitted else "may have changed"
    values = f" ({', '.join(map(_from_to, changes))})" if with_values else ""
    return f"{changes[0].group} {state} in {recording}{values}"


def _sentence(recording: str, group: str, changes: Sequence[Change]) -> str:
    values = ", ".join(map(_from_to, changes))
    first = changes[0]
    if first.fitted:
        return f"{recording}: {group} has changed since the calibration and was fitted with the load ({values})."
    change = f"{group} may have changed since the calibration ({values}), {first.distance:.1f} standard deviations"
    return (
        f"{recording}: {change}; it was fixed, and the interval is widened for an unconfirmed change. If the change is "
        "confirmed, free it with a prior."
    )


def _from_to(change: Change) -> str:
    unit = "" if change.unit == "1" else f" {change.unit}"
    return f"{change.name} {change.before:.4g} -> {change.after:.4g}{unit}"
