"""Residuals and Jacobian of a fit: exact derivatives through every kind of reset, and missing samples left out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from clutchid import fit, simulate
from clutchid.estimation import simulation_error
from clutchid.estimation.simulation_error import build_problem, linearise_segments, residuals, simulated_states
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.numerics.failure import Failure
from clutchid.simulation import Partition, run
from clutchid.simulation.noise import Noise
from clutchid.simulation.plan import plan
from fixtures.changed_logs import spoiled

SCALES = {"position": 1e-4, "pressure_a": 1e4}
NAMES = ("theta_1", "theta_2", "theta_3", "A_A", "V_0A", "V_0B", "P_0", "P_S", "C_vs", "C_ve", "K_z", "F_C", "y_max")


def problem_of(actuator: Actuator, logs: list[Log], partition: Partition | None, measure: tuple[str, ...]):
    """The problem of a fit, and x at the values of the actuator."""
    plans = [plan(log, actuator, 2300.0, partition, "pressure_a" in measure) for log in logs]
    problem, x = build_problem(actuator, plans, NAMES, measure, dict.fromkeys(NAMES, (-np.inf, np.inf)))
    return replace(problem, noise=Noise(measured=SCALES)), x


def stacked(problem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All residuals and the full Jacobian to x, segment by segment."""
    r_all, J_all = [], []
    for block in residuals(problem, x):
        assert not isinstance(block, Failure)
        full = np.zeros((block.r.size, x.size))
        full[:, block.places] = block.J
        r_all.append(block.r)
        J_all.append(full)
    return np.concatenate(r_all), np.vstack(J_all)


@pytest.fixture(scope="module")
def cut(driven, with_noise) -> Log:
    """3 s of which 0.2 s of an input are missing: a vented start and one under pressure, with measured pressure."""
    log = with_noise(driven(seconds=3.0), 21)
    return spoiled(log, "duty_supply", slice(1100, 1300))


@pytest.mark.slow
@pytest.mark.parametrize("measure", [("position",), ("position", "pressure_a")], ids=["position", "both"])
@pytest.mark.parametrize(
    "partition",
    [None, Partition(every=60), Partition(every=60, carry="q"), Partition(parts=9, carry="q")],
    ids=["ballistic", "every, p", "every, q", "parts, q"],
)
def test_the_jacobian_is_the_derivative_of_the_residuals_with_free_starts_and_resets(truth, cut, measure, partition):
    problem, x = problem_of(truth, [cut], partition, measure)
    _, J = stacked(problem, x)
    assert x.size == len(NAMES) + (2 if "pressure_a" not in measure else 1)
    for i in range(x.size):
        errors = []
        for step in (1e-4, 1e-5, 1e-6, 1e-7):
            h = np.zeros_like(x)
            h[i] = step * abs(x[i])
            difference = (stacked(problem, x + h)[0] - stacked(problem, x - h)[0]) / (2 * h[i])
            # as for the sensitivities: kinks, and the rounding of 3000 steps (15 mm / 0.1 mm and 5 bar / 0.1 bar)
            allowed = 1e-5 * np.abs(J[:, i]).max() + 1e-13 * 150 / h[i]
            errors.append(np.abs(difference - J[:, i]).max() / allowed)
        assert min(errors) < 1, problem.names[i]


def test_a_missing_measurement_is_as_if_its_row_had_been_deleted(truth, drive):
    generator = np.random.default_rng(22)
    measure = ("position", "pressure_a")
    gone = {name: generator.random(len(drive)) < 0.3 for name in measure}
    gone["position"][:500] = gone["pressure_a"][:25] = False  # the start, from the first rest, is the same
    holed = drive.with_columns(**{name: np.where(gone[name], np.nan, drive[name]) for name in measure})
    (whole, x), (part, x_part) = (problem_of(truth, [log], None, measure) for log in (drive, holed))
    r, J = stacked(whole, x * 1.01)
    present = ~np.concatenate([gone["position"], gone["pressure_a"]])
    r_part, J_part = stacked(part, x_part * 1.01)
    assert np.array_equal(r_part, r[present])
    assert np.array_equal(J_part, J[present])


def test_the_linearisation_is_the_compressed_stack_of_all_segments_and_recordings(truth, drive, cut):
    problem, x = problem_of(truth, [drive, cut], None, ("position",))
    x = x * 1.02
    r, J = stacked(problem, x)
    there = linearise_segments(problem, x)
    assert there.count == r.size == 10000 + 2800
    assert there.cost == pytest.approx(0.5 * r @ r, rel=1e-12)
    # orthogonal transformations: n eps of the norms
    np.testing.assert_allclose(there.R.T @ there.R, J.T @ J, atol=1e-11 * np.abs(J.T @ J).max())
    np.testing.assert_allclose(there.R.T @ there.q, J.T @ r, atol=1e-11 * np.linalg.norm(J) * np.linalg.norm(r))


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [("C_vs", -1e-9, "a conductance must be at least 0"), ("theta_2", -1e12, "diverged at")],
    ids=["contradicting parameters", "a simulation that blows up"],
)
def test_a_point_that_cannot_be_simulated_is_an_answer_not_an_exception(truth, drive, name, value, sentence):
    problem, x = problem_of(truth, [drive], None, ("position",))
    at = NAMES.index(name)
    x[at] = problem.coordinates[at].of(value)
    answer = linearise_segments(problem, x)
    assert isinstance(answer, Failure)
    assert sentence in answer.message


def test_derivatives_are_computed_where_the_search_goes_and_not_for_the_multiples_of_the_start(
    monkeypatch, truth, drive
):
    simulated = []
    for name in ("run", "run_with_sensitivities"):
        monkeypatch.setattr(
            simulation_error, name, lambda *inputs, of=name: simulated.append(of) or getattr(run, of)(*inputs)
        )
    result = fit(drive, truth, free="load")
    # the best multiple, each point of the search, and the covariance with its column more; the fine search begins with
    # the rows of the coarse one, divided by other scales
    assert simulated.count("run_with_sensitivities") == result.evaluations - len(simulation_error.COARSE_FACTORS) + 1
    assert simulated.count("run") == len(simulation_error.COARSE_FACTORS) + 1


@pytest.mark.parametrize("measure", ["position", "position,pressure_a"])
def test_every_start_has_its_final_cost_at_the_noise_scales_of_the_result(truth, drive, measure):
    noisy = drive.with_columns(position=drive["position"] + 1e-4 * np.sin(np.arange(len(drive))))
    result = fit(noisy, truth, free="load", measure=measure)

    def cost(actuator):
        simulated = simulate(actuator, noisy, starts=result.recordings[noisy.name].starts).log
        return sum(float(np.nansum((simulated[n] - noisy[n]) ** 2)) / s**2 for n, s in result.scales.items())

    assert {start.status for start in result.starts} == {"converged", "not searched"}
    for factor, start in zip(simulation_error.COARSE_FACTORS, result.starts, strict=True):
        chosen = start.status == "converged"
        theta = tuple(factor * weight for weight in truth.load.theta)
        actuator = result.actuator if chosen else replace(truth, load=replace(truth.load, theta=theta))
        assert start.name == f"load times {factor:g}"
        assert start.cost == pytest.approx(cost(actuator), rel=1e-6)
    assert min(result.starts, key=lambda start: start.cost).status == "converged"


def test_a_start_that_cannot_be_simulated_has_failed(monkeypatch, truth, drive):
    def blown_up(problem, x, number):
        states = simulated_states(problem, x, number)
        heavy = problem.actuator_of(x, problem.stems[0]).load.theta[0] > 1.5 * truth.load.theta[0]
        return np.full_like(states, np.nan) if heavy else states

    monkeypatch.setattr(simulation_error, "simulated_states", blown_up)
    *others, heavy = fit(drive, truth, free="load").starts
    assert (heavy.cost, heavy.status) == (np.inf, "failed")
    assert "failed" not in {start.status for start in others}


def test_numbers_of_a_fit_are_of_order_one_and_go_back_to_si(truth, cut):
    problem, x = problem_of(truth, [cut], None, ("position",))
    assert np.all((np.abs(x) > 0.05) & (np.abs(x) < 50))
    for name, value in zip(NAMES, problem.si(x), strict=False):
        assert value == pytest.approx(truth.value(name))
    assert problem.actuator_of(x, cut.name).value("C_vs") == pytest.approx(19e-9)


@pytest.mark.parametrize(
    ("supply", "highest"),
    [(9e5, 18e5), (1e5, 2.19e5)],
    ids=["twice the supply", "twice the ambient where the supply is lower"],
)
def test_a_free_start_is_within_2_mm_and_from_half_the_ambient_to_twice_the_highest_pressure(
    truth, cut, supply, highest
):
    problem, x = problem_of(truth.replace({"P_S": supply}), [cut], None, ("position",))
    low, high, start = (problem.si(values)[len(NAMES) :] for values in (*problem.bounds(), x))
    assert low == pytest.approx([start[0] - 2e-3, 54_750.0])
    assert high == pytest.approx([start[0] + 2e-3, highest])
    # where the recording says the piston is, to the noise of 0.05 mm
    assert start[0] == pytest.approx(cut["position"][problem.plans[0].segments[-1].start], abs=5 * 5e-5)


def test_a_start_at_rest_is_not_free_and_one_with_measured_pressure_only_in_position(truth, cut):
    problem, x = problem_of(truth, [cut], None, ("position", "pressure_a"))
    assert [segment.vented for segment in problem.plans[0].segments] == [True, False]
    assert problem.names[len(NAMES) :] == (f"y_start@{cut.name}, segment 1",)
    assert x.size == len(NAMES) + 1


@pytest.mark.slow
def test_nineteen_of_twenty_intervals_hold_the_truth_where_the_valve_opens_at_the_first_sample(truth, driven):
    """The position at the start is then one sample, whose noise moves the load: without it 43 % hold theta_3."""
    log, trials = driven(seconds=4.0), 30
    opens = int(np.argmax(log["duty_supply"] > truth.parameters.R_0vs))
    log, inside = log.slice(opens, len(log)), np.zeros(3)
    for seed in range(trials):
        noise = np.random.default_rng(seed).normal(0.0, 3e-5, log.time.size)
        estimates = fit(log.with_columns(position=log["position"] + noise), truth, free="load").parameters.values()
        inside += [
            estimate.low <= truth.value(name) <= estimate.high
            for name, estimate in zip(truth.load.names, estimates, strict=True)
        ]
    # 95 %, but for the counting of 30; a little more, as the noise of the other samples is counted by a sandwich
    assert np.all(inside >= binom.ppf(0.001, trials, 0.95)), inside
