"""The search and its linear algebra against NumPy and SciPy on textbook problems."""

import numpy as np
import pytest
import scipy.optimize
from scipy.optimize import least_squares, lsq_linear

from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import Linearisation, bounded_solution, compress, minimise


def linearised(residuals, jacobian):
    def evaluate(x: np.ndarray) -> Linearisation:
        r, J = residuals(x), jacobian(x)
        factor, k = compress(np.column_stack([J, r])), x.size
        return Linearisation(factor[:k, :k], factor[:k, k], 0.5 * float(r @ r), r.size)

    return evaluate


def searched(evaluate, start, low=-np.inf, high=np.inf, **options):
    """The end of a search from `start` with these bounds."""
    start = np.array(start, dtype=float)
    low, high = (np.broadcast_to(np.asarray(bound, dtype=float), start.shape) for bound in (low, high))
    return minimise(evaluate, (start, evaluate(start)), low, high, **{"tolerance": 1e-12, **options})


def expected(start, residuals=None, slopes=None, bounds=(-np.inf, np.inf)):
    """The end of SciPy's search, by default for `decay`."""
    return least_squares(residuals or decay, start, slopes or decay_slopes, bounds, xtol=1e-15, ftol=1e-15, gtol=1e-15)


def rosenbrock(x):
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def rosenbrock_slopes(x):
    return np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])


TIMES = np.linspace(0, 4, 60)
DECAY = 2.5 * np.exp(-1.3 * TIMES) + 0.5 + 0.01 * np.sin(40 * TIMES)


def decay(x):
    return x[0] * np.exp(-x[1] * TIMES) + x[2] - DECAY


def decay_slopes(x):
    e = np.exp(-x[1] * TIMES)
    return np.column_stack([e, -x[0] * TIMES * e, np.ones_like(e)])


CASES = {
    "rosenbrock, free": (rosenbrock, rosenbrock_slopes, [-1.2, 1.0], [-np.inf] * 2, [np.inf] * 2),
    "rosenbrock, x_1 below 0.5": (rosenbrock, rosenbrock_slopes, [-1.2, 1.0], [-2, -2], [0.5, 2]),
    "rosenbrock, x_2 above 1.5": (rosenbrock, rosenbrock_slopes, [-1.2, 2.0], [-2, 1.5], [2, 3]),
    "decay, free": (decay, decay_slopes, [1.0, 1.0, 0.0], [-np.inf] * 3, [np.inf] * 3),
    "decay, offset at most 0.45": (decay, decay_slopes, [1.0, 1.0, 0.0], [0, 0, -1], [5, 5, 0.45]),
    "decay, rate and offset bounded": (decay, decay_slopes, [1.0, 0.8, 0.0], [0, 0.1, -1], [5, 1.0, 0.45]),
}


@pytest.mark.parametrize("case", CASES)
def test_the_search_ends_where_scipy_ends(case):
    residuals, slopes, start, low, high = CASES[case]
    search_result = searched(linearised(residuals, slopes), start, low, high, tolerance=1e-14)
    there = expected(np.clip(start, np.array(low) + 1e-6, np.array(high) - 1e-6), residuals, slopes, (low, high))
    assert search_result.status == "converged"
    # both stop when the cost changes by some 1e-14; it is quadratic in x, so x is good to about 1e-7
    np.testing.assert_allclose(search_result.x, there.x, rtol=0, atol=1e-6)
    assert search_result.at.cost <= there.cost * (1 + 1e-9) + 1e-20


def test_an_active_bound_is_met_exactly():
    assert searched(linearised(decay, decay_slopes), [1, 1, 0], [0, 0, -1], [5, 5, 0.45]).x[2] == 0.45


def test_a_bound_is_left_again_when_the_data_ask_for_it():
    search_result = searched(linearised(decay, decay_slopes), [1, 1, 0.45], [0, 0, 0.45], [5, 5, 2])
    there = expected([1, 1, 1])
    assert there.x[2] > 0.46
    np.testing.assert_allclose(search_result.x, there.x, atol=1e-6)


def test_a_failing_trial_point_only_shortens_the_step():
    evaluate = linearised(decay, decay_slopes)
    search_result = searched(lambda x: Failure("too fast") if x[1] > 1.4 else evaluate(x), [1, 0.1, 0])
    np.testing.assert_allclose(search_result.x, expected([1, 0.1, 0]).x, atol=1e-6)


def test_a_search_that_fails_everywhere_stalls_at_its_start():
    start, free = np.ones(3), np.full(3, np.inf)
    there = linearised(decay, decay_slopes)(start)
    end = minimise(lambda x: Failure("never"), (start, there), -free, free, tolerance=1e-12)
    assert end.status == "stalled"
    assert np.array_equal(end.x, start)


def test_a_search_that_may_not_evaluate_any_more_says_so():
    search_result = searched(linearised(rosenbrock, rosenbrock_slopes), [-1.2, 1.0], tolerance=1e-14, max_evaluations=3)
    assert (search_result.status, search_result.evaluations) == ("limit", 3)


def test_a_silent_column_stays_at_its_start():
    evaluate = linearised(lambda x: np.array([1.0, 2.0]) * (x[0] - 3), lambda x: np.array([[1.0, 0.0], [2.0, 0.0]]))
    np.testing.assert_allclose(searched(evaluate, [1, 7]).x, [3.0, 7.0], rtol=1e-6)


@pytest.mark.parametrize("rows", [7, 64, 1 << 16])
def test_compression_in_blocks_keeps_the_normal_equations_and_the_solution(rows):
    generator = np.random.default_rng(2)
    J, r = generator.standard_normal((300, 4)), generator.standard_normal(300)
    whole = np.column_stack([J, r])
    factor = compress(whole, rows)
    # Householder triangularisation is backward stable: some n * eps of the norms
    np.testing.assert_allclose(factor.T @ factor, whole.T @ whole, atol=300 * 2.3e-16 * 300)
    assert np.array_equal(factor, np.triu(factor))
    solution = -np.linalg.solve(factor[:4, :4], factor[:4, 4])
    np.testing.assert_allclose(solution, np.linalg.lstsq(J, -r, rcond=None)[0], atol=1e-13)
    np.testing.assert_allclose(abs(factor[4, 4]), np.linalg.norm(r + J @ solution), rtol=1e-12)


def test_compression_of_fewer_rows_than_columns_fills_up_with_zeros():
    factor = compress(np.array([[1.0, 2.0, 3.0, 4.0]]))
    assert factor.shape == (4, 4)
    np.testing.assert_allclose(np.abs(factor[0]), [1, 2, 3, 4])
    assert not factor[1:].any()


def test_a_solution_within_bounds_is_that_of_a_search_over_all_of_them(monkeypatch):
    searches = []
    monkeypatch.setattr(scipy.optimize, "lsq_linear", lambda *a, **k: searches.append(1) or lsq_linear(*a, **k))
    rng = np.random.default_rng(7)
    for _ in range(200):
        size = int(rng.integers(1, 9))
        matrix, target = rng.normal(size=(2 * size, size)), 3.0 * rng.normal(size=2 * size)
        low, high = -rng.uniform(0.0, 0.5, size), rng.uniform(0.0, 0.5, size)
        x = bounded_solution(matrix, target, low, high)
        reference = lsq_linear(matrix, target, bounds=(low, high), method="bvls", tol=1e-14)
        np.testing.assert_allclose(x, reference.x, atol=1e-9)
    assert 0 < len(searches) < 150, "most are solved without a search, and not all"
