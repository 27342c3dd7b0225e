"""Textbook systems with known answers, and their compiled kernels (each compiled once a run)."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from clutchid.codegen.cache import load_module
from clutchid.codegen.numba_source import numba_source
from clutchid.codegen.system import Jump, System, TabulatedFunction
from fixtures.once import SHARED

FloatArray = NDArray[np.float64]


def symbols(names: str) -> Any:
    return sp.symbols(names, real=True, seq=True)


@pytest.fixture(scope="session")
def logistic() -> System:
    """Growth to a limit; exact solution and exact sensitivities are known."""
    (n, r, K) = symbols("N r K")
    return System("logistic", (n,), (), (r, K), (), (r * n * (1 - n / K),))


@pytest.fixture(scope="session")
def oscillator() -> System:
    """A driven spring; every name is one that the generated code wants for itself."""
    x, v, u, k, c, S = symbols("x v u k c S")
    return System("oscillator", (x, v), (u,), (k, c, S), (), (v, (u - k * x - c * v) / S))


@pytest.fixture(scope="session")
def van_der_pol() -> System:
    x, v, mu = symbols("x v mu")
    return System("van_der_pol", (x, v), (), (mu,), (), (v, mu * (1 - x**2) * v - x))


@pytest.fixture(scope="session")
def assorted() -> System:
    """Uncoupled textbook equations with branches, a table, an input and two jumps.

    a: drag of a ball, a' = -b |a| a; h: a tank that drains through a hole, h' = -q sqrt(h);
    m: a follower that only rises, m' = max(s - m, 0); w: w' = -f(w) with a function f known only to the table.
    """
    a, h, m, w, s, b, q, f, drag, outflow, level = symbols("a h m w s b q f drag outflow level")
    definitions = (
        (drag, b * sp.Abs(a) * a),
        (outflow, sp.Piecewise((q * sp.sqrt(h), h > 0), (0, True))),
    )
    return System(
        name="assorted",
        states=(a, h, m, w),
        inputs=(s,),
        parameters=(b, q),
        definitions=definitions,
        derivatives=(-drag, -outflow, sp.Max(s - m, 0), -f),
        table=TabulatedFunction(f, w),
        measured=(level,),
        jumps=(Jump("replace", (a, level, m, w)), Jump("mix", (a * b, h * q + level, a * sp.sqrt(m), w))),
    )


@dataclass(frozen=True)
class Kernels:
    """The kernels of one system with everything that a test does not care about filled in."""

    system: System
    module: ModuleType
    breakpoints: FloatArray = field(default_factory=lambda: np.array([0.0, 1.0, 2.0]))
    #: phi_1 is w itself up to 1 and constant beyond; phi_2 is (w - 1)**2 from 1, with (w - 2)**3 more from 2.
    basis: FloatArray = field(
        default_factory=lambda: np.array(
            [
                [[0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]],
                [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 2.0, 1.0, 1.0]],
            ]
        )
    )

    def run(
        self,
        x0: ArrayLike,
        p: ArrayLike,
        dt: ArrayLike,
        *,
        u: ArrayLike | None = None,
        substeps: int = 1,
        jump: dict[int, int] | None = None,
        measured: float = 0.0,
        theta: ArrayLike = (1.0, 0.0),
        kernel: str = "run",
    ) -> tuple[int, FloatArray, FloatArray]:
        """Status, states (n, nx) and, but for ``run``, sensitivities (n, nx, nx + n_p + n_theta)."""
        steps = np.asarray(dt, np.float64)
        n, nx, n_p = len(steps) + 1, len(self.system.states), len(self.system.parameters)
        jumps = np.zeros(n, np.uint8)
        for sample, number in (jump or {}).items():
            jumps[sample] = number
        out = np.full((n, nx), np.nan)
        held = np.zeros((n, len(self.system.inputs))) if u is None else np.asarray(u, np.float64)
        head = (np.array(x0, np.float64),)
        common = (held, np.array(p, np.float64), steps, np.full(n - 1, substeps, np.int32), jumps,
                  np.full((n, len(self.system.measured)), measured))  # fmt: skip
        load = np.tensordot(np.asarray(theta, np.float64), self.basis, 1)
        table = (self.breakpoints, load) if self.system.table else ()
        if kernel == "run":
            return self.module.run(*head, *common, *table, out), out, np.zeros(0)
        n_theta = 2 if self.system.table else 0
        S = np.zeros((nx, nx + n_p + n_theta))
        S[:, :nx] = np.eye(nx)
        slots = self.module.SLOTS if kernel == "run_all" else ()
        fill = np.array([(i, row, nx + column) for i, (row, column) in enumerate(slots)], np.int64).reshape(-1, 3).T
        weights = np.arange(n_theta)
        functions = (self.basis, weights, nx + n_p + weights) if self.system.table else ()
        sens = np.full((n, nx, S.shape[1]), np.nan)
        status = self.module.run_all(
            *head, S, *common, *table, *functions, *(row.copy() for row in fill), np.arange(nx), out, sens
        )
        return status, out, sens


@pytest.fixture(scope="session")
def compiled() -> Callable[[System], Kernels]:
    """Builds kernels of a system in the folder of this run."""

    @cache
    def build(system: System) -> Kernels:
        with pytest.MonkeyPatch.context() as patch:  # no longer: later tests would compile all models anew
            patch.setenv("CLUTCHID_CACHE", str(Path(os.environ[SHARED], "kernels")))
            return Kernels(system, load_module(system.name, [Path(__file__)], lambda: numba_source(system)))

    return build
