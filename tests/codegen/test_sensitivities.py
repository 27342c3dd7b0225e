"""Exact derivatives of the computed solution: against formulas, finite differences and order."""

import numpy as np
import pytest
import sympy as sp

pytestmark = pytest.mark.slow


def _slope(errors):
    return np.log2(errors[:-1] / errors[1:])


def _logistic_errors(kernels, steps):
    """Errors at t = 2 of the state and of its derivatives to N(0), r and K, for numbers of steps."""
    start, r, K, t = sp.symbols("N_0 r K t", positive=True)
    solution = K / (1 + (K / start - 1) * sp.exp(-r * t))
    point = {start: 0.3, r: 1.7, K: 2.0, t: 2.0}
    exact = [float(e.subs(point)) for e in (solution, *(sp.diff(solution, q) for q in (start, r, K)))]
    errors = []
    for n in steps:
        _, x, S = kernels.run([0.3], [1.7, 2.0], [2.0 / n] * n, kernel="run_all")
        errors.append(np.abs(np.array([x[-1, 0], *S[-1, 0]]) - exact))
    return np.array(errors)


def test_states_and_sensitivities_converge_with_order_four(logistic, compiled):
    slopes = _slope(_logistic_errors(compiled(logistic), [40, 80, 160, 320]))
    # slope = 4 + O(h): its distance from 4 halves with h, and is below h (times the rate 1.7) for the state here
    bound = 1.7 * 2.0 / np.array([40, 80, 160])[:, None] * np.array([1.0, 3.0, 3.0, 3.0])
    assert (np.abs(slopes - 4) < bound).all()


ASSORTED = {"x0": [3.0, 0.9, 0.2, 2.5], "p": [0.8, 0.9], "theta": [0.5, 0.7]}


def _assorted(kernels, values, kernel="run"):
    n = 300
    u = 1 + np.sin(0.05 * np.arange(n + 1))[:, None]
    return kernels.run(values[:4], values[4:6], [0.01] * n, u=u, substeps=2, theta=values[6:], kernel=kernel,
                       jump={100: 1, 200: 2}, measured=0.4)  # fmt: skip


def test_sensitivities_are_the_derivatives_of_the_computed_solution_through_branches_table_and_jumps(
    assorted, compiled
):
    kernels = compiled(assorted)
    values = np.concatenate([ASSORTED[key] for key in ("x0", "p", "theta")])
    _, x, S = _assorted(kernels, values, "run_all")
    for column, value in enumerate(values):
        step = 1e-5 * value
        up, down = values.copy(), values.copy()
        up[column] += step
        down[column] -= step
        difference = (_assorted(kernels, up)[1] - _assorted(kernels, down)[1]) / (2 * step)
        # Central differences: rounding 1e-15 / 1e-5 of the state. Steps in which a branch changes are not smooth: they
        # err by the step size times the jump of the second derivative, all of order one here.
        np.testing.assert_allclose(S[:, :, column], difference, atol=20 * 1e-5 * np.abs(x).max())


def test_the_table_kernel_carries_the_same_derivatives_to_states_and_weights(assorted, compiled):
    kernels = compiled(assorted)
    n = 150
    several = [
        kernels.run(ASSORTED["x0"], ASSORTED["p"], [0.01] * n, theta=ASSORTED["theta"], kernel=kernel)[2]
        for kernel in ("run_all, weights only", "run_all")
    ]
    chosen = [0, 1, 2, 3, 6, 7]  # without the two parameters
    # Some 40 operations a step on numbers of order 1 that may cancel.
    np.testing.assert_allclose(several[0][:, :, chosen], several[1][:, :, chosen], atol=n * 40 * np.finfo(float).eps)


def test_the_derivative_to_a_table_weight_is_exact_beyond_and_below_a_breakpoint(assorted, compiled):
    _, _, S = compiled(assorted).run([0, 0, 0, 0.9], [1, 1], [0.005] * 200, theta=(0.7, 0.4), kernel="run_all")
    t = 0.005 * np.arange(201)
    # w = 0.9 exp(-theta_1 t) below 1, where phi_2 is zero.
    np.testing.assert_allclose(S[:, 3, 6], -t * 0.9 * np.exp(-0.7 * t), atol=10 * 0.005**4)
    assert (S[:, 3, 7] == 0).all()


def test_a_jump_maps_the_sensitivities_with_its_own_derivatives(assorted, compiled):
    b, q, level = 0.8, 0.9, 0.7
    zero = [[0.0]] * 3
    _, x, S = compiled(assorted).run([1.5, 2.0, 3.0, 0.5], [b, q], [0.0, 0.0], u=zero, jump={1: 2}, measured=level,
                                     kernel="run_all")  # fmt: skip
    # Steps of no length: what remains is the jump (a b, h q + level, a sqrt m, w).
    a, h, m, _ = x[1]
    expected = np.zeros((4, 8))
    expected[0, 0], expected[0, 4] = b, a
    expected[1, 1], expected[1, 5] = q, h
    expected[2, 0], expected[2, 2] = np.sqrt(m), a / (2 * np.sqrt(m))
    expected[3, 3] = 1.0
    np.testing.assert_allclose(S[2], expected, rtol=1e-15)


@pytest.mark.parametrize("depth", [0.0, -0.5, 1e-300])
def test_a_root_outside_its_domain_never_poisons_a_value_or_a_derivative(assorted, compiled, depth):
    status, x, S = compiled(assorted).run([1.0, depth, 1.0, 0.5], [0.8, 0.9], [0.01] * 20, kernel="run_all")
    assert status == -1
    assert np.isfinite(x).all()
    if depth <= 0:  # just above zero the derivative of the root is rightly huge
        assert np.isfinite(S).all()


def test_only_structurally_present_derivatives_have_a_slot(assorted, logistic, compiled):
    # a' needs b, h' needs q; the jump "mix" gives a a derivative to b and h one to q, nothing else.
    assert compiled(assorted).module.SLOTS == ((0, 0), (1, 1))
    assert compiled(logistic).module.SLOTS == ((0, 0), (0, 1))
    assert compiled(assorted).module.JUMPS == ("replace", "mix")


@pytest.mark.parametrize("columns", [0, 1, 3, 4, 5, 9])
def test_any_number_of_columns_may_be_carried_and_the_last_derivatives_are_left_in_s(logistic, compiled, columns):
    kernels, n = compiled(logistic), 50
    _, _, full = kernels.run([0.3], [1.7, 2.0], [0.02] * n, kernel="run_all")  # columns N(0), r, K
    S = np.zeros((1, columns))
    S[0, ::3] = 1.0
    wanted = [(slot, 0, c) for slot in (0, 1) for c in range(columns) if c % 3 == slot + 1]
    fill = np.array(wanted, np.int64).reshape(-1, 3).T
    out, sens = np.zeros((n + 1, 1)), np.zeros((n + 1, 1, columns))
    nothing = np.zeros((n + 1, 0))
    args = (nothing, np.array([1.7, 2.0]), np.full(n, 0.02), np.ones(n, np.int32), np.zeros(n + 1, np.uint8), nothing)
    kernels.module.run_all(np.array([0.3]), S, *args, *(row.copy() for row in fill), np.array([0]), out, sens)
    assert (sens[:, 0, :] == full[:, 0, np.arange(columns) % 3]).all()
    assert (sens[-1] == S).all()


def test_a_derivative_that_is_zero_for_a_while_goes_on_as_one_from_there(oscillator, compiled):
    p, rest, driven = [3.0, 0.4, 0.7], 20, 40
    push = np.r_[np.zeros(rest), np.ones(driven + 1)][:, None]
    kernels = compiled(oscillator)
    _, _, whole = kernels.run([0.0, 0.0], p, [0.02] * (rest + driven), u=push, kernel="run_all")
    _, _, later = kernels.run([0.0, 0.0], p, [0.02] * driven, u=push[rest:], kernel="run_all")
    assert not whole[: rest + 1, :, 2:].any()
    np.testing.assert_array_equal(whole[rest:, :, 2:], later[:, :, 2:])


def test_a_run_that_fails_leaves_the_derivatives_of_its_last_sample_in_s(logistic, compiled):
    n = 200
    S, out, sens = np.ones((1, 1)), np.zeros((n + 1, 1)), np.zeros((n + 1, 1, 1))
    nothing, none = np.zeros((n + 1, 0)), np.zeros(0, np.int64)
    args = (nothing, np.array([1.0, 2.0]), np.full(n, 0.01), np.ones(n, np.int32), np.zeros(n + 1, np.uint8), nothing)
    failed = compiled(logistic).module.run_all(np.array([-1.0]), S, *args, none, none, none, np.array([0]), out, sens)
    np.testing.assert_array_equal(S, sens[failed])
