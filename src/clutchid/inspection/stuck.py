"""Stuck sensor: a column that does not change while its noise should, or while the valves move the piston."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.finding import Finding, Verdict
from clutchid.inspection.reading import Reading, spread_over
from clutchid.inspection.saturation import LONGER, no_noise
from clutchid.inspection.signal import LEFT_OUT
from clutchid.log import FloatArray

#: Shortest stretch in s that counts as stuck: shorter ones are lost messages, which a logger fills with the last value.
LEAST = 0.05

#: Share of the reach beyond which the piston may stand at an end.
NEAR_END = 0.2

#: What supply pressure, dead volume and load may change of the time in which the piston moves.
PATIENCE = 2.0


def stuck(reading: Reading, name: str) -> Finding:
    """Whether the sensor of the column `name` stood still.

    Told by the noise, which goes on in a piston at rest; and for the position also by a valve that was open for longer
    than the model needs to move the piston by a tenth of its stroke.
    """
    check, noise = f"stuck {name}", reading.noisy(name)
    by_valves = name == "position" and reading.driven
    unmoved, tested = _unmoved(reading) if by_valves else ([], 0)
    spans = _joined([*(_frozen(reading, name) if noise else []), *unmoved])
    if not spans:
        if noise or tested:
            return Finding(check, "never", "good", f"{name} goes on changing.")
        return Finding(check, "-", "not tellable", no_noise(name))
    seconds = sum(stop - start for start, stop in spans)
    verdict: Verdict = "bad" if any(_pushed(reading, *span) for span in spans) else "look"
    start, stop = max(spans, key=lambda span: span[1] - span[0])
    more = f" and {len(spans) - 1} more" if len(spans) > 1 else ""
    sentence = (
        f"{name} does not change from {start:.3f} to {stop:.3f} s{more}, {seconds:.3g} s in all, where its noise or "
        "the open valve should show: the sensor was stuck or its last value was repeated; a fit takes it for a "
        "piston that is held, by a load that is not there; leave these samples empty."
    )
    return Finding(check, f"{seconds:.3g} s from {start:.3f} s", verdict, sentence)


def _frozen(reading: Reading, name: str) -> list[tuple[float, float]]:
    """Times from when to when a column has no noise, its extreme values apart: those are the saturation's."""
    found, ends, time = reading.runs[name], reading.ends[name], reading.log.time
    inner = (found.value != ends[0]) & (found.value != ends[1])
    usual = found.longest(inner, LEFT_OUT)
    long = inner & (found.length > LONGER * usual) & (found.length * reading.step > LEAST)
    return [
        (float(time[a]), float(time[a + n - 1])) for a, n in zip(found.start[long], found.length[long], strict=True)
    ]


def _pushed(reading: Reading, start: float, stop: float) -> bool:
    """Whether a valve was open between two times in s for as long as it takes to move the piston."""
    if not reading.driven:
        return False
    span = slice(*np.searchsorted(reading.log.time, (start, stop)).tolist())
    passed = reading.supply[span].sum(), reading.exhaust[span].sum()
    return any(opened * reading.step > needed for opened, needed in zip(passed, reading.quick, strict=True))


def _unmoved(reading: Reading) -> tuple[list[tuple[float, float]], int]:
    """Times from when to when an open valve did not move the piston, though it was not at that end; and of how many."""
    y, time = reading.log["position"], reading.log.time
    low, high = (float(q) for q in np.nanquantile(y, (0.005, 0.995)))
    blur, margin = reading.blur("position"), NEAR_END * (high - low)
    found, tested = [], 0
    for supply, needed in zip((True, False), reading.quick, strict=True):
        opened = np.concatenate([[0.0], np.cumsum(reading.supply if supply else reading.exhaust)]) * reading.step
        starts, stops = reading.open_alone(supply)
        # the edges of a pulse are known to a sample only
        long = np.flatnonzero(opened[stops] - opened[starts] > PATIENCE * needed + 2 * reading.step)
        for i in long[spread_over(long.size)]:
            seen = _finite(y[starts[i] : stops[i]])
            # a piston that never moved is at the end where the exhaust valve leaves it
            away = seen.size > 1 and (seen.max() <= high - margin if supply else seen.min() > low + margin)
            tested += int(away)
            if away and np.ptp(seen) <= blur:
                found.append((float(time[starts[i]]), float(time[stops[i] - 1])))
    return found, tested


def _finite(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def _joined(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same times without overlaps."""
    joined: list[tuple[float, float]] = []
    for start, stop in sorted(spans):
        if joined and start <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(stop, joined[-1][1]))
        else:
            joined.append((start, stop))
    return joined
