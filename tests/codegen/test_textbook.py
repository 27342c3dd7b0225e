"""Generated kernels against exact solutions."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from clutchid.codegen.language import PYTHON_WORDS, apart
from clutchid.codegen.system import System

pytestmark = pytest.mark.slow


def test_a_driven_spring_follows_its_exact_solution_although_its_names_are_those_of_the_generated_code(
    oscillator, compiled
):
    k, c, m, u, h, n = 9.0, 0.6, 1.5, 2.0, 1e-3, 2000
    status, x, _ = compiled(oscillator).run([0.3, -0.1], [k, c, m], [h] * n, u=[[u]] * (n + 1))
    t = h * np.arange(n + 1)
    decay, omega = c / (2 * m), math.sqrt(k / m - (c / (2 * m)) ** 2)
    x_0, v_0 = 0.3 - u / k, -0.1
    exact = u / k + np.exp(-decay * t) * (x_0 * np.cos(omega * t) + (v_0 + decay * x_0) / omega * np.sin(omega * t))
    assert status == -1
    # The error of classical RK4 over a time T is at most about T h^4 omega^5 / 120 times the amplitude.
    assert np.abs(x[:, 0] - exact).max() < 2.0 * h**4 * omega**5 / 120


def test_branches_and_the_table_follow_their_exact_solutions(assorted, compiled):
    n, h, (b, q), theta = 400, 5e-3, (0.8, 0.3), (0.7, 0.4)
    status, x, _ = compiled(assorted).run([-2.0, 4.0, 0.5, 0.9], [b, q], [h] * n, u=[[1.5]] * (n + 1), theta=theta)
    t = h * np.arange(n + 1)
    exact = np.array(
        [
            -2.0 / (1 + b * 2.0 * t),
            (2.0 - q * t / 2) ** 2,
            1.5 - np.exp(-t),
            0.9 * np.exp(-theta[0] * t),
        ]
    ).T
    assert status == -1
    # RK4 errs by about (h L)^4 / 120 a unit of time with rates L below 2; 100 leaves room for the constant of a' = a^2.
    np.testing.assert_allclose(x, exact, atol=100 * (h * 2.0) ** 4 / 120)


def test_beyond_a_breakpoint_the_table_uses_the_next_segment_whichever_way_it_is_entered(assorted, compiled):
    # Falling from 3 at constant f = theta_1 beyond 1 (theta_2 = 0), then exponentially.
    h, n, theta = 0.01, 400, (1.0, 0.0)
    _, x, _ = compiled(assorted).run([0.0, 0.0, 0.0, 3.0], [1.0, 1.0], [h] * n, theta=theta)
    t = h * np.arange(n + 1)
    # The kink at t = 2 lies on a sample but may be passed a rounding error late: one step then errs by h^2 / 2 at most.
    np.testing.assert_allclose(x[:, 3], np.where(t < 2, 3 - t, np.exp(-(t - 2))), atol=h**2 / 2)
    # Rising: f = -theta_2 (w - 1)^2 with theta_2 = -1 grows without end, below 1 nothing moves.
    _, y, _ = compiled(assorted).run([0.0, 0.0, 0.0, 1.5], [1.0, 1.0], [h] * 100, theta=(0.0, -1.0))
    np.testing.assert_allclose(y[:, 3], 1 + 0.5 / (1 - 0.5 * t[:101]), rtol=100 * h**4)
    _, y, _ = compiled(assorted).run([0.0, 0.0, 0.0, 0.5], [1.0, 1.0], [h] * 10, theta=(0.0, -1.0))
    assert (y[:, 3] == 0.5).all()


def test_an_input_is_held_from_its_sample_to_the_next(assorted, compiled):
    u = np.array([[2.0], [0.0], [0.0]])
    _, x, _ = compiled(assorted).run([0.0, 0.0, 0.0, 0.0], [1.0, 1.0], [0.1, 0.1], u=u)
    after = 2 * (1 - np.exp(-0.1))
    # One RK4 step of a linear equation is the Taylor series of order 4: it lacks 2 h^5 / 120 and what follows.
    assert x[:, 2] == pytest.approx([0.0, after, after], abs=2 * 0.1**5 / 120)


def test_sub_steps_are_the_same_as_finer_samples_bit_for_bit(van_der_pol, compiled):
    kernels = compiled(van_der_pol)
    _, coarse, _ = kernels.run([1.0, 0.5], [3.0], [0.125] * 40, substeps=4)
    _, fine, _ = kernels.run([1.0, 0.5], [3.0], [0.03125] * 160)
    assert (coarse == fine[::4]).all()


def test_uneven_samples_are_integrated_over_their_own_intervals(logistic, compiled):
    dt = np.random.default_rng(3).uniform(0.005, 0.02, 100)
    _, x, _ = compiled(logistic).run([0.1], [1.0, 2.0], dt)
    t = np.concatenate([[0.0], np.cumsum(dt)])
    # (h r)^4 / 120 a unit of time; 10 covers the derivatives of the logistic curve.
    np.testing.assert_allclose(x[:, 0], 2 / (1 + 19 * np.exp(-t)), rtol=10 * 0.02**4 / 120 * t[-1])


@pytest.mark.parametrize("kernel", ["run", "run_all"])
def test_a_run_that_leaves_the_finite_numbers_returns_the_first_such_sample(logistic, compiled, kernel):
    # Below zero the logistic equation runs off to minus infinity at t = ln(1 + K / |N|) = ln 3.
    status, x, _ = compiled(logistic).run([-1.0], [1.0, 2.0], [0.01] * 200, kernel=kernel)
    finite = np.isfinite(x[:, 0])
    assert 109 < status < 130
    assert finite[:status].all()
    assert not finite[status]


def test_a_finite_run_returns_minus_one_and_leaves_the_last_state_in_its_first_argument(van_der_pol, compiled):
    module = compiled(van_der_pol).module
    x0, out = np.array([1.0, 0.0]), np.zeros((11, 2))
    zeros = np.zeros((11, 0))
    args = (zeros, np.array([1.0]), np.full(10, 0.1), np.ones(10, np.int32), np.zeros(11, np.uint8), zeros)
    assert module.run(x0, *args, out) == -1
    assert (x0 == out[-1]).all()


def test_a_jump_replaces_the_state_after_its_sample_is_stored(assorted, compiled):
    kernels = compiled(assorted)
    b, q, level = 0.8, 0.9, 0.7
    _, x, _ = kernels.run([1.0, 2.0, 3.0, 0.5], [b, q], [0.01] * 20, u=[[4.0]] * 21, jump={10: 2}, measured=level)
    a, h, m, w = x[10]
    jumped = [a * b, h * q + level, a * math.sqrt(m), w]
    _, fresh, _ = kernels.run(jumped, [b, q], [0.01] * 10, u=[[4.0]] * 11)
    np.testing.assert_allclose(x[11:], fresh[1:], rtol=10 * 20 * np.finfo(float).eps)


def test_linearise_gives_the_right_hand_side_and_its_jacobian(assorted, compiled):
    kernels = compiled(assorted)
    x = np.array([[-2.0, 4.0, 0.5, 0.9], [2.0, -1.0, 3.0, 1.5]])
    rates, jacobian = np.zeros((2, 4)), np.full((2, 4, 4), np.nan)
    load = np.tensordot([0.7, 0.4], kernels.basis, 1)
    kernels.module.linearise(
        x, np.array([[1.5], [1.5]]), np.array([0.8, 0.3]), kernels.breakpoints, load, rates, jacobian
    )
    exact = [[3.2, -0.6, 1.0, -0.63], [-3.2, 0.0, 0.0, -(0.7 + 0.4 * 0.25)]]
    diagonals = [[-2 * 0.8 * 2, -0.3 / 4, -1.0, -0.7], [-2 * 0.8 * 2, 0.0, 0.0, -0.4]]
    np.testing.assert_allclose(rates, exact, rtol=1e-14)
    np.testing.assert_allclose(jacobian, [np.diag(d) for d in diagonals], rtol=1e-14)


def test_at_a_breakpoint_the_segment_to_the_right_counts(assorted, compiled):
    kernels = compiled(assorted)
    rates, jacobian = np.zeros((3, 4)), np.zeros((3, 4, 4))
    x = np.array([[0.0, 0.0, 0.0, w] for w in (1.0, 2.0, 0.0)])  # the last one is found backwards
    args = (np.zeros((3, 1)), np.array([1.0, 1.0]), kernels.breakpoints, np.tensordot([0.5, 3.0], kernels.basis, 1))
    kernels.module.linearise(x, *args, rates, jacobian)
    assert (-rates[:, 3] == [0.5, 0.5 + 3.0, 0.0]).all()
    assert (-jacobian[:, 3, 3] == [0.0, 3.0 * 2.0, 0.5]).all()


def test_generated_names_never_meet_those_of_the_system():
    y, d_y, y_0, y__0, const_0, k, k_, lam = sp.symbols("y d_y y_0 y__0 const_0 k k_ lambda", real=True)
    rates = (k * y_0 + y__0, k_ * const_0 * lam)
    safe = apart(System("clash", (y, d_y), (), (y_0, y__0, const_0, k, k_, lam), (), rates), PYTHON_WORDS)
    names = {str(symbol) for symbol in (*safe.states, *safe.parameters)}
    assert len(names) == 8
    assert not names & (PYTHON_WORDS | {"const_0"})
    assert not any("__" in name for name in names)
    for state in map(str, safe.states):
        assert not names & {f"d_{state}", f"new_{state}"}
    assert safe.derivatives[1] == sp.prod(safe.parameters[i] for i in (2, 4, 5))


def test_a_system_without_conflicts_keeps_its_names(logistic):
    assert apart(logistic, PYTHON_WORDS) is logistic


def test_a_renamed_symbol_does_not_meet_what_the_code_makes_of_a_state():
    y, d__y = sp.symbols("y d__y", real=True)  # one underscore less would be the derivative of the state
    safe = apart(System("clash", (y,), (), (d__y,), (), (y * d__y,)), PYTHON_WORDS)
    assert [str(symbol) for symbol in (*safe.states, *safe.parameters)] == ["y", "d_y_"]


def test_no_two_kernels_define_the_same_function(assorted, compiled):
    # of two definitions the first that is loaded would serve both, so a result would depend on what ran before
    kernels = compiled(assorted)
    kernels.run([3.0, 0.2, 0.0, 2.0], [0.8, 0.9], [0.01], kernel="run_all")
    x, rates, jacobian = np.zeros((1, 4)), np.zeros((1, 4)), np.zeros((1, 4, 4))
    table = (kernels.breakpoints, np.tensordot([0.5, 3.0], kernels.basis, 1))
    kernels.module.linearise(x, np.zeros((1, 1)), np.array([1.0, 1.0]), *table, rates, jacobian)
    folder = Path(kernels.module.__file__).parent / "__pycache__"  # another process of the run may have compiled them
    objects = [path.read_bytes() for k in ("run_all", "linearise") for path in folder.glob(f"*.{k}-*.nbc")]
    first, other = (set(re.findall(rb"\w*step_jacobian[\w.$]*", code)) for code in objects)
    assert first
    assert other
    assert not first & other
