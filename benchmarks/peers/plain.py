"""What peers run of the model without clutchid, so that a process of their own need not import it."""

from __future__ import annotations

import ctypes
import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

STATES = ("y", "v", "p_A", "p_B", "z")
WEIGHTS = ("theta_1", "theta_2", "theta_3")

#: Natural sizes of the states: 10 mm, 0.1 m/s, 1 bar, 1 bar, 0.1 mm.
USUAL = np.array([1e-2, 1e-1, 1e5, 1e5, 1e-4])

#: Relative tolerance of all solvers with steps of their own, and a hundredth of it of the usual size of a state.
TOLERANCE = 1e-6

#: Below 0 only in an arm that is not taken; a peer that computes all arms needs a root, and its derivative, there too.
SMALLEST = 1e-12

#: Weights are searched in these units, N/m, with such differences where a peer has no derivatives: 1 kN/m moves the
#: piston by 15 µm, a thousand times what a solver's steps do.
UNIT, STEP = 1e5, 1e-2


def scalar_rates(text: str) -> Callable[..., tuple[float, ...]]:
    """``rates(y, v, p_A, p_B, z, u_vs, u_ve, table)`` from the text of `equations.python_text`."""
    # a solver tries steps that end below vacuum, before it rejects them
    guarded = SimpleNamespace(sqrt=lambda x: math.sqrt(x) if x > 0.0 else 0.0)
    names: dict[str, Any] = {"math": guarded, "lookup": lookup}
    exec(compile(text, "the model in Python", "exec"), names)
    function: Callable[..., tuple[float, ...]] = names["rates"]
    return function


def lookup(y: float, table: tuple[list[float], list[list[float]]]) -> float:
    """A piecewise cubic at y: breakpoints and coefficients as lists, which scalar Python reads fastest."""
    segment = bisect_right(table[0], y)
    d, c = y - table[0][max(segment - 1, 0)], table[1][segment]
    return ((c[3] * d + c[2]) * d + c[1]) * d + c[0]


class Operations(NamedTuple):
    """What a peer that records expressions has for a root, the larger of two, and a choice."""

    sqrt: Callable[[Any], Any]
    larger: Callable[[Any, Any], Any]
    where: Callable[[Any, Any, Any], Any]


class Model(NamedTuple):
    """The model as a peer gets it that records expressions.

    `text` is that of `equations.chosen_text` with `names` free, `values` are those of the load weights that are not,
    and `basis` are the basis functions of the load over `breakpoints`, shape (weights, segments, 4).
    """

    text: str
    names: tuple[str, ...]
    values: Mapping[str, float]
    breakpoints: FloatArray
    basis: FloatArray

    def rates(self, operations: Operations) -> Callable[[Any, Any, Any], list[Any]]:
        """``rates(x, u, q)`` of states, inputs and the values q of `names`, in the peer's own expressions."""
        defined: dict[str, Any] = {}
        exec(compile(self.text, "the model without branches", "exec"), defined)
        rates = defined["rates"]

        def root(x: Any) -> Any:
            return operations.sqrt(operations.larger(x, SMALLEST))

        def function(x: Sequence[Any], u: Sequence[Any], q: Sequence[Any]) -> list[Any]:
            free = dict(zip(self.names, q, strict=True))
            weights = [free.pop(name) if name in free else self.values[name] for name in WEIGHTS]

            def load(y: Any) -> Any:
                return load_expression(y, weights, self.breakpoints, self.basis, operations.where)

            return list(rates(operations.where, root, load, *x, *u, **free))

        return function


def load_expression(
    y: Any, weights: Sequence[Any], breakpoints: Sequence[float], basis: Any, where: Callable[[Any, Any, Any], Any]
) -> Any:
    """The load of `weights` over y, a choice of cubics; `basis` has shape (weights, segments, 4)."""
    segments, powers = range(basis.shape[1]), range(4)
    combined = [
        [sum(w * float(b[s, k]) for w, b in zip(weights, basis, strict=True)) for k in powers] for s in segments
    ]
    value = None
    for s, c in enumerate(combined):
        d = y - float(breakpoints[max(s - 1, 0)])
        piece = ((c[3] * d + c[2]) * d + c[1]) * d + c[0]
        value = piece if value is None else where(y >= float(breakpoints[s - 1]), piece, value)
    return value


def runge_kutta(f: Callable[[Any], Any], x: Any, h: float) -> Any:
    """One classical step of length h."""
    k_1 = f(x)
    k_2 = f(x + h / 2 * k_1)
    k_3 = f(x + h / 2 * k_2)
    k_4 = f(x + h * k_3)
    return x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)


def by_pieces(
    solve: Callable[[FloatArray, FloatArray, FloatArray], FloatArray],
    time: FloatArray,
    u: FloatArray,
    x0: FloatArray,
    edges: Sequence[int],
) -> FloatArray:
    """States at the samples from ``solve(time, x, u)``, started anew at every edge of an input.

    That is the best a solver with steps of its own can be given: no input changes within one of its steps.
    """
    states = np.empty((time.size, 5))
    states[0] = x0
    for a, b in pairwise(edges):
        states[a : b + 1] = solve(time[a : b + 1], states[a], u[a])
    return states


def solve_ivp(
    rates: Callable[..., tuple[float, ...]], table: tuple[list[float], list[list[float]]], method: str
) -> Callable[[FloatArray, FloatArray, FloatArray], FloatArray]:
    """SciPy's `solve_ivp` on a scalar right-hand side, for `by_pieces`."""
    from scipy import integrate

    def solve(time: FloatArray, x: FloatArray, u: FloatArray) -> FloatArray:
        u_vs, u_ve = map(float, u)
        solved = integrate.solve_ivp(
            lambda _, at: rates(*at.tolist(), u_vs, u_ve, table), (time[0], time[-1]), x, method, time,
            rtol=TOLERANCE, atol=TOLERANCE * 1e-2 * USUAL,
        )  # fmt: skip
        return solved.y.T

    return solve


class Recording(NamedTuple):
    """What a simulation of a recording is given: the load as basis functions, instants, inputs, start, and edges."""

    breakpoints: FloatArray
    basis: FloatArray
    time: FloatArray
    u: FloatArray
    x0: FloatArray
    edges: Sequence[int]


def scipy_position(text: str, recording: Recording, method: str) -> Callable[[FloatArray], FloatArray]:
    """The position over load weights by `solve_ivp`, from the text of `equations.python_text`."""
    rates = scalar_rates(text)

    def position(theta: FloatArray) -> FloatArray:
        table = recording.breakpoints.tolist(), np.tensordot(theta, recording.basis, 1).tolist()
        return by_pieces(solve_ivp(rates, table, method), recording.time, recording.u, recording.x0, recording.edges)[
            :, 0
        ]

    return position


def casadi_rates(model: Model) -> tuple[Any, Any, Any, Any]:
    """Symbols x, u, q and the rates of x, as CasADi's SX."""
    import casadi as ca

    x, u, q = ca.SX.sym("x", 5), ca.SX.sym("u", 2), ca.SX.sym("q", len(model.names))
    law = model.rates(Operations(ca.sqrt, ca.fmax, ca.if_else))
    return x, u, q, ca.vertcat(*law(ca.vertsplit(x), ca.vertsplit(u), ca.vertsplit(q) if model.names else []))


def casadi_run(model: Model, name: str, n: int, h: float, steps: int, columns: bool) -> Any:
    """A function of CasADi of start (states, columns), inputs (2, n) and values of the free names, in that order.

    It gives states after each of n samples of `steps` steps of length h, and behind them their sensitivities, which are
    those of a step, symbolic, carried along with the states; none without `columns`.
    """
    import casadi as ca

    x, u, q, rate = casadi_rates(model)
    f = ca.Function("f", [x, u, q], [rate])
    k = len(model.names)
    after = runge_kutta(lambda at: f(at, u, q), x, h)
    if columns:
        S = ca.SX.sym("S", 5, k)
        moved = ca.jacobian(after, x) @ S + ca.jacobian(after, q)
        all_x, all_after = ca.vertcat(x, ca.vec(S)), ca.vertcat(after, ca.vec(moved))
    else:
        all_x, all_after = x, after
    step = ca.Function("one", [all_x, u, q], [all_after], {"cse": True})
    held = step if steps == 1 else _repeated(step, steps)
    X0, U, Q = ca.MX.sym("X0", all_x.numel()), ca.MX.sym("U", 2, n), ca.MX.sym("Q", k)
    return ca.Function(name, [X0, U, Q], [held.mapaccum("samples", n)(X0, U, ca.repmat(Q, 1, n))])


def _repeated(step: Any, steps: int) -> Any:
    """`steps` steps with the same inputs as a function."""
    import casadi as ca

    x, u, q = (ca.MX.sym(name, step.size1_in(i)) for i, name in enumerate("xuq"))
    end = x
    for _ in range(steps):
        end = step(end, u, q)
    return ca.Function("held", [x, u, q], [end])


def jax_rates(model: Model) -> Callable[[Any, Any, Any], Any]:
    """``rates(x, u, q)`` on arrays of JAX, in double precision."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    law = model.rates(Operations(jnp.sqrt, jnp.maximum, jnp.where))
    return lambda x, u, q: jnp.stack(law(x, u, q))


def jax_run(model: Model, x0: FloatArray, inputs: FloatArray, h: float, steps: int) -> Callable[[Any], Any]:
    """From values of the free names to the states, shape (samples, 5), as a loop of JAX; not compiled yet."""
    import jax
    import jax.numpy as jnp

    f = jax_rates(model)
    first, u = jnp.asarray(x0), jnp.asarray(inputs[:-1])

    def states(q: Any) -> Any:
        def sample(x: Any, now: Any) -> tuple[Any, Any]:
            for _ in range(steps):
                x = runge_kutta(lambda at: f(at, now, q), x, h)
            return x, x

        return jnp.vstack([first, jax.lax.scan(sample, first, u)[1]])

    return states


def searched(
    noise: float,
    position: Callable[[FloatArray], FloatArray],
    jacobian: Callable[[FloatArray], FloatArray] | None = None,
) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """SciPy's `least_squares` on position and its Jacobian, which take weights in N/m; without one on differences.

    It takes the measured position with white `noise` in m, and weights to start from.
    """
    from scipy.optimize import least_squares

    def slopes(theta: FloatArray) -> FloatArray:
        if jacobian is not None:
            return jacobian(theta)
        at, step = position(theta), STEP * UNIT
        return np.column_stack([(position(theta + step * unit) - at) / step for unit in np.eye(3)])

    def estimate(measured: FloatArray, start: FloatArray) -> FloatArray:
        def residuals(x: FloatArray) -> FloatArray:
            return (position(x * UNIT) - measured) / noise

        def scaled(x: FloatArray) -> FloatArray:
            return slopes(x * UNIT) * UNIT / noise

        bounds = ([0.0, -np.inf, 0.0], np.inf)
        weights: FloatArray = UNIT * least_squares(residuals, start / UNIT, scaled, bounds, x_scale=[1, 0.1, 0.1]).x
        return weights

    return estimate


class Library(NamedTuple):
    """A run over all samples as compiled C of CasADi: the file, its sizes, and what it starts from."""

    path: str
    sizes: tuple[int, int, int, int]
    start: FloatArray
    inputs: FloatArray


def linked(library: Library) -> Callable[[FloatArray], FloatArray]:
    """The run as a function of the free values, called with our own arrays, without conversions."""
    whole = ctypes.CDLL(library.path).whole
    start, inputs = library.start, np.asfortranarray(library.inputs)
    arguments, results = (ctypes.c_void_p * library.sizes[0])(), (ctypes.c_void_p * library.sizes[1])()
    whole_iw, whole_w = np.zeros(max(library.sizes[2], 1), np.int64), np.zeros(max(library.sizes[3], 1))
    out = np.zeros((start.size, inputs.shape[1]), order="F")

    def run(point: FloatArray) -> FloatArray:
        q = np.ascontiguousarray(point, float)
        arguments[0], arguments[1], arguments[2] = start.ctypes.data, inputs.ctypes.data, q.ctypes.data
        results[0] = out.ctypes.data
        failed = whole(
            arguments, results, ctypes.c_void_p(whole_iw.ctypes.data), ctypes.c_void_p(whole_w.ctypes.data), 0
        )
        if failed:
            raise RuntimeError(f"CasADi's C returned {failed}.")
        return out

    return run


def casadi_search(
    noise: float, with_columns: Library, without: Library
) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """`searched` on CasADi's compiled Runge-Kutta; residuals take a function without derivatives."""
    run, plain, zero = linked(with_columns), linked(without), without.start[0]

    def position(theta: FloatArray) -> FloatArray:
        return np.concatenate([[zero], plain(theta)[0]])

    def jacobian(theta: FloatArray) -> FloatArray:
        return np.vstack([np.zeros(3), run(theta)[5::5].T])

    return searched(noise, position, jacobian)
