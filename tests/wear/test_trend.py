"""The trend of wear: a Kalman filter and smoother with a test for jumps."""

import numpy as np
import pytest

from clutchid.estimation.assess.comparison import SHARES, SHARES_BY, Measurement
from clutchid.wear.trend import (
    CHANGE_OUTCOMES,
    FALSE_ALARMS,
    GROWTH,
    LIFE,
    REFERENCE,
    LaterCalibration,
    WearTable,
    smoothed_states,
    traced,
    trend_model,
)

STRIDE, STD = 7000.0, (0.03e-3, 0.012)
MODEL = trend_model(LIFE["strokes"])


def clutch(random, count, temperature=False):
    """True shift and load of a clutch drawn from the trend's own prior, and its measurements."""
    F, _, noise = motion()
    x = np.zeros(MODEL.size)
    x[: MODEL.errors] = random.standard_normal(MODEL.errors) * [
        value for name in MODEL.quantities for value in (GROWTH[name].start, GROWTH[name].rate / MODEL.life)
    ]
    x[MODEL.errors : MODEL.changes] = random.standard_normal(4) * [
        part * std for name, std in zip(("shift", "load"), STD, strict=True)
        for part in (SHARES[name].common, SHARES[name].by_temperature)
    ]  # fmt: skip
    true, measured = [], []
    for k in range(count):
        x = x if k == 0 else F @ x + noise @ random.standard_normal(MODEL.size)
        T = REFERENCE + 15.0 * np.sin(k / 8.0) if temperature else np.nan
        warmer = (T - REFERENCE) / 10.0 if temperature else 0.0
        own = random.standard_normal(2) * [
            SHARES[n].independent * s for n, s in zip(("shift", "load"), STD, strict=True)
        ]
        shift, load = x[0] + x[4] + warmer * x[5] + own[0], x[2] + x[6] + warmer * x[7] + own[1]
        true.append(x.copy())
        measured.append(Measurement(shift, STD[0], load, STD[1], T))
    return np.array(true), measured


def steps_of(s, measured, model=MODEL):
    """Steps of the most probable path."""
    return traced(model, s, measured)[0].steps


def motion():
    step = steps_of(np.array([0.0, STRIDE]), [None, None])
    F = step[1].transition
    Q = step[1].predicted_covariance - F @ step[0].covariance @ F.T
    return F, Q, np.linalg.cholesky(Q + 1e-30 * np.eye(MODEL.size))


def test_the_trend_of_its_own_clutches_is_covered_and_smoothing_sharpens_it():
    random, inside, errors = np.random.default_rng(1), [], []
    for _ in range(120):
        true, measured = clutch(random, 30, temperature=True)
        steps = steps_of(STRIDE * np.arange(30), measured)
        later = smoothed_states(steps)
        for k in (9, 29):
            std = np.sqrt(np.diag(steps[k].covariance))
            inside.append(np.abs(steps[k].mean - true[k]) <= 1.96 * std)
        errors.append([abs(steps[5].mean[0] - true[5][0]), abs(later[5][0][0] - true[5][0])])
        assert np.all(np.diag(later[5][1]) <= np.diag(steps[5].covariance) * (1 + 1e-9))
    share = np.mean(inside, axis=0)  # 240 each, in pairs: 0.95 +- 0.02
    assert np.all(share > 0.88)
    assert np.mean(share) == pytest.approx(0.95, abs=0.025)
    assert np.mean(errors, axis=0)[1] < np.mean(errors, axis=0)[0]


def test_filter_and_smoother_are_batch_least_squares():
    _, measured = clutch(np.random.default_rng(2), 6)
    s = STRIDE * np.arange(6)
    steps = steps_of(s, measured)
    assert {step.outcome for step in steps} == {"used"}
    # dense: all states at once, with the noise scale that each measurement was given
    F, Q, _ = motion()
    n, rows, right = MODEL.size, [], []
    start = steps_of(s[:1], [None])[0]
    prior = steps_of(s[:1], [measured[0]])[0].predicted_covariance

    def put(blocks, value, covariance):
        whitened = np.linalg.inv(np.linalg.cholesky(covariance))
        row = np.zeros((len(value), 6 * n))
        for k, block in blocks:
            row[:, k * n : (k + 1) * n] = block
        rows.append(whitened @ row)
        right.append(whitened @ value)

    assert np.array_equal(start.mean, np.zeros(n))
    put([(0, np.eye(n))], np.zeros(n), prior)
    tiny = np.diag([0.0, 0.0, 0.0, 0.0, 1e-22, 1e-22, 1e-18, 1e-18, 1e-22, 1e-18])
    H = np.zeros((2, n))
    H[0, [0, 4, 8]], H[1, [2, 6, 9]] = 1.0, 1.0
    scale, number, total = 1.0, 0, 0.0
    for k, reading in enumerate(measured):
        if k:
            put([(k - 1, -F), (k, np.eye(n))], np.zeros(n), Q + tiny)
        stds = [SHARES["shift"].independent * reading.shift_std, SHARES["load"].independent * reading.load_std]
        put([(k, H)], np.array([reading.shift, reading.load]), scale * np.diag(np.square(stds)))
        total, number = total + steps[k].deviance, number + 2
        scale = (10.0 + total) / (10.0 + number)
    solution = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0].reshape(6, n)
    values = np.array([mean for mean, _ in smoothed_states(steps)])
    std = np.sqrt(np.diag(prior))
    assert values / std == pytest.approx(solution / std, abs=1e-5)


def test_what_reads_the_recordings_has_errors_of_its_own():
    """An error that all observed readings share does not move the trend where the estimated ones are many."""
    model = trend_model(LIFE["strokes"], readers=("estimate", "observe"))
    assert model.size == MODEL.size + 4
    s, off = STRIDE * np.arange(40), 0.4 * STD[0]
    read = [Measurement(off * (k % 2), STD[0], 0.0, STD[1], np.nan, ("estimate", "observe")[k % 2]) for k in range(40)]
    steps = steps_of(s, read, model)
    assert {step.outcome for step in steps} == {"used"}
    constant, _ = model.errors_by("observe")
    state, alike = steps[-1].mean, steps_of(s, [now._replace(by="estimate") for now in read])[-1].mean
    difference = state[constant][0] - state[model.errors_by("estimate")[0]][0]
    assert difference == pytest.approx(off, rel=0.1)
    assert abs(state[0]) < abs(alike[0])


def test_a_trend_with_one_reader_does_not_depend_on_which_but_by_its_shares(monkeypatch):
    _, measured = clutch(np.random.default_rng(6), 12, temperature=True)
    monkeypatch.setitem(SHARES_BY, "observe", SHARES)
    s, observed = STRIDE * np.arange(12), [now._replace(by="observe") for now in measured]
    steps = steps_of(s, observed, trend_model(LIFE["strokes"], readers=("observe",)))
    assert all(np.array_equal(a.mean, b.mean) for a, b in zip(steps, steps_of(s, measured), strict=True))


def test_a_replaced_clutch_is_found_within_two_recordings():
    random, count = np.random.default_rng(3), 0
    for _ in range(60):
        _, measured = clutch(random, 20)
        jumped = [
            reading._replace(shift=reading.shift - 0.12e-3) if k >= 12 else reading
            for k, reading in enumerate(measured)
        ]
        steps = steps_of(STRIDE * np.arange(20), jumped)
        count += any(step.outcome in CHANGE_OUTCOMES for step in steps[12:14])
    assert count >= 57


def test_false_alarms_are_as_rare_as_chosen():
    random, alarms, outliers, count = np.random.default_rng(4), 0, 0, 0
    for _ in range(100):
        _, measured = clutch(random, 40, temperature=True)
        outcomes = [step.outcome for step in steps_of(STRIDE * np.arange(40), measured)]
        alarms, outliers, count = (
            alarms + sum(map(outcomes.count, CHANGE_OUTCOMES)),
            outliers + outcomes.count("left out"),
            count + 40,
        )
    assert alarms <= 4 * FALSE_ALARMS * count / 2  # 4 expected at most; two in a row are needed
    assert outliers <= 4 * FALSE_ALARMS * count


def test_a_single_odd_reading_is_left_out_and_does_not_move_the_trend():
    _, measured = clutch(np.random.default_rng(5), 20)
    odd = [reading._replace(shift=reading.shift + 0.5e-3) if k == 10 else reading for k, reading in enumerate(measured)]
    missing = [None if k == 10 else reading for k, reading in enumerate(measured)]
    s = STRIDE * np.arange(20)
    assert steps_of(s, odd)[10].outcome == "left out"
    assert steps_of(s, odd)[-1].mean == pytest.approx(steps_of(s, missing)[-1].mean)


def test_with_a_table_the_facing_is_the_quantity_and_its_end_is_extrapolated():
    wear = np.linspace(0.0, 3.5e-3, 36)
    table = WearTable(wear, 0.2e-3 * np.sin(wear / 3.5e-3), 0.08 * wear / 3.5e-3)
    model = trend_model(LIFE["strokes"], table)
    true = 2.0e-3 + 20e-6 * np.arange(30)
    shift, load = (np.interp(true, wear, values) for values in table[1:])
    measured = [Measurement(a, STD[0], b, STD[1], np.nan) for a, b in zip(shift, load, strict=True)]
    steps = steps_of(6000.0 * np.arange(30), measured, model)
    assert steps[-1].mean[0] == pytest.approx(true[-1], abs=0.2e-3)
    assert abs(steps[-1].mean[0] - true[-1]) < 1.96 * np.sqrt(steps[-1].covariance[0, 0])
    assert model.channels[1][1](np.array([7e-3])) == pytest.approx([0.16])


def test_a_later_calibration_is_an_offset_with_its_error_and_no_new_clutch():
    random, n, worn = np.random.default_rng(4), 20, 3e-4
    offset = LaterCalibration(worn, 5e-5, -0.02, 0.02)
    true = np.linspace(0.0, 6e-4, n)
    seen = true + 5e-6 * random.standard_normal(n)
    first = [Measurement(shift, 3e-5, -40.0 * shift, 0.01, 293.0) for shift in seen[: n // 2]]
    later = [Measurement(shift - worn - 4e-5, 3e-5, 0.0, 0.01, 293.0) for shift in seen[n // 2 :]]
    loads = -40.0 * true[n // 2 :]
    carried = [offset.since_first(now, 1)._replace(load=load) for now, load in zip(later, loads, strict=True)]
    carried = [*first, *carried]
    s = STRIDE * np.arange(n)
    path, *_ = traced(trend_model(LIFE["strokes"], None, ("estimate",), (offset,)), s, carried)
    assert {step.outcome for step in path.steps} == {"used"}
    mean, covariance = smoothed_states(path.steps)[-1]
    assert mean[0] == pytest.approx(true[-1], abs=2 * np.sqrt(covariance[0, 0]))
    alone, *_ = traced(trend_model(LIFE["strokes"]), s, [now._replace(calibration=0) for now in carried])
    assert covariance[0, 0] > smoothed_states(alone.steps)[-1][1][0, 0], "its error does not average out"
