"""The band of a pressure behind on/off valves: what was missed elsewhere, by the time since a valve was switched."""

from __future__ import annotations

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.inference.uncertainty.switching_band import quantile, switching_band
from clutchid.log import Log
from fixtures.changed_logs import spoiled


def pulses(n: int, seconds: float = 0.4, name: str = "run") -> Log:
    """`n` pulses of 0.1 s at 1 kHz, one every `seconds`, at a constant pressure."""
    t = np.arange(round(n * seconds * 1000)) * 1e-3
    on = ((t + 0.2) % seconds < 0.1 - 1e-9).astype(float)
    return Log(t, {"duty_supply": on, "duty_exhaust": 1.0 - on, "pressure_a": np.full(t.size, 2e5)}, name)


def disturbed(log: Log, seed: int) -> Log:
    """`log` with an error of 10 kPa for 5 ms after the valve was switched, and 1 kPa otherwise."""
    on = log["duty_supply"] > 0.5
    edge = np.flatnonzero(np.diff(on.astype(int))) + 1
    near = np.zeros(len(log), dtype=bool)
    for start in edge:
        near[start : start + 6] = True
    error = np.random.default_rng(seed).standard_normal(len(log)) * np.where(near, 1e4, 1e3)
    return log.with_columns(pressure_a=log["pressure_a"] + error)


def test_the_band_holds_its_share_of_another_recording_at_every_time_after_switching():
    pulsed, other = pulses(100), pulses(100)
    banded = switching_band(other, [(disturbed(pulsed, 1), pulsed)])
    measured = disturbed(other, 2)["pressure_a"]
    inside = (measured >= banded["pressure_a low"]) & (measured <= banded["pressure_a high"])
    # 40,000 independent samples, and a quantile from as many: 4 standard deviations of both
    assert abs(inside.mean() - 0.95) < 4 * np.sqrt(2 * 0.95 * 0.05 / len(other))
    half = banded["pressure_a high"] - other["pressure_a"]
    edge = int(np.flatnonzero(np.diff(other["duty_supply"]) > 0)[3]) + 1
    # 1.96 standard deviations; a group of 600 knows its 95 % quantile to 6 %
    assert abs(half[edge] / 1.96e4 - 1) < 0.25
    assert abs(half[edge + 30] / 1.96e3 - 1) < 0.25


def test_the_width_is_that_of_the_next_error_of_its_kind():
    assert quantile(np.arange(1.0, 20.0), 0.95) == 19.0
    assert quantile(np.arange(1.0, 10.0), 0.95) == 9.0
    assert quantile(np.arange(1.0, 1001.0), 0.95) == 951.0


def test_a_group_without_samples_is_as_uncertain_as_the_worst():
    pulsed = pulses(3, seconds=0.18)  # begins switched on, and is switched again before a tenth of a second is over
    measured = pulsed.with_columns(pressure_a=pulsed["pressure_a"] + 500.0)
    worse = spoiled(measured, "pressure_a", 50, measured["pressure_a"][50] + 7e3)
    banded = switching_band(pulses(1, seconds=1.0), [(worse, pulsed)])
    half = banded["pressure_a high"] - banded["pressure_a"]
    assert half[0] == pytest.approx(7500.0, rel=1e-12)


def test_missing_samples_of_the_known_pressure_do_not_count():
    pulsed = pulses(3)
    holes = np.where(np.arange(len(pulsed)) % 2 == 0, np.nan, pulsed["pressure_a"] + 200.0)
    banded = switching_band(pulsed, [(pulsed.with_columns(pressure_a=holes), pulsed)])
    assert np.allclose(banded["pressure_a high"] - banded["pressure_a"], 200.0, rtol=1e-12)


def test_times_at_the_border_of_a_group_fall_on_one_side_whatever_their_last_bit():
    early, late = pulses(4), pulses(4)
    shifted = Log(late.time + 1e6 / 3, dict(late.columns), late.name)  # the same strokes, later in the day
    measured = disturbed(early, 3)
    early_band, shifted_band = (switching_band(log, [(measured, early)]) for log in (early, shifted))
    assert np.allclose(early_band["pressure_a high"], shifted_band["pressure_a high"], rtol=0, atol=0)


def test_valves_that_are_not_on_or_off_are_refused():
    log = pulses(3)
    half = log.with_columns(duty_exhaust=np.full(len(log), 0.5))
    with pytest.raises(DataError, match=r"run: duty_exhaust is neither 0 nor 1 in 100 %.*on/off valves"):
        switching_band(half, [(log, log)])


def test_without_a_measured_pressure_there_is_no_band():
    log = pulses(3)
    blind = log.without("pressure_a")
    for pairs in ([], [(blind, log)]):
        with pytest.raises(DataError, match="no recording with a measured pressure"):
            switching_band(log, pairs)
