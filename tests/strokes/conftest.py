"""Recordings of a made-up actuator, whose strokes are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from clutchid.log import Log

#: Reach of the made-up actuator in m.
REACH = 0.022


def make(
    corners: list[tuple[float, float]],
    *,
    seconds: float | None = None,
    rate: float = 1000.0,
    zero: float = 0.0,
    noise: float = 2e-5,
    quantum: float = 1.2e-5,
    seed: int = 0,
    inputs: bool = True,
    pressure: bool = False,
) -> Log:
    """A recording that goes straight from corner to corner (s, m above the rest); valves open while it moves."""
    rng = np.random.default_rng(seed)
    times, levels = (np.array(x) for x in zip(*corners, strict=True))
    end = times[-1] if seconds is None else seconds
    t = np.arange(round(end * rate)) / rate
    true = np.interp(t, times, levels)
    y = true + zero + noise * rng.standard_normal(t.size)
    columns = {"position": quantum * np.round(y / quantum) if quantum else y}
    if inputs:
        slope = np.gradient(np.interp(t, times, levels), t)
        columns |= {"duty_supply": 0.4 * (slope > 1e-6), "duty_exhaust": 0.6 * (slope < -1e-6)}
    if pressure:
        columns["pressure_a"] = 1e5 + 1e3 * rng.standard_normal(t.size) + 2e7 * true + 2e5 * (true > 1e-4)
    return Log(t, columns, "made")


def full_stroke(at: float, peak: float = REACH) -> list[tuple[float, float]]:
    """Corners of a stroke that leaves at `at` s, opens in 0.15 s, and is back 1.2 s later."""
    return [(at, 0.0), (at + 0.15, peak), (at + 0.9, peak), (at + 1.2, 0.0)]


def strokes_at(starts: list[float], end: float, peak: float = REACH) -> list[tuple[float, float]]:
    """Corners of full strokes, with rests between them."""
    return [(0.0, 0.0), *(corner for at in starts for corner in full_stroke(at, peak)), (end, 0.0)]


@pytest.fixture(scope="session")
def made() -> Callable[..., Log]:
    """Make a recording from corners of the position."""
    return make


@pytest.fixture(scope="session")
def full_strokes() -> Callable[..., list[tuple[float, float]]]:
    """Corners of full strokes: full_strokes([1.0, 4.0], 8.0) leave at 1 and 4 s of a recording of 8 s."""
    return strokes_at


@pytest.fixture(scope="session")
def minutes() -> Log:
    """Three blocks and more: strokes, shifts, ramps, staircases, drop-outs of the position, a zero off by 2 mm."""
    corners = [(0.0, 0.0)]
    rng = np.random.default_rng(5)
    at = 2.0
    while at < 215.0:
        kind = rng.integers(4)
        if kind == 0:
            corners += full_stroke(at)
        elif kind == 1:
            shift = {0.0: 0.0, 0.15: REACH, 0.8: REACH, 0.95: 8e-3, 1.6: 3e-3, 1.8: 0.0}
            corners += [(at + passed, y) for passed, y in shift.items()]
        elif kind == 2:
            corners += [(at, 0.0), (at + 3.0, REACH), (at + 3.2, REACH), (at + 6.0, 0.0)]
        else:
            levels = np.repeat(rng.permutation(np.linspace(0.2, 1.0, 6)) * REACH, 2)
            times = at + np.array([[0.1 + k * 0.6, 0.6 + k * 0.6] for k in range(6)]).ravel()
            corners += [(at, 0.0), *zip(times.tolist(), levels.tolist(), strict=True), (at + 4.0, 0.0)]
        at = corners[-1][0] + rng.uniform(0.3, 8.0)
    log = make([*corners, (at, 0.0)], zero=2e-3, pressure=True)
    position = log["position"].copy()
    for start in rng.integers(0, len(log), 40):
        position[start : start + rng.integers(5, 60)] = np.nan
    return log.with_columns(position=position)
