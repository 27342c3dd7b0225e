"""Simulated rigs whose friction is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from clutchid.log import Log
from fixtures.friction import simulated_force

#: A contact that yields by 0.1 mm before it slides.
BLOCK = {"F_C": 2.0, "K_z": 2e4, "D_v": 300.0, "D_zdot": 200.0, "force_zero": 0.1}

AMBIENT = 1.0e5


@pytest.fixture(scope="session")
def block() -> dict[str, float]:
    """Friction of `tribometer`."""
    return BLOCK


@pytest.fixture(scope="session")
def tribometer() -> Callable[..., Log]:
    """20 s at 200 Hz, strokes of 1 mm at speeds that change, and friction `values`, without noise."""

    def make(values: dict[str, float] = BLOCK, start: float = 0.0) -> Log:
        t = np.arange(4000) * 5e-3
        y = 5e-4 * np.sin(2 * np.pi * t / 4) * (1 + 0.5 * np.sin(2 * np.pi * t / 17))
        log = Log(t, {"position": y}, "tribometer")
        return log.with_columns(force=simulated_force(log, values, start))

    return make


@pytest.fixture(scope="session")
def coloured() -> Callable[..., np.ndarray]:
    """Autoregressive noise of a standard deviation of 1."""

    def make(generator: np.random.Generator, n: int, rho: float) -> np.ndarray:
        noise = generator.standard_normal(n) * np.sqrt(1 - rho**2)
        noise[0] /= np.sqrt(1 - rho**2)
        return lfilter([1.0], [1.0, -rho], noise)

    return make


@pytest.fixture(scope="session")
def cylinder() -> Callable[..., Log]:
    """Ten cycles of 40 mm at 10 and 20 mm/s against a held pressure (Pa over ambient), friction and zero a cycle.

    The pressure is 8 kPa higher on the way out, where the piston presses the air.
    """

    def make(pressure: float, friction: np.ndarray | float, area: float = 5e-4, zero: np.ndarray | float = 0.3) -> Log:
        of_cycle, zeros = np.broadcast_to(friction, (10,)), np.broadcast_to(zero, (10,))
        t = np.arange(0.0, 60.0, 0.05)
        phase, cycle = t % 6.0, np.minimum((t / 6.0).astype(int), 9)
        y = np.where(phase < 4.0, 0.01 * phase, 0.02 * (6.0 - phase))
        way = np.where(phase < 4.0, 1.0, -1.0)
        over = pressure + 4e3 * way
        force = zeros[cycle] + area * over + of_cycle[cycle] * way
        columns = {"position": y, "force": force, "pressure_a": AMBIENT + over}
        return Log(t, columns, f"{pressure / 1e5:g} bar", {"ambient_Pa": repr(AMBIENT)})

    return make
