"""What the tests of the virtual truck share: the compiled loop, and runs with given duty cycles."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from clutchid.truck import Truck
from clutchid.truck.compiled import compiled_plant
from clutchid.truck.load_table import LoadTable
from clutchid.truck.running import run_truck
from clutchid.truck.settings import Course

STATES = Truck.parts.structure.states

#: Supply and exhaust pulses from when to when [ms] and their duty cycles: a stroke, a partial return, back, vented.
PULSES = ((50, 170, 0.8, 0.0), (600, 1000, 0.0, 0.35), (1300, 1400, 0.4, 0.0), (1700, 3000, 0.0, 0.6))


@pytest.fixture(scope="session", autouse=True)
def _compiled_loop() -> None:
    """Load the loop from the user's cache once; no test compiles for itself."""
    compiled_plant(Truck.parts.structure, False)


def forced(n: int, pulses: tuple[tuple[int, int, float, float], ...] = PULSES) -> np.ndarray:
    """Both duty cycles at every millisecond."""
    duties = np.zeros((n, 2))
    for begin, end, supply, exhaust in pulses:
        duties[begin:end] = supply, exhaust
    return duties


def pressures(truck: Truck, states: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pressure in chamber A, chamber B and the reservoir."""
    y, U_A, U_B, U_S = (states[:, STATES.index(name)] for name in ("y", "U_A", "U_B", "U_S"))
    V_A, V_B = truck.V_0A + truck.A_A * y, truck.V_0B + truck.A_B * (truck.y_max - y)
    return tuple((truck.gamma - 1) * U / V for U, V in ((U_A, V_A), (U_B, V_B), (U_S, truck.V_S)))


def entropy(truck: Truck, states: np.ndarray, chamber: str) -> np.ndarray:
    """Entropy of the air in chamber A or B in J/K, up to a constant for each kilogram."""
    y, m, U = (states[:, STATES.index(name)] for name in ("y", f"m_{chamber}", f"U_{chamber}"))
    V = truck.V_0A + truck.A_A * y if chamber == "A" else truck.V_0B + truck.A_B * (truck.y_max - y)
    T = (truck.gamma - 1) * U / (m * truck.R)
    return m * truck.R * (np.log(T) / (truck.gamma - 1) + np.log(V / m))


def put(truck: Truck, start: np.ndarray, y: float, p_A: float) -> np.ndarray:
    """`start` with the piston at y and the chamber at p_A, all air at the temperature of the wall."""
    new, T = start.copy(), truck.T_0 + truck.dT_w
    V_A, V_B = truck.V_0A + truck.A_A * y, truck.V_0B + truck.A_B * (truck.y_max - y)
    new[0] = y
    for first, p, V in ((2, p_A, V_A), (4, truck.P_0, V_B)):
        new[first : first + 2] = p * V / (truck.R * T), p * V / (truck.gamma - 1)
    return new


@pytest.fixture(scope="session")
def lab() -> SimpleNamespace:
    """Helpers: states(truck, duties, ...) of a run with given duty cycles, forced, put, pressures and entropy."""

    def states(
        truck: Truck,
        duties: np.ndarray,
        substeps: int = 1,
        ledger: bool = False,
        start: np.ndarray | None = None,
        curve: LoadTable | None = None,
    ) -> np.ndarray:
        nothing = np.zeros(len(duties))
        course = Course(nothing, duties, nothing)
        return run_truck(truck, course, substeps=substeps, ledger=ledger, start=start, curve=curve).outputs.states

    return SimpleNamespace(states=states, forced=forced, put=put, pressures=pressures, entropy=entropy)
