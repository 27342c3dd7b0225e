"""The model in CasADi and in JAX: one step of classical Runge-Kutta, as clutchid takes it, over all samples."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from peer import FloatArray, Result
from plain import Library, casadi_run, jax_rates, jax_run, linked
from problem import Problem


def casadi_function(problem: Problem, compiled: bool, columns: bool = True) -> Callable[[FloatArray], FloatArray]:
    """From values of `problem.names` to states at the samples, and behind them their sensitivities, by row.

    Columns are the samples from the second on; rows five states, then five derivatives for every name; without
    `columns` there are none. With `compiled` the whole run is C of CasADi.
    """
    import casadi as ca

    if compiled:
        return linked(casadi_library(problem, columns))
    whole, start, inputs = _casadi_run(problem, columns)
    arguments = ca.DM(start), ca.DM(inputs)
    return lambda point: whole(*arguments, ca.DM(point)).full()


def _casadi_run(problem: Problem, columns: bool) -> tuple[Any, FloatArray, FloatArray]:
    """The run over all samples as a function of CasADi, the states that it starts from, and the inputs by column."""
    steps, k, n = int(problem.drive.substeps[0]), len(problem.names), problem.time.size - 1
    columns = columns and k > 0
    whole = casadi_run(problem.model, "whole", n, 1 / problem.rate / steps, steps, columns)
    start = np.concatenate([problem.drive.x0, np.zeros(5 * k if columns else 0)])
    return whole, start, np.asfortranarray(problem.drive.u[:-1].T)


def casadi_library(problem: Problem, columns: bool = True) -> Library:
    """The run of `casadi_function` as CasADi's C, compiled as the limit is."""
    import casadi as ca

    whole, start, inputs = _casadi_run(problem, columns)
    folder = Path(tempfile.mkdtemp())
    maker = ca.CodeGenerator("whole.c")
    maker.add(whole)
    maker.generate(f"{folder}/")
    flags = ("-O3", "-march=native", "-ffast-math", "-fPIC")
    subprocess.run(["gcc", *flags, "-w", "-c", "whole.c"], cwd=folder, check=True)
    subprocess.run(["gcc", "-shared", "-o", "whole.so", "whole.o", "-lm"], cwd=folder, check=True)
    sizes = whole.sz_arg(), whole.sz_res(), whole.sz_iw(), whole.sz_w()
    return Library(str(folder / "whole.so"), sizes, start, inputs)


def jax_states(problem: Problem) -> Callable[[Any], Any]:
    """From values of `problem.names` to the states, shape (samples, 5), as a loop of JAX; not compiled yet."""
    steps = int(problem.drive.substeps[0])
    return jax_run(problem.model, problem.drive.x0, problem.drive.u, 1 / problem.rate / steps, steps)


def diffrax_states(problem: Problem, tolerance: float, forward: bool) -> Callable[[Any], Any]:
    """As `jax_states` by diffrax's Tsit5 with steps of its own, which end at every edge of an input."""
    import diffrax
    import jax.numpy as jnp

    f = jax_rates(problem.model)
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


def positions(values: FloatArray, names: int) -> Result:
    """Sensitivities of the position at all samples, shape (samples, names), from the rows of `casadi_function`."""
    return Result(np.vstack([np.zeros(names), values[5::5].T]))
