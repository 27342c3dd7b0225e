"""Part (h): many simulations that differ in their load weights, ballistic, five states, 1 s at 1 kHz."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from peer import FloatArray, Peer, Result, Row, compare
from plain import WEIGHTS, linked
from problem import Problem, own
from recorded import casadi_library, jax_states

from clutchid import Actuator, Log, simulate, simulate_many

#: Simulations at once, those whose error is shown, and the row of C.
COUNT, SHOWN, IN_C = 10_000, 8, "C, gcc -O3 -march=native -ffast-math, one thread"


@dataclass(frozen=True)
class Batch:
    """So many simulations of one recording, whose load weights are drawn within 20 % of the paper's."""

    count: int

    @cached_property
    def problem(self) -> Problem:
        """The simulation of the first."""
        return Problem(1.0, names=WEIGHTS)

    @cached_property
    def points(self) -> FloatArray:
        """Load weights, shape (count, 3)."""
        return self.problem.point * np.random.default_rng(1).uniform(0.8, 1.2, (self.count, 3))

    @cached_property
    def actuators(self) -> list[Actuator]:
        """The actuators."""
        return [self.problem.at(point).actuator for point in self.points]

    @cached_property
    def log(self) -> Log:
        """The recording."""
        u = self.problem.drive.u
        return Log(self.problem.time, {"duty_supply": u[:, 0], "duty_exhaust": u[:, 1]})


def many(batch: Batch) -> Callable[[], Result]:
    """`clutchid.simulate_many`."""
    return lambda: Result(simulate_many(batch.actuators, batch.log).column("position"))


def one_by_one(batch: Batch) -> Callable[[], Result]:
    """`clutchid.simulate` in a loop."""
    return lambda: Result(np.array([simulate(a, batch.log).log["position"] for a in batch.actuators]))


def c(batch: Batch) -> Callable[[], Result]:
    """The same expressions in C, compiled with all that gcc has, in a loop on one thread."""
    drive = batch.problem.drive
    out, positions = np.zeros((drive.u.shape[0], 5)), np.zeros((batch.count, drive.u.shape[0]))
    run, loads = own.c_run(drive, out, Path(tempfile.mkdtemp())), [a.load.combined() for a in batch.actuators]

    def all_of_them() -> Result:
        for position, load in zip(positions, loads, strict=True):
            drive.load[:] = load
            position[:] = out[:, 0] if run() == -1 else np.nan
        return Result(positions)

    return all_of_them


def casadi_loop(batch: Batch) -> Callable[[], Result]:
    """CasADi's compiled run in a loop on one thread."""
    run, positions = (
        linked(casadi_library(batch.problem, columns=False)),
        np.zeros((batch.count, batch.problem.time.size)),
    )

    def all_of_them() -> Result:
        for position, point in zip(positions, batch.points, strict=True):
            position[1:] = run(point)[0]
        return Result(positions)

    return all_of_them


def casadi_map(batch: Batch) -> Callable[[], Result]:
    """CasADi's compiled run by its `map`, on a thread a processor."""
    import casadi as ca

    library = casadi_library(batch.problem, columns=False)
    whole = ca.external("whole", library.path)
    mapped = whole.map("many", "thread", batch.count, [0, 1], [], {"max_num_threads": os.cpu_count()})
    fixed, points = (ca.DM(library.start), ca.DM(library.inputs)), ca.DM(batch.points.T)

    def all_of_them() -> Result:
        states = mapped(*fixed, points).toarray()
        later = states[0].reshape(batch.count, -1)
        return Result(np.column_stack([np.zeros(batch.count), later]))

    return all_of_them


def jax_vmap(batch: Batch) -> Callable[[], Result]:
    """JAX's `vmap` of the scan."""
    import jax

    states = jax_states(batch.problem)
    run = jax.jit(jax.vmap(lambda point: states(point)[:, 0]))
    return lambda: Result(np.asarray(run(batch.points)))


PEERS = (
    Peer("clutchid.simulate_many", (), many),
    Peer("clutchid.simulate, one by one", (), one_by_one, 500),
    Peer(IN_C, ("gcc",), c),
    Peer("CasADi, compiled, one by one", ("casadi", "gcc"), casadi_loop, 1000),
    Peer("CasADi, compiled, map on threads", ("casadi", "gcc"), casadi_map, 1000),
    Peer("JAX, vmap of a scan", ("jax",), jax_vmap, 1000),
)


def error(batch: Batch, positions: FloatArray) -> str:
    """Largest difference of the position from the reference, of the first simulations."""
    references = [batch.problem.at(point).reference[:, 0] for point in batch.points[:SHOWN]]
    return f"{np.abs(positions[:SHOWN] - references).max() * 1e6:.2g} µm"


def rows(count: int = COUNT, peers: Sequence[Peer] = PEERS, rounds: int = 5) -> list[Row]:
    """The rows; a slow peer runs fewer simulations, and its time is scaled."""
    case = f"{count} simulations of 1,000 samples"
    return [
        row._replace(note=row.note.replace(" s and scaled", " simulations and scaled"))
        for row in compare("h", case, peers, lambda n: Batch(int(n)), count, error, rounds, 60.0)
    ]
