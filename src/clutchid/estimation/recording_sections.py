"""Sections ``[recording.'STEM']`` of a parameter file: start values of segments, and parameters of one recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from clutchid.names import unknown_names
from clutchid.parameters import is_number
from clutchid.strokes.vented_rest import FURTHEST

_START_KEYS = ("position_start", "pressure_a_start")

#: What was subtracted from the position of a recording in m, because its vented rest had moved.
REST = "rest_shift"

Starts = tuple[tuple[float, float], ...]


def starts_in(recordings: dict[str, Any], names: Sequence[str]) -> tuple[dict[str, Starts], list[str]]:
    """Start values of the segments of every recording, and problems; `names` are those of the parameters."""
    starts: dict[str, Starts] = {}
    problems = []
    for stem, entry in recordings.items():
        wrong = _start_problems(stem, entry, names)
        if wrong:
            problems += wrong
        else:
            pairs = zip(*(entry.get(key, []) for key in _START_KEYS), strict=True)
            starts[stem] = tuple((float(position), float(pressure)) for position, pressure in pairs)
    return starts, problems


def own_values(recordings: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Parameters of single recordings, and `REST`, by stem."""
    own = {stem: {k: float(v) for k, v in entry.items() if k not in _START_KEYS} for stem, entry in recordings.items()}
    return {stem: values for stem, values in own.items() if values}


def _start_problems(stem: str, entry: object, names: Sequence[str]) -> list[str]:
    """Problems with the start values of one recording."""
    if not isinstance(entry, dict):
        return [f"[recording] {stem} = {entry!r}: a section [recording.'{stem}'] with {_in_words()} is needed."]
    where = f"[recording.'{stem}']"
    names = (*names, REST)
    known = (*_START_KEYS, *names)
    problems = unknown_names(entry, known, f"entry of {where}")
    problems += [
        f"{where} {name} = {entry[name]!r}: a number is needed."
        for name in names
        if name in entry and not is_number(entry[name])
    ]
    if is_number(entry.get(REST)) and not abs(entry[REST]) <= FURTHEST:
        problems.append(f"{where} {REST} = {entry[REST]!r} m: a rest moves by at most {FURTHEST:g} m.")
    lists = {key: entry.get(key, []) for key in _START_KEYS}
    for key, values in lists.items():
        if not isinstance(values, list) or not all(is_number(v) and math.isfinite(v) for v in values):
            problems.append(f"{where} {key} = {values!r}: a list of finite numbers is needed, one per segment.")
        elif key == "pressure_a_start" and not all(v > 0 for v in values):
            problems.append(f"{where} {key} = {values!r}: pressures are absolute, in Pa, and above 0.")
    if not problems and len({len(values) for values in lists.values()}) > 1:
        counts = " and ".join(str(len(values)) for values in lists.values())
        problems.append(f"{where}: {_in_words()} must have the same length; they have {counts} entries.")
    return problems


def _in_words() -> str:
    return " and ".join(_START_KEYS)
