"""The kernels of the paper's model, from the shared cache: the same states, exact derivatives, jumps."""

import numpy as np
import pytest

from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.parameters import Parameters

N = 1001


def _drive():
    """One second: fill, hold, release, hold, and a short fill."""
    u = np.zeros((N, 2))
    u[10:120, 0], u[300:420, 1], u[600:680, 0] = 0.8, 0.6, 0.5
    return u


def _simulate(kernel, p, theta, jumps=None, columns=0):
    actuator = Actuator()
    jump, measured = np.zeros(N, np.uint8), np.full((N, 2), np.nan)
    for sample, (number, values) in (jumps or {}).items():
        jump[sample], measured[sample] = number, values
    out = np.zeros((N, 5))
    P_0 = Parameters.names().index("P_0")
    x0 = np.array([0.0, 0.0, p[P_0], p[P_0], 0.0])  # vented, Eq. (24)
    common = (_drive(), p, np.full(N - 1, 1e-3), np.ones(N - 1, np.int32), jump, measured)
    table = (actuator.load.breakpoints, actuator.load.combined(np.asarray(theta)))
    module = kernels("isothermal")
    if kernel == "run":
        return module.run(x0, *common, *table, out), out, None
    weights = np.arange(3)
    slots = module.SLOTS if kernel == "run_all" else ()
    fill = np.array([(i, row, 3 + column) for i, (row, column) in enumerate(slots)], np.int64).reshape(-1, 3).T
    S, sens = np.zeros((5, 3 + p.size)), np.zeros((N, 5, 3 + p.size))
    S[2:4, 3 + P_0] = 1.0  # at any other pressure the start would lie on the kink of the load at y = 0
    basis = np.ascontiguousarray(actuator.load.coefficients)
    rest = (basis, weights, weights, *(row.copy() for row in fill), np.arange(5), out, sens)
    return module.run_all(x0, S, *common, *table, *rest), out, sens


THETA = (9e5, -0.58e5, 0.39e5)
JUMPS = {250: (1, (0.008, np.nan)), 400: (2, (0.006, np.nan)), 700: (3, (0.003, 2.5e5)), 800: (4, (0.004, 3e5))}


@pytest.mark.parametrize("jumps", [None, JUMPS])
def test_the_three_kernels_compute_the_same_states_of_the_model(jumps):
    p = Parameters().array()
    (_, plain, _), (_, table, _), (_, full, _) = (
        _simulate(k, p, THETA, jumps) for k in ("run", "run_all, weights only", "run_all")
    )
    # They may group sums differently: 4 N stages of some 100 roundings; each is damped out, so the sum is a bound.
    scale = np.abs(plain).max(axis=0) * 4 * N * 100 * np.finfo(float).eps
    assert (np.abs(table - plain).max(axis=0) < scale).all()
    assert (np.abs(full - plain).max(axis=0) < scale).all()


@pytest.mark.parametrize("jumps", [None, JUMPS])
def test_every_derivative_of_the_model_is_that_of_the_computed_solution(jumps):
    p, theta = Parameters().array(), np.array(THETA)
    _, x, S = _simulate("run_all", p, theta, jumps)
    values = np.concatenate([theta, p])
    step = 1e-6
    worst = {}
    for column, name in enumerate(("theta_1", "theta_2", "theta_3", *Parameters.names())):
        ends = []
        for sign in (1, -1):
            moved = values.copy()
            moved[column] *= 1 + sign * step
            ends.append(_simulate("run", moved[3:], moved[:3], jumps)[1])
        difference = (ends[0] - ends[1]) / (2 * step)  # to the logarithm of the parameter: in units of the state
        error = np.abs(S[:, :, column] * values[column] - difference).max(axis=0)
        worst[name] = (error / np.maximum(np.abs(difference).max(axis=0), 1e-3 * np.abs(x).max(axis=0))).max()
    # Central differences: runs differ by 1e-12 of a state through rounding, over the step 1e-6; a derivative may be
    # 1e-3 of its state. Where a parameter moves the instant at which a branch changes, the step itself is the error.
    assert max(worst.values()) < 1e-12 / step / 1e-3, worst


#: Numbers of the variants beyond the paper: they come after the paper's and the end stops'.
BEYOND = set(Parameters.names()[Parameters.names().index("d_stop") + 1 :])


def test_every_parameter_but_those_of_the_stops_moves_a_run_between_them():
    p = Parameters().array()
    _, x, S = _simulate("run_all", p, THETA)
    moved = np.abs(S[:, :, 3:] * p).max(axis=0) / np.abs(x).max(axis=0)[:, None]
    names = {name for name, most in zip(Parameters.names(), moved.max(axis=0), strict=True) if most > 1e-16}
    # The piston meets a stop by no more than the rounding of a position at rest, some 1e-19 m; everything else of the
    # paper moves the run.
    assert names == set(Parameters.names()) - {"K_stop", "D_stop", "d_stop"} - BEYOND
