"""Part (a): one ballistic simulation of the actuator, five states."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import octave
from equations import python_text
from peer import FloatArray, Peer, Result, Row, compare
from plain import TOLERANCE, USUAL, scalar_rates, solve_ivp
from problem import Problem, own
from recorded import casadi_function, diffrax_states, jax_states

from clutchid import Log, simulate


def kernel(problem: Problem) -> Callable[[], Result]:
    """clutchid's compiled loop on arrays."""
    out = np.zeros((problem.time.size, 5))
    run = own.numba_run(problem.drive, out)
    return lambda: Result(out) if run() == -1 else Result(out * np.nan)


def public(problem: Problem) -> Callable[[], Result]:
    """`clutchid.simulate` on a log."""
    log = Log(problem.time, {"duty_supply": problem.drive.u[:, 0], "duty_exhaust": problem.drive.u[:, 1]})
    names = ("position", "velocity", "pressure_a", "pressure_b", "deflection")

    def run() -> Result:
        simulated = simulate(problem.actuator, log).log
        return Result(tuple(simulated[name] for name in names))

    return run


def c(problem: Problem) -> Callable[[], Result]:
    """The same expressions in C, compiled with all that gcc has."""
    out = np.zeros((problem.time.size, 5))
    run = own.c_run(problem.drive, out, Path(tempfile.mkdtemp()))
    return lambda: Result(out) if run() == -1 else Result(out * np.nan)


def scipy_peer(problem: Problem, method: str) -> Callable[[], Result]:
    """`solve_ivp` on a scalar right-hand side, started anew at every edge of an input."""
    solve = solve_ivp(scalar_rates(python_text(problem.values)), problem.table, method)
    return lambda: Result(problem.by_pieces(solve))


def sundae(problem: Problem) -> Callable[[], Result]:
    """SUNDIALS' CVODE by scikit-sundae on the same right-hand side."""
    from sksundae.cvode import CVODE

    rates, table = scalar_rates(python_text(problem.values)), problem.table

    def solve(time: FloatArray, x: FloatArray, u: FloatArray) -> FloatArray:
        u_vs, u_ve = map(float, u)

        def law(_: float, at: FloatArray, rate: FloatArray) -> None:
            rate[:] = rates(*at.tolist(), u_vs, u_ve, table)

        solver = CVODE(law, rtol=TOLERANCE, atol=TOLERANCE * 1e-2 * USUAL, max_num_steps=100_000)
        if time.size == 2:  # two instants ask for all steps
            return np.vstack([x, solver.solve(np.array([time[0], time.mean(), time[1]]), x).y[-1]])
        return solver.solve(time, x).y

    return lambda: Result(problem.by_pieces(solve))


def octave_peer(problem: Problem) -> Callable[[], Result]:
    """GNU Octave's `ode45`, in a process of its own that measures itself, so without its start."""
    folder = Path(tempfile.mkdtemp())
    octave.write_simulation(problem, folder)

    def run() -> Result:
        seconds = float(octave.printed(folder, "once.m").removeprefix("seconds "))
        return Result(np.fromfile(folder / "states").reshape(-1, 5), seconds)

    return run


def casadi_peer(problem: Problem, compiled: bool) -> Callable[[], Result]:
    """The same Runge-Kutta steps recorded by CasADi, in its virtual machine or as its own C."""
    run, none = casadi_function(problem, compiled), np.zeros(0)
    return lambda: Result(np.vstack([problem.drive.x0, run(none).T]))


def jax_peer(problem: Problem) -> Callable[[], Result]:
    """The same Runge-Kutta steps in a loop of JAX."""
    import jax

    run, none = jax.jit(jax_states(problem)), np.zeros(0)
    return lambda: Result(np.asarray(run(none)))


def diffrax_peer(problem: Problem) -> Callable[[], Result]:
    """diffrax's Tsit5."""
    import jax

    run, none = jax.jit(diffrax_states(problem, TOLERANCE, False)), np.zeros(0)
    return lambda: Result(np.asarray(run(none)))


PEERS = (
    Peer("clutchid, compiled loop", (), kernel),
    Peer("clutchid.simulate", (), public),
    Peer("C, gcc -O3 -march=native -ffast-math", ("gcc",), c),
    Peer("CasADi, Runge-Kutta, compiled", ("casadi", "gcc"), partial(casadi_peer, compiled=True), 10),
    Peer("CasADi, Runge-Kutta", ("casadi",), partial(casadi_peer, compiled=False), 10),
    Peer("JAX, Runge-Kutta in a scan", ("jax",), jax_peer, 10),
    Peer("diffrax, Tsit5", ("diffrax",), diffrax_peer, 1.5),
    Peer("scikit-sundae, CVODE", ("sksundae",), sundae, 1.5),
    Peer("SciPy, LSODA", ("scipy",), partial(scipy_peer, method="LSODA"), 1.5),
    Peer("SciPy, RK45", ("scipy",), partial(scipy_peer, method="RK45"), 1.5),
    Peer("SciPy, Radau", ("scipy",), partial(scipy_peer, method="Radau"), 1.5),
    Peer("Octave, ode45", ("octave-cli",), octave_peer, 1.5),
)

#: Lengths in s and rates in Hz.
CASES = ((1.5, 1000.0), (10.0, 1000.0), (600.0, 1000.0), (10.0, 100.0))


def error(problem: Problem, states: FloatArray | tuple[FloatArray, ...]) -> str:
    """Largest differences of position and pressure from the reference."""
    values = np.column_stack(states) if isinstance(states, tuple) else states
    off = np.abs(values - problem.reference).max(axis=0)
    return f"{off[0] * 1e6:.2g} µm, {off[2]:.2g} Pa"


def rows(
    cases: Sequence[tuple[float, float]] = CASES, peers: Sequence[Peer] = PEERS, rounds: int = 15, budget: float = 2.0
) -> list[Row]:
    """The rows of all cases; a slow peer runs once a rate, and stands scaled in the rows of longer recordings."""
    rows_of_rates: list[Row] = []
    measured: dict[tuple[str, float, float], Row] = {}
    for seconds, rate in cases:
        case = f"{seconds:g} s at {rate:g} Hz"
        length = {peer.name: min(seconds, peer.longest) for peer in peers}
        new = [peer for peer in peers if (peer.name, rate, length[peer.name]) not in measured]
        fresh = compare("a", case, new, lambda s, rate=rate: Problem(s, rate), seconds, error, rounds, budget)
        measured |= {(row.peer, rate, length[row.peer]): row for row in fresh if length[row.peer] == seconds}
        by_name = {row.peer: row for row in fresh}
        for peer in peers:
            row = by_name.get(peer.name)
            if row is None:
                row = scaled(measured[peer.name, rate, length[peer.name]], case, seconds / length[peer.name], fresh[0])
            rows_of_rates.append(row)
    return rows_of_rates


def scaled(row: Row, case: str, scale: float, first: Row) -> Row:
    """The row of a shorter case for a longer one; its ratio is that of medians."""
    if row.runs == 0:
        return row._replace(case=case)
    low, median, high = (value * scale for value in (row.low, row.median, row.high))
    ratio, note = median / first.median, f"scaled from {row.case}"
    return row._replace(case=case, low=low, median=median, high=high, ratio=ratio, note=note)


def largest_error(problem: Problem, states: FloatArray | tuple[FloatArray, ...]) -> float:
    """Largest difference of the position from the reference in m."""
    position = states[0] if isinstance(states, tuple) else states[:, 0]
    return float(np.abs(position - problem.reference[:, 0]).max())
