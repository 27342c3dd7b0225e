"""Vehicles that differ from the others of their type, those with alarms, and those with few readings."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from clutchid.names import printable
from clutchid.reports.fleet_values import Spans, VehicleRow, rate_shown
from clutchid.reports.style import MM

#: A robust z score beyond this is odd. Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993: of normal rates
#: one in 2000 is beyond.
ODD_SCORE = 3.5

#: Vehicles of a type from which their median and its deviation are taken: with fewer, the deviation itself is known to
#: hardly better than half (guessed).
ODD_AT_LEAST = 8

#: Share of the recordings without a reading beyond which a vehicle is odd.
ODD_SHARE = 0.5

#: The median absolute deviation of the normal distribution in its standard deviations.
_MAD = 0.6745


#: What a vehicle can stand out by, and what that means.
MARKS = {
    "alarm": "a clutch replaced, a sudden change, a leak, a departure",
    "fast": "wears faster than others of its type",
    "slow": "wears more slowly than others of its type",
    "few readings": "most recordings do not count",
}


class Odd(NamedTuple):
    """A vehicle that stands out by one of MARKS, why, and how much, to sort them by."""

    vehicle: VehicleRow
    mark: str
    reason: str
    score: float


def odd_vehicles(vehicles: Sequence[VehicleRow], spans: Spans) -> list[Odd]:
    """By mark, the oddest first; a vehicle has a row for each mark.

    A rate is odd where its robust z score among the vehicles of its type is beyond ODD_SCORE: from their median and
    median absolute deviation, which the odd ones hardly change.
    """
    alarmed = [Odd(one, "alarm", " ".join(map(_sentence, one.alarms)), len(one.alarms)) for one in vehicles]
    few = [Odd(one, "few readings", _few(one), one.recordings - one.counted) for one in vehicles if _misses(one)]
    found = [*(odd for odd in alarmed if odd.score), *_odd_rates(vehicles, spans), *few]
    marks = list(MARKS)
    return sorted(found, key=lambda odd: (marks.index(odd.mark), -abs(odd.score)))


def _odd_rates(vehicles: Sequence[VehicleRow], spans: Spans) -> list[Odd]:
    groups: dict[tuple[str, str, bool], list[VehicleRow]] = defaultdict(list)
    for one in vehicles:
        if np.isfinite(one.rate):
            groups[one.type, one.axis, bool(np.isfinite(one.wear))].append(one)
    found = []
    for (type_, _, _), members in groups.items():
        rates = np.array([rate_shown(one, spans) for one in members])
        median = float(np.median(rates))
        deviation = float(np.median(np.abs(rates - median)))
        if len(members) < ODD_AT_LEAST or deviation == 0.0:
            continue
        scores = _MAD * (rates - median) / deviation
        others = f"of the {len(members):,} vehicles {f'of type {printable(type_)}' if type_ else 'of no given type'}"
        for one, rate, score in zip(members, rates, scores, strict=True):
            if abs(score) > ODD_SCORE:
                reason = (
                    f"{rate / MM:.3f} mm per {spans.rate_words}; the median {others} is {median / MM:.3f} mm; robust "
                    f"z score {'+' if score > 0 else '−'}{abs(score):.1f}."
                )
                found.append(Odd(one, "fast" if score > 0 else "slow", reason, float(score)))
    return found


def _few(one: VehicleRow) -> str:
    words = ", ".join(f"{number} {printable(status)}" for status, number in one.statuses.items() if number)
    return f"{one.counted} of {one.recordings} recordings count; by status: {words or 'not known'}."


def _misses(one: VehicleRow) -> bool:
    return one.recordings - one.counted > ODD_SHARE * one.recordings


def _sentence(words: str) -> str:
    words = printable(words).rstrip(".")
    return f"{words[:1].upper()}{words[1:]}."
