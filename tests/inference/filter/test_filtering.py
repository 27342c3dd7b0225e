"""The filter over a recording: against a textbook filter, and its derivatives against differences."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from clutchid.inference.filter import filtering as module
from clutchid.inference.filter.filtering import filtered
from clutchid.log.states import STATES
from clutchid.model.variants import VARIANTS
from clutchid.numerics.failure import Failure
from clutchid.simulation.noise import Noise, process_noise, start_deviations
from clutchid.simulation.run import columns, run_with_sensitivities, start_state

pytestmark = pytest.mark.slow

BOTH = ("position", "pressure_a")
NAMES = ("theta_4", "theta_9", "C_vs", "P_S", "V_0A", "F_C", "T_w", "tau_y", "tau_p", "e_y", "e_p")
#: Nothing counts as an outlier.
ALL_IN = replace(Noise(), outlier=1e9)
SECONDS = 1.5


@pytest.fixture(scope="module")
def problem(plant, recorded_by, problem_of):
    return problem_of(recorded_by(plant, SECONDS), plant, NAMES)


@pytest.fixture
def uncompressed(monkeypatch):
    monkeypatch.setattr(module, "triangular", lambda rows: rows)


def followed(problem, x=None, noise=ALL_IN, fixed_gains=None, columns=BOTH, track=None):
    mapped = problem.parameter_map(np.zeros(len(NAMES)) if x is None else x, "log")
    return filtered(track or problem.tracks[0], mapped, columns, noise, fixed_gains)


def textbook(problem, actuator, length):
    """Errors with variances, and states, of an extended Kalman filter that multiplies covariances out.

    Each sensor is a state of first order behind those of the model, driven by a straight line between two samples.
    """
    track, p, states = problem.tracks[0], actuator.parameters, list(actuator.states)
    segment, n = track.segment, len(states)
    mapped = problem.parameter_map(np.zeros(len(NAMES)), "log")
    which = columns(actuator, [*mapped.bases, *(f"start of {name}" for name in states)])
    Q = np.vstack([np.zeros(n), process_noise(segment, actuator, ALL_IN)]) ** 2
    x, P = start_state(segment, actuator), np.diag(start_deviations(segment, actuator, True, ALL_IN) ** 2)
    shown = np.eye(n)[[0, 2]]
    shown[0, 1] = -p.tau_y  # the position has moved before the start as it does there
    both = np.vstack([np.eye(n), shown])
    z, P = both @ x, both @ P @ both.T
    errors, states_after = [], []
    for i in range(length):
        if i > 0:
            start, dt = one_interval(segment, i - 1), segment.dt[i - 1]
            S = np.column_stack([np.zeros((n, len(mapped.bases))), np.eye(n)])
            out, _, end, _ = run_with_sensitivities(start, mapped.arrays, (z[:n], S), which, (0,))
            F, G, new = np.zeros((n + 2, n + 2)), np.zeros((n + 2, n)), np.zeros(n + 2)
            F[:n, :n], G[:n], new[:n] = end[:, len(mapped.bases) :], np.eye(n), out[-1]
            for row, (at, tau) in enumerate(((0, p.tau_y), (2, p.tau_p)), n):
                decay, of_last, of_now = line_through_a_lag(tau, dt)
                F[row] = of_now * F[at]
                F[row, row], F[row, at] = decay, F[row, at] + of_last
                G[row, at] = of_now
                new[row] = decay * z[row] + of_last * z[at] + of_now * new[at]
            z, P = new, F @ P @ F.T + G @ np.diag(Q[i]) @ G.T
        row = np.empty((2, 2))
        for j, (name, offset) in enumerate(zip(BOTH, (p.e_y, p.e_p), strict=True)):
            s = P[n + j, n + j] + ALL_IN.measured[name] ** 2
            e = track.measured[name][segment.start + i] - (z[n + j] + offset)
            gain = P[:, n + j] / s
            z, P = z + gain * e, P - np.outer(gain, P[n + j])
            row[j] = e, s
        errors.append(row)
        states_after.append(z[:n])
    return np.array(errors), np.array(states_after)


def line_through_a_lag(tau, dt):
    """Shares of the last output, the last and the new input, by the exponential of the lag fed by a ramp."""
    generator = np.array([[-1.0 / tau, 1.0 / tau, 0.0], [0.0, 0.0, 1.0 / dt], [0.0, 0.0, 0.0]])
    moved = expm(generator * dt)[0]
    # the ramp starts at the last input and ends at the new one
    return moved[0], moved[1] - moved[2], moved[2]


def one_interval(segment, i):
    return replace(
        segment, start=i, stop=i + 2, inputs=np.ascontiguousarray(segment.inputs[i : i + 2]), dt=segment.dt[i : i + 1],
        substeps=segment.substeps[i : i + 1], jump=np.zeros(2, np.uint8), measured=np.zeros((2, 2)),
    )  # fmt: skip


@pytest.mark.parametrize(("length", "factors"), [(900, (1.0, 1.0)), (400, (0.5, 1.5))], ids=["even", "uneven"])
def test_the_filter_is_the_textbook_filter(problem, plant, length, factors):
    segment = problem.tracks[0].segment
    # in turn, so that the interval before a sample and the one after it are never alike
    dt = segment.dt * np.resize(factors, segment.dt.size)
    track = replace(problem.tracks[0], segment=replace(segment, dt=dt, substeps=2 * segment.substeps))
    errors, states = textbook(replace(problem, tracks=(track,)), plant, length)
    result = followed(problem, track=track)
    assert np.ptp(states[:, 2]) > 1e5, "the pressure must move, or its lag is not seen"
    # the textbook loses half the digits of a covariance whose states differ by 14 orders
    size = np.array([ALL_IN.measured[name] for name in BOTH])
    assert result.errors[:length, :, 0] / size == pytest.approx(errors[:, :, 0] / size, abs=1e-4)
    assert result.errors[:length, :, 1] == pytest.approx(errors[:, :, 1], rel=1e-4)
    assert result.states[:length] == pytest.approx(states, rel=1e-4, abs=1e-8)


def test_a_pass_with_the_gains_of_another_at_the_same_numbers_is_that_pass(problem):
    free = followed(problem)
    fixed = followed(problem, fixed_gains=free.gains)
    assert fixed.cost == pytest.approx(free.cost, rel=1e-9)
    assert np.abs(fixed.rows[:, :-1]) == pytest.approx(np.abs(free.rows[:, :-1]), abs=1e-6 * np.abs(free.rows).max())
    assert fixed.errors[:, :, 0] == pytest.approx(free.errors[:, :, 0], abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_rows_have_the_derivatives_that_differences_have_with_fixed_gains(problem, uncompressed, name):
    here = followed(problem)
    place, h = NAMES.index(name), 1e-4
    e = h * np.eye(len(NAMES))[place]
    up, down = (followed(problem, step, fixed_gains=here.gains).rows[:, -1] for step in (e, -e))
    differences = (up - down) / (2 * h)
    assert np.abs(differences).max() > 0.01, "the recording must tell this number, or nothing is tested"
    error = np.linalg.norm(here.rows[:, place] - differences)
    # the model has kinks: a sample in which one moves is off by the step
    assert error < 2e-3 * np.linalg.norm(differences)


def test_rows_and_cost_count_what_lies_beyond_the_bound_linearly(problem, uncompressed):
    noise = replace(Noise(), outlier=1.0)
    result = followed(problem, noise=noise)
    nu = np.abs(result.errors[:, :, 0] / np.sqrt(result.errors[:, :, 1])).ravel()
    assert 0.1 < np.mean(nu > 1.0) < 0.9
    assert result.cost == pytest.approx(np.sum(np.where(nu > 1.0, 2 * nu - 1.0, nu**2)))
    assert np.abs(result.rows[:, -1]) == pytest.approx(np.where(nu > 1.0, np.sqrt(nu), nu))


def test_blocks_do_not_change_what_is_found(problem, monkeypatch):
    whole = followed(problem)
    monkeypatch.setattr(module, "_BLOCK", 100)
    cut = followed(problem)
    assert cut.cost == pytest.approx(whole.cost, rel=1e-12)
    assert cut.rows.T @ cut.rows == pytest.approx(whole.rows.T @ whole.rows, rel=1e-9, abs=1e-6)
    assert np.array_equal(cut.states, whole.states)


def test_missing_samples_are_left_out_one_by_one(problem):
    track = problem.tracks[0]
    holes = track.measured["position"].copy()
    holes[500:520] = np.nan
    holes[600] = np.inf
    torn = replace(track, measured=track.measured.with_columns(position=holes))
    result = followed(problem, track=torn)
    missing = np.isnan(result.errors[:, 0, 0])
    assert np.flatnonzero(missing).tolist() == [*range(500, 520), 600]
    assert not np.isnan(result.errors[:, 1]).any()
    assert result.errors[519, 1, 1] > 0
    assert np.isfinite(result.rows).all()


def test_without_pressure_in_use_only_the_position_counts(problem):
    result = followed(problem, columns=("position",))
    assert np.isnan(result.errors[:, 1]).all()
    assert np.isfinite(result.errors[:, 0]).all()
    assert result.rows[:, NAMES.index("e_p")] == pytest.approx(0.0)


def test_what_the_filter_says_of_the_pressure_holds_the_truth(plant, recorded_by, problem_of):
    log = recorded_by(plant, 3.0)
    problem = problem_of(log, plant, NAMES, ("position",))
    result = followed(problem, columns=("position",))
    truth = recorded_by(plant.replace({"tau_p": 0.0}), 3.0, seed=None)["pressure_a"]
    off = (result.states[:, 2] - truth) / result.pressures[:, -1]
    # the model made the recording without process noise: the filter is surer than it says
    assert np.sqrt(np.mean(off**2)) < 1.0


def test_a_start_that_does_not_rest_is_known_less_well(problem, plant):
    track, names = problem.tracks[0], VARIANTS[plant.model]
    moving = replace(track, segment=replace(track.segment, vented=False, pressure_start=np.nan))
    assert start_deviations(track.segment, plant, False, ALL_IN) == pytest.approx(
        [STATES[name].start for name in names]
    )
    assert start_deviations(moving.segment, plant, False, ALL_IN) == pytest.approx(
        [STATES[name].unknown_start for name in names]
    )
    pressurised = replace(track, segment=replace(track.segment, vented=False, pressure_start=2e5))
    assert (
        start_deviations(pressurised.segment, plant, True, ALL_IN)[names.index("p_A")] == ALL_IN.measured["pressure_a"]
    )


def test_a_simulation_that_leaves_the_finite_numbers_is_a_failure_that_names_time_and_state(problem):
    track = problem.tracks[0]
    broken = track.segment.inputs.copy()
    broken[700:, 0] = np.nan
    result = followed(problem, track=replace(track, segment=replace(track.segment, inputs=broken)))
    assert isinstance(result, Failure)
    assert "0.7" in result.message


def test_recordings_are_filtered_with_the_signature_that_is_compiled_ahead():
    code = (
        "import clutchid\n"
        "from clutchid.codegen.kernels import kernels_in\n"
        "from clutchid.inference.filter.filtering import KERNELS, compile_filter\n"
        "compile_filter()\n"
        "log = clutchid.bundled_recording()\n"
        "cal = clutchid.calibrate(log.slice(0, 2000), free='load', method='prediction-error')\n"
        "clutchid.observe(log.slice(0, 1000), cal)\n"
        "follow = kernels_in(KERNELS).follow_segment\n"
        "assert len(follow.signatures) == 1, follow.signatures\n"
    )
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
