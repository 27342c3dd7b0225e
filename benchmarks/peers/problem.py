"""The simulation that all peers solve: held inputs of `benchmarks/kernels.py`, the paper's actuator, five states."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from clutchid.model.actuator import Actuator
from clutchid.simulation.run import Columns, columns

sys.path.insert(0, str(Path(__file__).parent.parent))

import kernels as own
from equations import chosen_text, parameter_values
from fit import NOISE, THETA, recording
from peer import FloatArray
from plain import WEIGHTS, Model, Recording, by_pieces

__all__ = ["FIFTEEN", "NOISE", "SEVEN", "THETA", "Problem", "own", "recording", "sensitivities"]

CLUTCH = own.clutch()

#: Integration steps of the reference for every step of clutchid.
FINER = 64

#: Free parameters of the sensitivities, in the order in which a calibration frees them.
SEVEN = (*WEIGHTS, "D_v", "F_C", "C_vs", "C_ve")
FIFTEEN = (*SEVEN, "V_0A", "M", "K_z", "D_zdot", "P_S", "y_max", "A_A", "R_0vs")


@dataclass(frozen=True)
class Problem:
    """A simulation over `seconds` at `rate` Hz, with sensitivities of the position to `names`.

    The duty cycles are those of `benchmarks/kernels.py`, drawn from `seed`, or `inputs`, shape (samples, 2).
    """

    seconds: float
    rate: float = 1000.0
    names: tuple[str, ...] = ()
    actuator: Actuator = CLUTCH
    seed: int = 1
    inputs: FloatArray | None = None

    @cached_property
    def drive(self) -> own.Drive:
        """Arrays of the kernels; a sample of 10 ms takes ten steps, so that every step is 1 ms."""
        drive = own.drive(self.seconds, self.rate, self.seed)
        if self.inputs is not None:
            n = len(self.inputs)
            drive = replace(drive, u=self.inputs, dt=drive.dt[: n - 1], substeps=drive.substeps[: n - 1])
        steps = max(1, round(1000 / self.rate))
        load = self.actuator.load
        return replace(
            drive, substeps=drive.substeps * np.int32(steps), p=self.actuator.parameters.array(), load=load.combined()
        )

    @cached_property
    def time(self) -> FloatArray:
        """Instants of the samples in s."""
        return np.arange(self.drive.u.shape[0]) / self.rate

    @cached_property
    def edges(self) -> list[int]:
        """Samples at which an input changes, with the first and the last one."""
        changed = np.flatnonzero(np.any(np.diff(self.drive.u, axis=0) != 0, axis=1)) + 1
        return sorted({0, *map(int, changed), self.time.size - 1})

    @property
    def values(self) -> dict[str, float]:
        """Parameters by name."""
        return parameter_values(self.drive.p)

    @property
    def point(self) -> FloatArray:
        """Values of the parameters `names`."""
        return np.array([self.actuator.value(name) for name in self.names])

    def at(self, point: FloatArray) -> Problem:
        """The problem with other values of `names`."""
        return replace(self, actuator=self.actuator.replace(dict(zip(self.names, map(float, point), strict=True))))

    @cached_property
    def reference(self) -> FloatArray:
        """States with steps that are `FINER` times finer."""
        out = np.zeros((self.time.size, 5))
        own.numba_run(self.finer, out)()
        return out

    @cached_property
    def reference_jacobian(self) -> FloatArray:
        """Derivatives of the position to `names` with the finer steps, shape (samples, names)."""
        return sensitivities(self, self.finer)()

    @property
    def finer(self) -> own.Drive:
        """Arrays of the kernels with the steps of the reference."""
        return replace(self.drive, substeps=self.drive.substeps * np.int32(FINER))

    def by_pieces(self, solve: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]) -> FloatArray:
        """States at the samples from ``solve(time, x, u)``, started anew at every edge of an input."""
        return by_pieces(solve, self.time, self.drive.u, self.drive.x0, self.edges)

    @property
    def table(self) -> tuple[list[float], list[list[float]]]:
        """The load as breakpoints and coefficients, for `plain.lookup`."""
        return self.drive.breakpoints.tolist(), self.drive.load.tolist()

    @property
    def given(self) -> Recording:
        """What `plain.scipy_position` takes of it."""
        load = self.actuator.load
        return Recording(
            load.breakpoints, load.coefficients, self.time, self.drive.u, self.drive.x0, np.array(self.edges)
        )

    @property
    def model(self) -> Model:
        """The model with the values of `names` free, for a peer that records expressions."""
        load = self.actuator.load
        fixed = {name: self.actuator.value(name) for name in WEIGHTS if name not in self.names}
        return Model(chosen_text(self.values, self.names), self.names, fixed, load.breakpoints, load.coefficients)


def sensitivities(problem: Problem, drive: own.Drive) -> Callable[[], FloatArray]:
    """The kernel with derivatives of the position to the names of `problem`, on the arrays of `drive`."""
    chosen: Columns = columns(problem.actuator, problem.names)
    kernel, n, width = own.kernels("isothermal").run_all, drive.u.shape[0], len(problem.names)
    out, sens, S = np.zeros((n, 5)), np.zeros((n, 1, width)), np.zeros((5, width))
    jump, measured, watched = np.zeros(n, np.uint8), np.zeros((n, 2)), np.array([0])

    def run() -> FloatArray:
        S[:] = 0.0
        status = kernel(
            drive.x0.copy(), S, drive.u, drive.p, drive.dt, drive.substeps, jump, measured, drive.breakpoints,
            drive.load, drive.basis, chosen.table_basis, chosen.table_column, chosen.fill_slot, chosen.fill_row,
            chosen.fill_column, watched, out, sens,
        )  # fmt: skip
        if status != -1:
            raise RuntimeError(f"the run left the finite numbers at sample {status}.")
        return sens[:, 0]

    return run
