"""Stuck sensor: a column that is constant although it should show noise or the valves move the piston."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.check import Check, Grade
from clutchid.inspection.reading import Reading, spread_over
from clutchid.inspection.saturation import LONGER, no_noise
from clutchid.inspection.signal import LEFT_OUT
from clutchid.log import FloatArray

#: Shortest time in s that counts as stuck: shorter ones are lost messages, which a logger fills with the last value.
LEAST = 0.05

#: Fraction of the reach next to each end in which the piston may stand still.
NEAR_END = 0.2

#: Factor by which supply pressure, dead volume and load may lengthen the time until the piston moves.
PATIENCE = 2.0


def stuck(reading: Reading, name: str) -> Check:
    """Whether the sensor of the column `name` was stuck.

    Detected by missing noise, which a piston at rest still shows; for the position also by a valve that is open for
    longer than the model needs to move the piston by a tenth of its stroke.
    """
    title, noise = f"stuck {name}", reading.noisy(name)
    by_valves = name == "position" and reading.driven
    unmoved, tested = _unmoved(reading) if by_valves else ([], 0)
    spans = _joined([*(_frozen(reading, name) if noise else []), *unmoved])
    if not spans:
        if noise or tested:
            return Check(title, "never", "good", f"{name} changes all the time.")
        return Check(title, "-", "undetermined", no_noise(name))
    seconds = sum(stop - start for start, stop in spans)
    grade: Grade = "bad" if any(_pushed(reading, *span) for span in spans) else "suspect"
    start, stop = max(spans, key=lambda span: span[1] - span[0])
    more = f" and {len(spans) - 1} more" if len(spans) > 1 else ""
    sentence = (
        f"{name} is constant from {start:.3f} to {stop:.3f} s{more}, {seconds:.3g} s in total, although noise or the "
        "open valve should change it: the sensor was stuck or its last value was repeated. A fit would take it for a "
        "piston at rest and estimate a load that does not exist; leave these samples empty."
    )
    return Check(title, f"{seconds:.3g} s from {start:.3f} s", grade, sentence)


def _frozen(reading: Reading, name: str) -> list[tuple[float, float]]:
    """Start and end times of constant runs, except at the extreme values: those are checked for saturation."""
    found, ends, time = reading.runs[name], reading.ends[name], reading.log.time
    inner = (found.value != ends[0]) & (found.value != ends[1])
    usual = found.longest(inner, LEFT_OUT)
    long = inner & (found.length > LONGER * usual) & (found.length * reading.step > LEAST)
    return [
        (float(time[a]), float(time[a + n - 1])) for a, n in zip(found.start[long], found.length[long], strict=True)
    ]


def _pushed(reading: Reading, start: float, stop: float) -> bool:
    """Whether a valve was open between two times in s for long enough to move the piston."""
    if not reading.driven:
        return False
    span = slice(*np.searchsorted(reading.log.time, (start, stop)).tolist())
    passed = reading.supply[span].sum(), reading.exhaust[span].sum()
    return any(opened * reading.step > needed for opened, needed in zip(passed, reading.quick, strict=True))


def _unmoved(reading: Reading) -> tuple[list[tuple[float, float]], int]:
    """Start and end times of openings without motion although the piston was not at that end; number of tested ones."""
    y, time = reading.log["position"], reading.log.time
    low, high = (float(q) for q in np.nanquantile(y, (0.005, 0.995)))
    blur, margin = reading.blur("position"), NEAR_END * (high - low)
    found, tested = [], 0
    for supply, needed in zip((True, False), reading.quick, strict=True):
        opened = np.concatenate([[0.0], np.cumsum(reading.supply if supply else reading.exhaust)]) * reading.step
        starts, stops = reading.open_alone(supply)
        # pulse edges are known to one sample only
        long = np.flatnonzero(opened[stops] - opened[starts] > PATIENCE * needed + 2 * reading.step)
        for i in long[spread_over(long.size)]:
            part = _finite(y[starts[i] : stops[i]])
            # a piston that never moved is at the vented end
            away = part.size > 1 and (part.max() <= high - margin if supply else part.min() > low + margin)
            tested += int(away)
            if away and np.ptp(part) <= blur:
                found.append((float(time[starts[i]]), float(time[stops[i] - 1])))
    return found, tested


def _finite(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def _joined(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Merge overlapping intervals."""
    joined: list[tuple[float, float]] = []
    for start, stop in sorted(spans):
        if joined and start <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(stop, joined[-1][1]))
        else:
            joined.append((start, stop))
    return joined
