"""`fit.problem` and `clutchid.problem`: the least-squares problem of a fit in the hands of other tools."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

import clutchid
from clutchid.errors import ParameterError
from clutchid.estimation.fit_problem import FitProblem
from clutchid.estimation.result import Fit
from clutchid.log import FloatArray, Log

WITH_PRESSURE = {"measure": "position,pressure_a", "free": "load,P_S"}


@pytest.fixture(scope="module")
def own_data() -> Log:
    """The paper's model with two active load weights, its position with white noise of 20 um."""
    log = clutchid.bundled_recording().slice(0, 8000)
    actuator = clutchid.Actuator(load=clutchid.Load((8.5e5, -4e4, 4e5)))
    states = clutchid.simulate(actuator, log).log
    rng = np.random.default_rng(3)
    noisy = {name: states[name] + std * rng.standard_normal(len(log)) for name, std in
             (("position", 2e-5), ("pressure_a", 2e3))}  # fmt: skip
    return log.with_columns(**noisy)


@pytest.fixture(scope="module", params=["simulation", "shooting", "prediction-error"])
def fit(request: pytest.FixtureRequest, own_data: Log) -> Fit:
    return clutchid.fit(own_data, method=request.param, **WITH_PRESSURE)


def directions(problem: FitProblem, count: int) -> list[FloatArray]:
    """Random steps of a standard deviation."""
    root, rng = np.linalg.cholesky(problem.covariance), np.random.default_rng(1)
    steps = [root @ rng.standard_normal(problem.x.size) for _ in range(count)]
    return [step * np.sqrt(problem.x.size) / np.linalg.norm(np.linalg.solve(root, step)) for step in steps]


def test_it_stands_at_the_end_of_the_fit(fit: Fit) -> None:
    problem = fit.problem
    assert problem.names == tuple(fit.parameters)
    assert problem.units == tuple(e.unit for e in fit.parameters.values())
    assert problem.values(problem.x) == pytest.approx({name: e.value for name, e in fit.parameters.items()})
    assert problem.cost(problem.x) == pytest.approx(min(start.cost for start in fit.starts) / 2, rel=1e-3)
    deviations = np.sqrt(np.diag(problem.covariance)) * problem.slopes(problem.x)
    assert deviations == pytest.approx([e.std for e in fit.parameters.values()], rel=1e-3)


def test_half_the_sum_of_squares_is_the_cost_and_its_gradient_is_that_of_the_rows(fit: Fit) -> None:
    problem = fit.problem
    u, step = directions(problem, 1)[0], 0.5
    x = problem.x + 2 * u
    residuals = problem.residuals(x)
    assert residuals @ residuals / 2 == pytest.approx(problem.cost(x), rel=0.02)
    change = problem.cost(x + step * u) - problem.cost(x - step * u)
    assert problem.jacobian(x).T @ residuals @ u == pytest.approx(change / (2 * step), rel=0.05)


def test_the_density_has_the_curvature_of_the_stated_covariance(fit: Fit) -> None:
    problem = fit.problem
    steps = directions(problem, 6)
    ratios = [-2 * problem.log_density(problem.x + u) / (u @ np.linalg.solve(problem.covariance, u)) for u in steps]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.1)


def test_the_gradient_of_the_density_is_its_derivative(fit: Fit) -> None:
    problem = fit.problem
    first, second = directions(problem, 2)
    x, step = problem.x + first, 0.2
    change = problem.log_density(x + step * second) - problem.log_density(x - step * second)
    # the states of multiple shooting end where a step gains little, so that its density scatters by about 0.1
    assert problem.log_density_gradient(x) @ second == pytest.approx(change / (2 * step), rel=0.05, abs=0.5)


def test_the_density_is_the_same_in_whatever_order_it_is_evaluated(fit: Fit) -> None:
    problem, again = fit.problem, fit.problem
    points = [problem.x + u for u in directions(problem, 3)]
    forward = [problem.log_density(x) for x in points]
    backward = [again.log_density(x) for x in reversed(points)]
    assert forward == backward[::-1]


def test_beyond_a_bound_the_density_is_zero(own_data: Log) -> None:
    problem = clutchid.fit(own_data, bounds={"theta_1": (8e5, 9e5)}).problem
    x = problem.x.copy()
    x[0] = problem.bounds[1][0] * 1.001
    assert problem.log_density(x) == -np.inf
    assert np.isnan(problem.log_density_gradient(x)).all()


@pytest.mark.slow
@pytest.mark.parametrize(("method", "steps"), [("simulation", 300), ("shooting", 100), ("prediction-error", 250)])
def test_a_sampler_finds_the_stated_deviations(method: str, steps: int, own_data: Log) -> None:
    """Affine-invariant ensemble (Goodman and Weare 2010), as emcee has it."""
    fit = clutchid.fit(own_data.slice(0, 2000), method=method, measure="position,pressure_a", free="theta_1,P_S")
    problem, rng = fit.problem, np.random.default_rng(5)
    walkers = rng.multivariate_normal(problem.x, problem.covariance, 12)
    values, chain = [problem.log_density(x) for x in walkers], []
    for _ in range(steps):
        for half, other in ((range(6), range(6, 12)), (range(6, 12), range(6))):
            for i in half:
                stretch = (1.0 + rng.random()) ** 2 / 2.0
                x = walkers[rng.choice(other)] * (1.0 - stretch) + stretch * walkers[i]
                value = problem.log_density(x)
                if np.log(rng.random()) < (x.size - 1) * np.log(stretch) + value - values[i]:
                    walkers[i], values[i] = x, value
        chain.append(walkers.copy())
    drawn = np.concatenate(chain[steps // 5 :]).std(axis=0) * problem.slopes(problem.x)
    # 15 %, and two standard errors of the chain, whose draws are worth a twentieth as many independent ones
    rel = 0.15 + 2.0 / np.sqrt(2 * 12 * 0.8 * steps / 20)
    assert drawn == pytest.approx([e.std for e in fit.parameters.values()], rel=rel)


def test_scipy_finds_the_fit_from_a_problem_that_is_not_fitted(own_data: Log) -> None:
    problem = clutchid.problem(own_data, free="theta_1,theta_2,theta_3")
    assert problem.covariance is None
    assert problem.log_density(problem.x) == -problem.cost(problem.x)
    end = least_squares(problem.residuals, problem.x, problem.jacobian, bounds=problem.bounds)
    fit = clutchid.fit(own_data)
    assert problem.values(end.x) == pytest.approx({n: e.value for n, e in fit.parameters.items()}, rel=1e-3)


def test_the_raw_jacobian_is_that_of_the_samples(own_data: Log) -> None:
    problem = clutchid.fit(own_data).problem
    run = clutchid.simulate(problem.actuator_of(problem.x), own_data, sensitivities=problem.names)
    expected = np.column_stack([run.sensitivities[name][:, 0] for name in problem.names])
    assert np.allclose(problem.raw_jacobian(problem.x), expected, atol=1e-6 * np.abs(expected).max())


def test_raw_prediction_errors_have_the_unit_of_their_column(own_data: Log) -> None:
    problem = clutchid.fit(own_data, method="prediction-error", **WITH_PRESSURE).problem
    raw = problem.raw_jacobian(problem.x)
    data = problem.jacobian(problem.x)[-len(raw) :]
    # theta_1 moves the pressure by Pa, and its standard deviation is that of an innovation
    pressure = np.median(np.abs(raw[1::2, 0])) * problem.slopes(problem.x)[0] / np.median(np.abs(data[1::2, 0]))
    assert 1e3 < pressure < 2e4


def test_by_shooting_there_are_no_raw_samples(own_data: Log) -> None:
    problem = clutchid.fit(own_data, method="shooting", **WITH_PRESSURE).problem
    with pytest.raises(ParameterError, match="samples are eliminated with the states; use jacobian"):
        problem.raw_jacobian(problem.x)


def test_a_fit_does_not_grow_by_its_problem_and_both_are_pickled(fit: Fit) -> None:
    size = len(pickle.dumps(fit))
    problem = fit.problem
    x = problem.x + directions(problem, 1)[0]
    value = problem.log_density(x)
    assert len(pickle.dumps(fit)) == size
    assert size - len(pickle.dumps(replace(fit, request=None, start=None))) < 10_000
    assert pickle.loads(pickle.dumps(problem)).log_density(x) == pytest.approx(value, rel=1e-6)


def test_an_unknown_start_of_a_recording_is_one_of_its_parameters(own_data: Log) -> None:
    fit = clutchid.fit(own_data.slice(1500, 6000))
    problem = fit.problem
    assert problem.units[3:] == ("m", "Pa")
    assert problem.cost(problem.x) == pytest.approx(min(start.cost for start in fit.starts) / 2, rel=1e-3)
    starts = [problem.values(problem.x)[name] for name in problem.names[3:]]
    assert tuple(starts) == pytest.approx(fit.recordings["truck1_calibration"].starts[0])


def test_a_reading_has_no_single_problem(own_data: Log) -> None:
    once = clutchid.calibrate(own_data.slice(0, 4000))
    later = own_data.slice(4000, 8000).without("pressure_a")
    with pytest.raises(ParameterError, match="weighs hypotheses about changes since its calibration"):
        _ = clutchid.estimate(later, once).problem
    problem = clutchid.problem(later, once)
    assert np.isfinite(problem.cost(problem.x))


def test_another_number_of_parameters_is_refused(own_data: Log) -> None:
    problem = clutchid.problem(own_data)
    with pytest.raises(ParameterError, match=r"x has the shape \(2,\); it must be \(3,\): theta_1, theta_2, theta_3"):
        problem.cost([1.0, 2.0])
