"""A day at 1 kHz cut into strokes, on one core: ``python benchmarks/day.py``.

The recording is made in memory, piece by piece, from a few shifts, slips and rests with noise, quantisation, drop-outs
and a drifting zero; it never exists as a whole. Prints the processor time of the cutting alone (making the pieces is
timed apart), samples per second of it, and the highest memory of the process.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections import Counter
from collections.abc import Iterator

import numpy as np

from clutchid.log import Log
from clutchid.strokes import choose, joined, sections_of

RATE = 1000

#: Strokes as (time in s, position in m): a full stroke, a gear shift, a pull-away; then the rest until the next.
STROKES = (
    ((0.0, 0.15, 0.9, 1.2), (0.0, 0.022, 0.022, 0.0)),
    ((0.0, 0.15, 0.8, 0.95, 1.5, 1.7), (0.0, 0.022, 0.022, 0.0085, 0.003, 0.0)),
    ((0.0, 0.15, 1.0, 1.4, 3.2, 3.6), (0.0, 0.022, 0.022, 0.0075, 0.005, 0.0)),
)


def course(seconds: float, rng: np.random.Generator) -> tuple[list[float], list[float]]:
    """Corners of the position over a day: strokes every few seconds, and the truck parked now and then."""
    times, levels, at = [0.0], [0.0], 5.0
    while at < seconds:
        t, y = STROKES[rng.integers(len(STROKES))]
        times += [at + x for x in t]
        levels += list(y)
        at = times[-1] + (rng.uniform(1800, 7200) if rng.uniform() < 0.002 else rng.uniform(1.0, 12.0))
    return [*times, at], [*levels, 0.0]


def pieces(seconds: float, size: int, spent: list[float]) -> Iterator[Log]:
    """The day in pieces of `size` samples; the time that it takes to make them is added to `spent`."""
    rng = np.random.default_rng(0)
    times, levels = course(seconds, rng)
    noise = 2e-5 * rng.standard_normal(size)
    for first in range(0, round(seconds * RATE), size):
        begin = time.process_time()
        n = np.arange(first, min(first + size, round(seconds * RATE)))
        t = n / RATE
        wanted = np.interp(t, times, levels)
        soon = np.interp(t + 0.02, times, levels)
        position = wanted + 1e-3 + 0.5e-3 * t / 86400 + np.roll(noise, rng.integers(size))[: n.size]
        position = 1.2e-5 * np.round(position / 1.2e-5)
        position[rng.integers(0, n.size, n.size // 2000)] = np.nan
        supply, exhaust = 0.5 * (soon > wanted + 1e-4), 0.5 * (soon < wanted - 1e-4)
        pressure = 1e5 + 2e7 * wanted
        columns = {"position": position, "duty_supply": supply, "duty_exhaust": exhaust, "pressure_a": pressure}
        piece = Log(t, columns, "day")
        spent.append(time.process_time() - begin)
        yield piece


def peak() -> float:
    """Highest memory of the process so far in MB."""
    unit = 1e6 if sys.platform == "darwin" else 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def main() -> None:
    """Cut the day, alone and with the choice of the best strokes behind it."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--hours", type=float, default=24.0)
    options.add_argument("--piece", type=int, default=1_000_000, help="samples in a piece")
    options.add_argument("--choose", type=float, default=60.0, help="seconds of recording to choose, 0 for none")
    chosen = options.parse_args()
    seconds = chosen.hours * 3600
    print(f"{seconds * RATE:,.0f} samples in pieces of {chosen.piece:,}; {peak():.0f} MB before")

    made: list[float] = []
    begin = time.process_time()
    strokes = Counter(section.kind for section in sections_of(pieces(seconds, chosen.piece, made)))
    alone = time.process_time() - begin - sum(made)
    speed = seconds * RATE / alone / 1e6
    print(f"cut:            {alone:6.1f} s of one core, {speed:.2f} million samples/s, peak {peak():.0f} MB")
    print("                " + ", ".join(f"{count} {kind}" for kind, count in strokes.most_common()))
    if chosen.choose > 0:
        made.clear()
        begin = time.process_time()
        best = choose(sections_of(pieces(seconds, chosen.piece, made)), chosen.choose)
        both = time.process_time() - begin - sum(made)
        print(f"cut and choose: {both:6.1f} s of one core, peak {peak():.0f} MB, {len(joined(best)):,} samples chosen")


if __name__ == "__main__":
    main()
