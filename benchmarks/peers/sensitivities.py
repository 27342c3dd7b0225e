"""Part (b): one simulation with derivatives of the position to 3, 7 and 15 parameters.

Run alone, it says where the derivatives of steps of 1 ms differ from those of finer steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from equations import python_text
from peer import FloatArray, Peer, Result, Row, compare
from plain import TOLERANCE, USUAL, WEIGHTS, casadi_rates, scipy_position
from problem import FIFTEEN, SEVEN, Problem, own, sensitivities
from recorded import casadi_function, diffrax_states, jax_states, positions

#: The run without derivatives, which stands in the table for its time alone.
ONE_RUN = "clutchid, without derivatives"


def clutchid(problem: Problem) -> Callable[[], Result]:
    """clutchid's compiled loop with columns."""
    run = sensitivities(problem, problem.drive)
    return lambda: Result(run())


def one_run(problem: Problem) -> Callable[[], Result]:
    """clutchid's compiled loop without columns; its value has no derivatives."""
    out = np.zeros((problem.time.size, 5))
    run = own.numba_run(problem.drive, out)
    return lambda: Result(out[:, :0]) if run() == -1 else Result(out * np.nan)


def casadi_peer(problem: Problem, compiled: bool) -> Callable[[], Result]:
    """Symbolic derivatives of every Runge-Kutta step, carried along."""
    run, point = casadi_function(problem, compiled), problem.point
    return lambda: positions(run(point), point.size)


def cvodes(problem: Problem, checked: bool) -> Callable[[], Result]:
    """CasADi's CVODES with its forward sensitivities; with `checked` (`quad_err_con`) these count in the error test."""
    import casadi as ca

    x, u, q, rate = casadi_rates(problem.model)
    usual, point, d = ca.DM(USUAL), problem.point, problem.drive
    inputs = ca.vertcat(u, q)
    ode = ca.substitute(rate, x, x * usual) / usual
    options = {"reltol": TOLERANCE, "abstol": TOLERANCE * 1e-2, "quad_err_con": checked, "max_num_steps": 100_000}
    k, pieces = point.size, []
    for a, b in zip(problem.edges, problem.edges[1:], strict=False):
        grid = [float(t) for t in problem.time[a + 1 : b + 1] - problem.time[a]]
        solver = ca.integrator("solver", "cvodes", {"x": x, "p": inputs, "ode": ode}, 0.0, grid, options)
        X, U, Q, S = ca.MX.sym("X", 5), ca.MX.sym("U", 2), ca.MX.sym("Q", k), ca.MX.sym("S", 5, k)
        ends = ca.vec(solver(x0=X, p=ca.vertcat(U, Q))["xf"])
        moved = _directions(ends, X, Q, S, k)
        pieces.append((a, b, ca.Function("piece", [X, U, Q, S], [ends, moved])))

    def run() -> Result:
        derivatives = np.zeros((problem.time.size, k))
        state, columns = d.x0 / USUAL, np.zeros((5, k))
        for a, b, piece in pieces:
            ends, moved = (part.full() for part in piece(state, d.u[a], point, columns))
            derivatives[a + 1 : b + 1] = moved[::5] * USUAL[0]
            state, columns = ends[-5:, 0], moved[-5:]
        return Result(derivatives)

    return run


def _directions(ends: Any, X: Any, Q: Any, S: Any, k: int) -> Any:
    """Derivatives of `ends` along the columns of S, together with those to Q."""
    import casadi as ca

    return ca.horzcat(*(ca.jtimes(ends, X, S[:, c]) + ca.jtimes(ends, Q, ca.DM.eye(k)[:, c]) for c in range(k)))


def jax_peer(problem: Problem) -> Callable[[], Result]:
    """Forward derivatives of the loop in JAX."""
    import jax

    states = jax_states(problem)
    run, point = jax.jit(jax.jacfwd(lambda q: states(q)[:, 0])), problem.point
    return lambda: Result(np.asarray(run(point)))


def diffrax_peer(problem: Problem) -> Callable[[], Result]:
    """Forward derivatives of diffrax's Tsit5."""
    import jax

    states = diffrax_states(problem, TOLERANCE, True)
    run, point = jax.jit(jax.jacfwd(lambda q: states(q)[:, 0])), problem.point
    return lambda: Result(np.asarray(run(point)))


def finite_differences(problem: Problem, step: float | None) -> Callable[[], Result]:
    """Those of `least_squares` on `solve_ivp` LSODA; `step` is its `diff_step`, None its default of 1.5e-8."""
    from scipy.optimize import least_squares

    point, position = problem.point, scipy_position(python_text(problem.values), problem.given, "LSODA")

    def run() -> Result:
        return Result(
            least_squares(lambda scale: position(scale * point), np.ones(point.size), diff_step=step, max_nfev=1).jac
            / point
        )

    return run


PEERS = (
    Peer("clutchid, compiled loop", (), clutchid),
    Peer(ONE_RUN, (), one_run),
    Peer("CasADi, Runge-Kutta, compiled", ("casadi", "gcc"), partial(casadi_peer, compiled=True)),
    Peer("CasADi, Runge-Kutta", ("casadi",), partial(casadi_peer, compiled=False)),
    Peer("CasADi, CVODES, quad_err_con", ("casadi",), partial(cvodes, checked=True), 1.5),
    Peer("CasADi, CVODES", ("casadi",), partial(cvodes, checked=False), 1.5),
    Peer("JAX, Runge-Kutta in a scan", ("jax",), jax_peer),
    Peer("diffrax, Tsit5", ("diffrax",), diffrax_peer, 1.5),
    Peer("SciPy, LSODA, differences of 1e-4", ("scipy",), partial(finite_differences, step=1e-4), 1.5),
    Peer("SciPy, LSODA, differences by default", ("scipy",), partial(finite_differences, step=None), 1.5),
)


def error(problem: Problem, values: FloatArray | tuple[FloatArray, ...]) -> str:
    """Worst column against the reference: rms over the column's rms, and largest difference over its largest entry."""
    jacobian, tight = np.asarray(values), problem.reference_jacobian
    if jacobian.shape[1] == 0:
        return ""
    off = jacobian - tight
    rms = (np.sqrt((off**2).mean(axis=0)) / np.sqrt((tight**2).mean(axis=0))).max()
    largest = (np.abs(off).max(axis=0) / np.abs(tight).max(axis=0)).max()
    return f"{rms * 100:.2g} % rms, {largest * 100:.2g} % at worst"


def rows(seconds: float = 10.0, peers: Sequence[Peer] = PEERS, rounds: int = 15, budget: float = 2.0) -> list[Row]:
    """The rows for 3, 7 and 15 parameters; solvers that need seconds for a run are asked for three only."""
    rows_of_peers = []
    for names in (WEIGHTS, SEVEN, FIFTEEN):
        case = f"{len(names)} parameters, {seconds:g} s at 1000 Hz"
        chosen = [peer for peer in peers if len(names) == 3 or peer.longest > 1.5]
        posed = partial(Problem, names=names)
        rows_of_peers += compare("b", case, chosen, posed, seconds, error, rounds, budget)
    return rows_of_peers


def where(problem: Problem, beyond: float = 0.02) -> str:
    """Where the derivatives differ by more than `beyond` of the largest entry of their column, and by how much."""
    tight, position = problem.reference_jacobian, problem.reference[:, 0]
    off = np.abs(np.asarray(clutchid(problem)().value) - tight) / np.abs(tight).max(axis=0)
    worst = off.max(axis=1)
    far = np.flatnonzero(worst > beyond)
    events = 1 + int((np.diff(far) > 20).sum())
    places = f"{events} places at {position[far].min() * 1e3:.1f} to {position[far].max() * 1e3:.1f} mm"
    share = f"{far.size} of {worst.size} samples beyond {beyond * 100:g} %"
    return f"{tight.shape[1]} parameters: median {np.median(worst) * 100:.2g} %; {share}, in {places}"


if __name__ == "__main__":
    for names in (WEIGHTS, SEVEN, FIFTEEN):
        print(where(Problem(10.0, names=names)))
