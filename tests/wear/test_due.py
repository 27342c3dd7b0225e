"""What recordings say of wear and use, what types share, and when clutches are due: against filters and draws."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation.assess.comparison import SHARES_BY, Measurement
from clutchid.wear.due import forecast, reached_by, reached_within, replacements
from clutchid.wear.evidence import USE_NODES, WEAR_NODES, WIDE_RATE, LifeEvidence, evidence_from
from clutchid.wear.history import RecordingJob, WearReading
from clutchid.wear.life import LifeLimits, wear_of
from clutchid.wear.pooling import POOLED, TypePool, TypeSpread, pooled
from clutchid.wear.trend import GROWTH, LIFE, NEW, REFERENCE, WearTable

USUAL, STD = GROWTH["shift"].rate, 30e-6


def vehicle(strokes, shifts, days=None, km=None, limit=0.3e-3, temperatures=None):
    """The wear of a vehicle from shifts in m at strokes, on days and at km."""
    from datetime import UTC, datetime, timedelta

    count = len(strokes)
    days = np.arange(count) * 30.0 if days is None else days
    km = np.full(count, np.nan) if km is None else km
    warm = np.full(count, REFERENCE) if temperatures is None else temperatures
    begin = datetime(2024, 1, 1, tzinfo=UTC)
    jobs = [
        RecordingJob(f"r{k:03d}", "V", "T", begin + timedelta(days=float(days[k])), float(km[k]), float(strokes[k]))
        for k in range(count)
    ]
    readings = [
        WearReading("ok", "", "good", Measurement(shift, STD, 0.0, 0.02, air))
        for shift, air in zip(shifts, warm, strict=True)
    ]
    return wear_of("V", jobs, readings, LifeLimits(limit))


def fleet_of(wears):
    """The evidence of vehicles, as a table keeps it."""
    return evidence_from([wear.evidence.packed for wear in wears])


def filtered(strokes, shifts, temperatures, node, replaced=()):
    """Textbook filter of (u, r, b, g) in usual wear and lives: mean and covariance at the end, and log-likelihood."""
    shares, s = SHARES_BY["estimate"]["shift"], np.asarray(strokes) / LIFE["strokes"]
    std = STD / USUAL
    shared = np.sqrt(node.shared) * std * np.array([shares.common, shares.by_temperature])
    mean = np.zeros(4)
    P = np.diag([GROWTH["shift"].start / USUAL, WIDE_RATE, *shared]) ** 2
    log = 0.0
    for k, (at, shift, air) in enumerate(zip(s, shifts, temperatures, strict=True)):
        ds = at - s[k - 1] if k else 0.0
        if k in replaced:  # u starts anew in the middle, and the rate goes on
            mean, P = moved(mean, P, ds / 2, node)
            spread = replaced[k] * ds * LIFE["strokes"] / USUAL
            new = (NEW * GROWTH["shift"].start / USUAL) ** 2 + spread**2 / 12
            mean[0], P[0], P[:, 0] = 0.0, 0.0, 0.0
            P[0, 0], ds = new, ds / 2
        mean, P = moved(mean, P, ds, node)
        H = np.array([1.0, 0.0, 1.0, (air - REFERENCE) / 10.0])
        S = H @ P @ H + node.noise * (shares.independent * std) ** 2
        e = shift / USUAL - H @ mean
        log -= 0.5 * (e**2 / S + np.log(S))
        gain = P @ H / S
        mean, P = mean + gain * e, P - np.outer(gain, H @ P)
    return mean[:2], P[:2, :2], log


def moved(mean, P, ds, node):
    """The state after ds."""
    F = np.eye(4)
    F[0, 1] = ds
    Q = np.zeros((4, 4))
    q = node.walk**2
    Q[:2, :2] = [[q * ds**3 / 3 + node.scatter**2 * ds, q * ds**2 / 2], [q * ds**2 / 2, q * ds]]
    return F @ mean, F @ P @ F.T + Q


def steady(random, rate, count=20, step=4e4):
    """Strokes, shifts and temperatures of a vehicle that wears at a rate in m a stroke."""
    strokes = step * np.arange(count)
    return strokes, rate * strokes + 3e-6 * random.standard_normal(count), 290 + 8 * random.standard_normal(count)


def test_all_recordings_at_once_say_what_a_filter_says_that_takes_one_after_the_other():
    strokes, shifts, air = steady(np.random.default_rng(1), 2e-10)
    wear = vehicle(strokes, shifts, temperatures=air).evidence.wear
    logs = []
    for row, node in zip(wear, WEAR_NODES, strict=True):
        mean, P, log = filtered(strokes, shifts, air, node)
        np.testing.assert_allclose(row[1:3], mean, rtol=0.02, atol=1e-3)  # a wide rate at the start, or at the end
        np.testing.assert_allclose(row[3:], [P[0, 0], P[1, 1], P[0, 1]], rtol=0.03)
        logs.append(row[0] - log)
    assert np.ptp(logs) < 0.05


def test_the_rate_goes_on_where_a_clutch_is_replaced():
    random = np.random.default_rng(2)
    strokes, shifts, air = steady(random, 5e-10, count=24)
    shifts[12:] -= 5e-10 * (strokes[12] - 2e4)
    wear = vehicle(strokes, shifts, temperatures=air)
    assert [alarm.kind for alarm in wear.alarms] == ["replaced"]
    rate = wear.rate["shift"].value[12]
    for row, node in zip(wear.evidence.wear, WEAR_NODES, strict=True):
        mean, P, _ = filtered(strokes, shifts, air, node, {12: rate})
        np.testing.assert_allclose(row[1:3], mean, rtol=0.03, atol=2e-3)
        np.testing.assert_allclose(row[3:5], np.diag(P), rtol=0.05)


def test_the_error_of_a_calibration_is_what_it_moves_the_wear_by():
    wear = np.linspace(0.0, 4e-3, 5)
    table, strokes = WearTable(wear, 0.05 * wear, 12.0 * wear), 4e4 * np.arange(20)

    def state(moved=(0.0, 0.0)):
        shares, stds = SHARES_BY["estimate"], (STD, 0.02)
        own = 3e-9 * strokes
        shifts, loads = (
            scale * own + by * shares[name].common * std
            for scale, by, name, std in zip((0.05, 12.0), moved, ("shift", "load"), stds, strict=True)
        )
        jobs = [RecordingJob(f"r{k:03d}", "V", "T", None, float("nan"), s) for k, s in enumerate(strokes)]
        readings = [
            WearReading("ok", "", "good", Measurement(*values, 0.02, REFERENCE))
            for values in zip(shifts, [STD] * 20, loads, strict=True)
        ]
        return wear_of("V", jobs, readings, LifeLimits(table=table)).evidence

    evidence = state()
    best = int(np.argmax(evidence.wear[:, 0]))
    moves = [state(moved).wear[best, 1] - evidence.wear[best, 1] for moved in ((1.0, 0.0), (0.0, 1.0))]
    assert float(evidence.constant) == pytest.approx(np.hypot(*moves), rel=0.05)
    assert 1e3 * GROWTH["wear"].rate * float(evidence.constant) > 0.1  # mm: 12 um of shift, or 2 % of load


def test_a_type_teaches_the_spread_of_its_rates():
    random = np.random.default_rng(3)
    rates = 3e-10 * np.exp(0.25 * random.standard_normal(60))
    pool = pooled(fleet_of([vehicle(*steady(random, rate)[:2]) for rate in rates]))
    best = pool.rate.best
    true = np.log(rates * LIFE["strokes"] / USUAL)
    assert pool.rate.mean[best] == pytest.approx(true.mean(), abs=3 * 0.25 / np.sqrt(60))
    assert pool.rate.std[best] == pytest.approx(true.std(), rel=0.35)
    assert pool.rate.error[best] == pytest.approx(pool.rate.std[best] / np.sqrt(60), rel=0.3)
    assert WEAR_NODES[best].noise < 1.0  # the readings scatter by half of what they state


def test_a_vehicle_with_two_recordings_is_forecast_from_its_type():
    random = np.random.default_rng(4)
    old = [vehicle(*steady(random, 3e-10 * np.exp(0.2 * random.standard_normal()))[:2]) for _ in range(20)]
    young = vehicle(*steady(random, 3e-10, count=2)[:2])
    evidence = fleet_of([*old, young])
    with_type = LIFE["strokes"] * forecast(evidence, pooled(evidence)).left[-1]
    assert with_type[0] < 1e6 - 4e4 < with_type[2]
    assert with_type[2] / with_type[0] < 3.0
    assert young.left.high > 3 * with_type[2]


def test_fewer_vehicles_than_can_be_pooled_have_the_guess():
    random = np.random.default_rng(5)
    wears = [vehicle(*steady(random, 3e-10)[:2]) for _ in range(POOLED)]
    few, enough = pooled(fleet_of(wears[1:])), pooled(fleet_of(wears))
    assert few.is_guess
    assert not enough.is_guess
    assert few.rate.std[0] > enough.rate.std[enough.rate.best]


def one_node(n, spread, mean, guess=0):
    """A spread over vehicles of which only one node counts."""
    nodes = len(WEAR_NODES if guess == 0 else USE_NODES)
    return TypeSpread(np.eye(nodes)[n], np.full(nodes, mean), np.zeros(nodes), np.full(nodes, spread))


def test_the_probability_is_the_share_of_draws_beyond_the_limit():
    n = WEAR_NODES.index((1.0, 1.0, 0.2, 0.05))
    wear = np.zeros((1, len(WEAR_NODES), 6))
    wear[:, :, 1:] = 0.3, 0.45, 0.15**2, 0.3**2, -0.8 * 0.15 * 0.3
    use = np.full((1, 2, len(USE_NODES), 3), np.nan)
    evidence = LifeEvidence(wear, np.array([0.6]), np.array([0.01]), np.array([30.0]), use)
    pool = TypePool(10, one_node(n, 0.4, np.log(0.5)), (one_node(0, 1.0, 0.0, 1),) * 2)
    random, count = np.random.default_rng(6), 400_000
    rate = np.exp(np.log(0.5) + 0.4 * random.standard_normal(count))
    weight = np.exp(-((rate - 0.45) ** 2) / (2 * 0.3**2) + rate**2 / (2 * WIDE_RATE**2))
    slope = -0.8 * 0.15 / 0.3
    u = 0.3 + slope * (rate - 0.45) + 0.15 * 0.6 * random.standard_normal(count)
    for ahead in (0.3, 0.6, 1.2):
        noise = np.sqrt(0.2**2 * ahead**3 / 3 + 0.05**2 * ahead) * random.standard_normal(count)
        share = np.average(u + rate * ahead + noise >= 0.6, weights=weight)
        computed = reached_by(evidence, pool, np.array([0.0, ahead]))[0, 1]
        assert computed == pytest.approx(share, abs=0.015)  # as of a normal logarithm of the rate


def test_days_and_km_follow_from_the_use_of_a_vehicle_and_are_unknown_without_one():
    random = np.random.default_rng(7)
    days, rate = 30.0 * np.arange(20), 3e-10
    strokes, shifts, _ = steady(random, rate)
    wears = [vehicle(strokes, shifts + 3e-6 * random.standard_normal(20), days, 0.4 * strokes) for _ in range(6)]
    evidence = fleet_of(wears)
    table = forecast(evidence, pooled(evidence))
    strokes_left = LIFE["strokes"] * table.left[:, 1]
    np.testing.assert_allclose(table.left_days[:, 1], strokes_left / (4e4 / 30.0), rtol=0.1)
    np.testing.assert_allclose(table.left_km[:, 1], strokes_left * 0.4, rtol=0.1)
    assert np.all(
        table.left_km[:, 2] - table.left_km[:, 0] > 0.4 * LIFE["strokes"] * np.ptp(table.left[:, ::2], axis=1)
    )
    without = fleet_of([vehicle(strokes, shifts, days) for _ in range(2)])
    assert np.isnan(forecast(without, pooled(without)).left_km).all()
    assert np.isfinite(forecast(without, pooled(without)).left_days[:, 1]).all()


def test_a_probability_rises_with_the_horizon_and_is_that_of_the_quantile():
    random = np.random.default_rng(8)
    wears = [vehicle(*steady(random, rate)[:2]) for rate in 3e-10 * np.exp(0.2 * random.standard_normal(12))]
    evidence = fleet_of(wears)
    pool = pooled(evidence)
    table = forecast(evidence, pool)
    assert np.all(np.diff(table.by_month, axis=1) >= 0.0)
    assert np.all(np.diff(table.within_days, axis=1) >= 0.0)
    np.testing.assert_allclose(
        reached_within(evidence, pool, 0, table.left_days[:, 1]), 0.5, atol=0.03
    )  # between nodes


def test_replacements_are_counted_with_their_common_error():
    by_month = np.cumsum(np.full((400, 3), 0.02), axis=1)
    alone, shared = (replacements(by_month, np.cumsum(np.full((400, 3), c), axis=1)) for c in (0.0, 0.01))
    np.testing.assert_allclose(alone.expected, 8.0)
    np.testing.assert_allclose((alone.high - alone.low) / 3.92, np.sqrt(400 * 0.02 * 0.98), rtol=0.05)
    np.testing.assert_allclose((shared.high - shared.low) / 3.92, np.sqrt(400 * 0.02 * 0.98 + 4.0**2), rtol=0.1)
    unknown = replacements(np.vstack([by_month, np.full((1, 3), np.nan)]), np.zeros((401, 3)))
    np.testing.assert_array_equal(unknown.expected, alone.expected)


def test_evidence_is_kept_as_text_without_loss_that_matters():
    random = np.random.default_rng(9)
    wear = vehicle(*steady(random, 3e-10)[:2])
    table = fleet_of([wear, wear])
    for part, own in zip(table, wear.evidence, strict=True):
        np.testing.assert_allclose(part[1], own, rtol=1e-6)


def test_a_limit_within_the_error_of_the_calibration_has_no_forecast():
    random = np.random.default_rng(10)
    wear = vehicle(*steady(random, 1e-11)[:2], limit=10e-6)
    assert wear.left is None
    assert wear.evidence is None
    assert "within the error" in wear.warnings[-1]
    assert replace(wear, limit=None).present["shift"].value < 20e-6


def test_a_vehicle_with_one_recording_or_an_odometer_that_goes_back_is_forecast_with_the_others():
    random = np.random.default_rng(11)
    strokes, shifts, _ = steady(random, 3e-10)
    km = 0.4 * strokes
    back = km.copy()
    back[10:] -= km[8]
    wears = [vehicle(strokes, shifts, km=own) for own in (km, km, km, km, back)]
    evidence = fleet_of([*wears, vehicle(strokes[:1], shifts[:1], km=km[:1])])
    table = forecast(evidence, pooled(evidence))
    assert table.left_km[4, 1] == pytest.approx(table.left_km[0, 1], rel=0.1)
    assert table.left_km[5, 0] < 0.4e6 < table.left_km[5, 2]


def test_an_outlier_before_a_replaced_clutch_leaves_a_forecast():
    random = np.random.default_rng(13)
    strokes, shifts, _ = steady(random, 3e-10)
    shifts[0] += 2e-3
    wear = vehicle(strokes, shifts)
    assert wear.outcomes[0] != "missing"
    assert np.isfinite(wear.evidence.wear).all()
    assert wear.left.low < 1e6 - strokes[-1] < wear.left.high


def test_a_fleet_of_new_clutches_has_no_end_in_sight_and_no_probability():
    random = np.random.default_rng(12)
    evidence = fleet_of([vehicle(*steady(random, 1e-13)[:2]) for _ in range(6)])
    table = forecast(evidence, pooled(evidence))
    assert np.isinf(table.left[:, 2]).all()
    assert np.all(table.within_days < 1e-3)
