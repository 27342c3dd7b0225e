"""The model in CasADi and in JAX: one step of classical Runge-Kutta, as clutchid takes it, over all samples."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from equations import STATES, Compiled, Operations, equations, load_expression
from peer import FloatArray, Result
from problem import WEIGHTS, Problem


def rates(problem: Problem, operations: Operations) -> Callable[[Any, Any, Any], list[Any]]:
    """``rates(x, u, q)`` of states, inputs and the values q of `problem.names`, in the peer's own expressions."""
    model = Compiled(equations(problem.values, problem.names), operations)
    load = problem.actuator.load

    def function(x: Sequence[Any], u: Sequence[Any], q: Sequence[Any]) -> list[Any]:
        free = dict(zip(problem.names, q, strict=True))
        weights = [free.get(name, problem.actuator.value(name)) for name in WEIGHTS]
        known = dict(zip((*STATES, "u_vs", "u_ve"), (*x, *u), strict=True)) | free
        return model(
            known, lambda y: load_expression(y, weights, load.breakpoints, load.coefficients, operations.where)
        )

    return function


def runge_kutta(f: Callable[[Any], Any], x: Any, h: float) -> Any:
    """One classical step of length h."""
    k_1 = f(x)
    k_2 = f(x + h / 2 * k_1)
    k_3 = f(x + h / 2 * k_2)
    k_4 = f(x + h * k_3)
    return x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)


def casadi_rates(problem: Problem) -> tuple[Any, Any, Any, Any]:
    """Symbols x, u, q in natural units of the states and the rates of x, as CasADi's SX."""
    import casadi as ca

    x, u, q = ca.SX.sym("x", 5), ca.SX.sym("u", 2), ca.SX.sym("q", len(problem.names))
    law = rates(problem, Operations(ca.sqrt, ca.fmax, ca.if_else))
    return x, u, q, ca.vertcat(*law(ca.vertsplit(x), ca.vertsplit(u), ca.vertsplit(q) if problem.names else []))


def casadi_function(problem: Problem, compiled: bool, columns: bool = True) -> Callable[[FloatArray], FloatArray]:
    """From values of `problem.names` to states at the samples, and behind them their sensitivities, by row.

    Columns are the samples from the second on; rows five states, then five derivatives for every name. The derivatives
    are those of a step, symbolic, carried along with the states; without `columns` there are none. With `compiled` the
    whole run is C of CasADi.
    """
    import casadi as ca

    x, u, q, rate = casadi_rates(problem)
    f = ca.Function("f", [x, u, q], [rate])
    steps, k = int(problem.drive.substeps[0]), len(problem.names)
    h = 1 / problem.rate / steps
    after = runge_kutta(lambda at: f(at, u, q), x, h)
    columns = columns and k > 0
    if columns:
        S = ca.SX.sym("S", 5, k)
        moved = ca.jacobian(after, x) @ S + ca.jacobian(after, q)
        all_x, all_after = ca.vertcat(x, ca.vec(S)), ca.vertcat(after, ca.vec(moved))
    else:
        all_x, all_after = x, after
    one = ca.Function("one", [all_x, u, q], [all_after], {"cse": True})
    held = one if steps == 1 else _repeated(one, steps)
    n = problem.time.size - 1
    X0, U, Q = ca.MX.sym("X0", all_x.numel()), ca.MX.sym("U", 2, n), ca.MX.sym("Q", k)
    whole = ca.Function("whole", [X0, U, Q], [held.mapaccum("samples", n)(X0, U, ca.repmat(Q, 1, n))])
    start = np.concatenate([problem.drive.x0, np.zeros(all_x.numel() - 5)])
    inputs = np.asfortranarray(problem.drive.u[:-1].T)
    if compiled:
        return _linked(whole, start, inputs, n)
    given = ca.DM(start), ca.DM(inputs)
    return lambda point: whole(*given, ca.DM(point)).full()


def _repeated(one: Any, steps: int) -> Any:
    """`steps` steps with the same inputs as a function."""
    import casadi as ca

    x, u, q = (ca.MX.sym(name, one.size1_in(i)) for i, name in enumerate("xuq"))
    end = x
    for _ in range(steps):
        end = one(end, u, q)
    return ca.Function("held", [x, u, q], [end])


def _linked(whole: Any, start: FloatArray, inputs: FloatArray, n: int) -> Callable[[FloatArray], FloatArray]:
    """CasADi's C of a function, compiled as the limit is and called with our own arrays, without conversions."""
    import casadi as ca

    folder = Path(tempfile.mkdtemp())
    maker = ca.CodeGenerator("whole.c")
    maker.add(whole)
    maker.generate(f"{folder}/")
    flags = ("-O3", "-march=native", "-ffast-math", "-fPIC")
    subprocess.run(["gcc", *flags, "-w", "-c", "whole.c"], cwd=folder, check=True)
    subprocess.run(["gcc", "-shared", "-o", "whole.so", "whole.o", "-lm"], cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "whole.so"))
    sizes = [whole.sz_arg(), whole.sz_res(), whole.sz_iw(), whole.sz_w()]
    arguments, results = (ctypes.c_void_p * sizes[0])(), (ctypes.c_void_p * sizes[1])()
    whole_iw, whole_w = np.zeros(max(sizes[2], 1), np.int64), np.zeros(max(sizes[3], 1))
    out = np.zeros((start.size, n), order="F")

    def run(point: FloatArray) -> FloatArray:
        q = np.ascontiguousarray(point, float)
        arguments[0], arguments[1], arguments[2] = start.ctypes.data, inputs.ctypes.data, q.ctypes.data
        results[0] = out.ctypes.data
        failed = library.whole(
            arguments, results, ctypes.c_void_p(whole_iw.ctypes.data), ctypes.c_void_p(whole_w.ctypes.data), 0
        )
        if failed:
            raise RuntimeError(f"CasADi's C returned {failed}.")
        return out

    return run


def jax_states(problem: Problem) -> Callable[[Any], Any]:
    """From values of `problem.names` to the states, shape (samples, 5), as a loop of JAX; not compiled yet."""
    import jax
    import jax.numpy as jnp

    f, u = jax_rates(problem), jnp.asarray(problem.drive.u[:-1])
    steps = int(problem.drive.substeps[0])
    h, x0 = 1 / problem.rate / steps, jnp.asarray(problem.drive.x0)

    def states(q: Any) -> Any:
        def sample(x: Any, now: Any) -> tuple[Any, Any]:
            for _ in range(steps):
                x = runge_kutta(lambda at: f(at, now, q), x, h)
            return x, x

        return jnp.vstack([x0, jax.lax.scan(sample, x0, u)[1]])

    return states


def jax_rates(problem: Problem) -> Callable[[Any, Any, Any], Any]:
    """``rates(x, u, q)`` on arrays of JAX, in double precision."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    law = rates(problem, Operations(jnp.sqrt, jnp.maximum, jnp.where))
    return lambda x, u, q: jnp.stack(law(x, u, q))


def diffrax_states(problem: Problem, tolerance: float, forward: bool) -> Callable[[Any], Any]:
    """As `jax_states` by diffrax's Tsit5 with steps of its own, which end at every edge of an input."""
    import diffrax
    import jax.numpy as jnp

    f = jax_rates(problem)
    at, u = jnp.asarray(problem.time[problem.edges]), jnp.asarray(problem.drive.u[problem.edges])
    usual = jnp.asarray([1e-2, 1e-1, 1e5, 1e5, 1e-4])

    def scaled(t: Any, x: Any, q: Any) -> Any:
        now = u[jnp.clip(jnp.searchsorted(at, t, side="right") - 1, 0, None)]
        return f(x * usual, now, q) / usual

    control = diffrax.ClipStepSizeController(diffrax.PIDController(rtol=tolerance, atol=tolerance * 1e-2), jump_ts=at)

    def states(q: Any) -> Any:
        solved = diffrax.diffeqsolve(
            diffrax.ODETerm(scaled), diffrax.Tsit5(), problem.time[0], problem.time[-1], 1e-4,
            jnp.asarray(problem.drive.x0) / usual, q, saveat=diffrax.SaveAt(ts=jnp.asarray(problem.time)),
            stepsize_controller=control, max_steps=None if forward else 1_000_000,
            adjoint=diffrax.ForwardMode() if forward else diffrax.RecursiveCheckpointAdjoint(),
        )  # fmt: skip
        return solved.ys * usual

    return states


def positions(found: FloatArray, names: int) -> Result:
    """Sensitivities of the position at all samples, shape (samples, names), from the rows of `casadi_function`."""
    return Result(np.vstack([np.zeros(names), found[5::5].T]))
