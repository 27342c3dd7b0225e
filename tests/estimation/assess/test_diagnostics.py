"""Residuals: fit in %, colour, and correlation with inputs, against cases that are known by hand."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.estimation.assess.diagnostics import diagnose, fit_percent, remarks
from clutchid.log import Log
from clutchid.numerics.whiteness import LAGS, block_means, colour, effective_samples

TWO_WAYS = np.array([1.0, -1.0] * 200)


def bursts(generator: np.random.Generator, n: int) -> np.ndarray:
    """A duty cycle as a controller makes it: mostly shut, now and then open for some tens of ms, held for 10 ms."""
    level = np.where(generator.random(n // 10 + 1) < 0.05, generator.uniform(0.1, 1.0, n // 10 + 1), 0.0)
    opened = np.repeat(np.convolve(level, np.ones(3))[: n // 10 + 1], 10)[:n]
    return np.minimum(opened, 1.0)


def recorded(residual: np.ndarray, step: float = 1e-3, **inputs: np.ndarray) -> tuple[Log, Log]:
    """A recording and its simulation that differ by `residual`; the position goes up and down over 20 mm."""
    t = np.arange(residual.size) * step
    simulated = 0.01 * (1 - np.cos(2 * np.pi * t / 5.0))
    return Log(t, {"position": simulated + residual, **inputs}), Log(t, {"position": simulated, **inputs})


def test_the_fit_in_percent_is_that_of_compare_without_missing_samples():
    y, simulated = np.array([0.0, np.nan, 2.0, 4.0, 7.0]), np.array([0.0, 5.0, 2.0, 3.0, np.nan])
    assert fit_percent(y, simulated) == pytest.approx(100 * (1 - 1 / np.sqrt(8)), rel=1e-14)
    y = np.array([0.0, 2.0, 4.0])
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.full(3, 2.0)) == 0.0


def test_a_constant_has_no_fit_in_percent():
    assert np.isnan(fit_percent(np.ones(5), np.zeros(5)))
    assert np.isnan(fit_percent(np.full(5, np.nan), np.zeros(5)))


def test_the_autocorrelation_of_a_residual_that_goes_to_and_fro_is_to_and_fro():
    colours = colour(TWO_WAYS, {}, 1e-3)
    np.testing.assert_allclose(colours.autocorrelation, (-1.0) ** np.arange(LAGS + 1), atol=1e-12)
    assert colours.share_outside == 1.0
    assert colours.bound[1] == pytest.approx(2.5758 / np.sqrt(399))


def test_a_missing_residual_takes_its_pairs_with_it_and_nothing_else():
    residual = TWO_WAYS.copy()
    residual[[17, 60, 101, 200]] = np.nan  # two of each sign, so that the mean stays
    colours = colour(residual, {}, 1e-3)
    np.testing.assert_allclose(colours.autocorrelation, (-1.0) ** np.arange(LAGS + 1), atol=1e-12)
    assert colours.bound[1] == pytest.approx(2.5758 / np.sqrt(399 - 8))


def test_a_hole_in_time_makes_no_pairs():
    measured, simulated = recorded(1e-4 * np.concatenate([TWO_WAYS, TWO_WAYS[::-1]]))
    time = measured.time + np.where(np.arange(len(measured)) >= TWO_WAYS.size, 100.0, 0.0)
    logs = [Log(time, log.columns) for log in (measured, simulated)]
    fast = diagnose(*logs).columns["position"].fast
    np.testing.assert_allclose(fast.autocorrelation, (-1.0) ** np.arange(LAGS + 1), atol=1e-9)


def test_white_noise_leaves_the_bounds_at_one_lag_in_a_hundred():
    generator = np.random.default_rng(1)
    shares = [colour(generator.standard_normal(2000), {}, 1e-3).share_outside for _ in range(200)]
    # 5000 lags, 50 expected, standard deviation 7
    assert np.mean(shares) == pytest.approx(0.01, abs=0.0042)


@pytest.mark.parametrize("busy", [False, True], ids=["steady noise", "noise only where the valve is open"])
def test_noise_that_an_input_has_no_part_in_leaves_the_bounds_at_one_lag_in_a_hundred(busy):
    generator = np.random.default_rng(2)
    shares = []
    for _ in range(100):
        duty = bursts(generator, 10_000)
        noise = np.convolve(generator.standard_normal(10_000), [1.0, 0.8, 0.5], mode="same")
        shares.append(colour(noise * (duty > 0) if busy else noise, {"duty": duty}, 1e-3).inputs["duty"].share_outside)
    # 5100 lags, but neighbours go together where the noise is coloured: up to twice the spread of white lags
    assert np.mean(shares) == pytest.approx(0.01, abs=0.0084)


@pytest.mark.parametrize("lag", [-12, 0, 7])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_an_input_that_leaks_into_the_residual_is_found_at_its_lag(lag, sign):
    generator = np.random.default_rng(3)
    duty = bursts(generator, 20_000)
    residual = 5e-5 * generator.standard_normal(20_000) + sign * 1e-4 * np.roll(duty, lag)
    other = bursts(generator, 20_000)
    diagnosis = diagnose(*recorded(residual, duty_supply=duty, duty_exhaust=other))
    supply, exhaust = (diagnosis.columns["position"].fast.inputs[name] for name in ("duty_supply", "duty_exhaust"))
    assert supply.strongest_lag == pytest.approx(lag * 1e-3)
    assert supply.strongest * sign > supply.strongest_bound
    assert exhaust.share_outside < 0.06
    expected = {
        -12: "precedes duty_supply by 12 ms",
        0: "correlates with duty_supply",
        7: "follows duty_supply after 7",
    }
    assert any(expected[lag] in sentence for sentence in remarks(diagnosis))
    assert not any("duty_exhaust" in sentence for sentence in remarks(diagnosis))


def test_a_position_at_half_the_rate_of_the_log_is_judged_at_its_own_rate():
    generator = np.random.default_rng(4)
    duty = bursts(generator, 40_000)
    residual = 2e-5 * generator.standard_normal(40_000) + 1e-4 * np.roll(duty, 8)
    residual[1::2] = np.nan
    fast = diagnose(*recorded(residual, duty_supply=duty)).columns["position"].fast
    assert fast.interval == pytest.approx(2e-3)
    assert fast.inputs["duty_supply"].strongest_lag == pytest.approx(8e-3)


def test_an_input_that_never_moves_has_no_correlation():
    residual = np.random.default_rng(5).standard_normal(1000)
    assert colour(residual, {"duty": np.full(1000, 0.3)}, 1e-3).inputs == {}


def test_slow_colour_below_fast_noise_is_seen_at_the_slow_rate():
    generator = np.random.default_rng(6)
    slow = np.convolve(generator.standard_normal(30_200), np.ones(200) / np.sqrt(200), mode="valid")[:30_000]
    position = diagnose(*recorded(5e-5 * generator.standard_normal(30_000) + 1e-5 * slow)).columns["position"]
    assert position.fast.first < 0.1  # 1 / (1 + 25) of the variance is slow
    assert position.slow.first > 0.3  # 20 samples averaged: 20 / (25 + 20) and a little less
    assert position.slow.interval == pytest.approx(0.02)


@pytest.mark.slow
@pytest.mark.parametrize("block", [1, 20])
@pytest.mark.parametrize("rho", [0.0, 0.9, 0.99])
def test_effective_samples_of_a_first_order_autoregression_follow_its_formula(rho, block):
    n = 400_000
    noise = np.random.default_rng(7).standard_normal(n)
    residual = np.empty(n)
    residual[0] = noise[0] / np.sqrt(1 - rho**2)
    for k in range(1, n):
        residual[k] = rho * residual[k - 1] + noise[k]
    # 1 % of the samples at rho = 0.99 are 2000 independent ones; the sum of their correlations is known to 8 %
    assert effective_samples(residual, block) == pytest.approx(n * (1 - rho) / (1 + rho), rel=0.2)


def test_effective_samples_are_at_least_one_and_at_most_all():
    assert effective_samples(TWO_WAYS, 1) == TWO_WAYS.size
    assert effective_samples(np.linspace(-1.0, 1.0, 1000), 1) >= 1.0
    assert np.isnan(effective_samples(np.full(100, np.nan), 1))


def test_means_of_blocks_are_those_of_what_is_there():
    means = block_means(np.array([1.0, 3.0, np.nan, 5.0, np.nan, np.nan, 7.0]), 2)
    np.testing.assert_array_equal(means, [2.0, 5.0, np.nan])


def test_pressure_is_judged_where_it_is_measured_and_only_there():
    measured, simulated = recorded(1e-5 * np.random.default_rng(9).standard_normal(2000))
    with_pressure = simulated.with_columns(pressure_a=np.linspace(1e5, 5e5, 2000))
    assert set(diagnose(measured, with_pressure).columns) == {"position"}
    recorded_pressure = np.linspace(1e5, 5e5, 2000) + 2e3
    recorded_pressure[5] = np.nan
    pressure = diagnose(measured.with_columns(pressure_a=recorded_pressure), with_pressure).columns["pressure_a"]
    assert (pressure.samples, pressure.mean, pressure.rms) == (1999, pytest.approx(2e3), pytest.approx(2e3))


def test_noise_gives_no_cause_for_a_remark():
    generator = np.random.default_rng(10)
    residual = 5e-5 * generator.standard_normal(20_000)
    assert remarks(diagnose(*recorded(residual, duty_supply=bursts(generator, 20_000)))) == []


def test_colour_is_reported_with_the_number_of_independent_samples():
    generator = np.random.default_rng(11)
    measured, simulated = recorded(2e-5 * generator.standard_normal(20_000))
    y = simulated["position"]
    wrong = measured.with_columns(position=measured["position"] + 3e-4 * ((y > 8.5e-3) & (y < 11.5e-3)))
    text = " ".join(remarks(diagnose(wrong, simulated)))
    assert "is coloured: 100 % of the lags" in text
    assert "its 20000 samples are equivalent to " in text


def test_autocorrelation_that_costs_no_samples_is_reported_without_their_number():
    measured, simulated = recorded(1e-4 * (-1.0) ** np.arange(20_000))
    (sentence,) = (s for s in remarks(diagnose(measured, simulated)) if "is coloured" in s)
    assert "equivalent" not in sentence


def test_other_times_and_nothing_to_compare_are_refused():
    measured, simulated = recorded(np.zeros(100))
    with pytest.raises(DataError, match=r"times differ \(100 and 50 samples\)"):
        diagnose(measured, simulated.slice(0, 50))
    with pytest.raises(DataError, match="no sample has both"):
        diagnose(measured, simulated.with_columns(position=np.full(100, np.nan)))


def test_a_short_recording_has_errors_but_no_colour():
    position = diagnose(*recorded(np.full(20, 1e-4))).columns["position"]
    assert position.rms == pytest.approx(1e-4)
    assert np.isnan(position.fast.first)
    assert remarks(diagnose(*recorded(np.full(20, 1e-4)))) == []
