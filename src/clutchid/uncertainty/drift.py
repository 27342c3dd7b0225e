"""How far parameters drift between two recordings of one actuator, and what a fit fixes although it is uncertain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.parameters import Parameters
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.coordinates import Coordinate
from clutchid.uncertainty.noise import Noise

#: How much a number that is taken as known may differ between two recordings of one actuator, as a share of its value
#: or, where it may be 0, in its own unit.
DRIFT: Mapping[str, float] = {
    "P_S": 0.0015, "C_vs": 0.0012, "C_ve": 0.0012, "V_0A": 0.05, "F_C": 0.15, "c_F": 0.06, "D_v": 0.003, "T_w": 0.0015,
    "h_A": 0.03, "V_S": 0.06, "A_A": 0.0003, "P_0": 0.0006,
}  # fmt: skip
DRIFT_WIDTH: Mapping[str, float] = {"R_0vs": 6e-4, "R_0ve": 6e-4, "tau_y": 3e-5, "m_ve": 0.003}

#: All deviations are taken by this factor, where every sample counts and where residuals have a memory: 95 % bands then
#: hold the true load at 94 and 95 % of the points on 240 trucks of the proving ground; docs/truck.md has the figures.
SCALE, SCALE_WITH_MEMORY = 0.85, 0.55


def scale(noise: Noise) -> float:
    """The factor on all deviations."""
    return SCALE_WITH_MEMORY if noise.memory > 0.0 else SCALE


def drift(actuator: Actuator, name: str) -> float:
    """How much a number may differ between two recordings of one actuator, as a standard deviation in SI."""
    return DRIFT_WIDTH.get(name, DRIFT.get(name, 0.0) * abs(actuator.value(name)))


def deviation(actuator: Actuator, name: str, calibration: Calibration) -> float:
    """Standard deviation of a calibrated number in another recording, in SI: as calibrated, and as far as it drifts."""
    return float(np.sqrt(calibration.covariance_of((name,))[0, 0] + drift(actuator, name) ** 2))


def considered(
    actuator: Actuator, free: Sequence[Coordinate], calibration: Calibration | None
) -> tuple[tuple[Coordinate, ...], FloatArray]:
    """Parameters that a fit fixes although they are uncertain (Schmidt 1966), and the square root of their covariance.

    Each is a coordinate of width one standard deviation; the root, shape (m, m), holds their correlations.
    """
    taken = {c.base for c in free} | set(actuator.load.names)
    known = calibration.names if calibration else ()
    names = tuple(n for n in dict.fromkeys([*DRIFT, *DRIFT_WIDTH, *known]) if n not in taken)
    matrix = np.diag([drift(actuator, name) ** 2 for name in names])
    if calibration:
        matrix = matrix + calibration.covariance_of(names)
    width = np.sqrt(np.diag(matrix))
    kept = [i for i in range(len(names)) if 0.0 < width[i] < np.inf]
    found = []
    for i in kept:
        row = Parameters.row(names[i])
        value = actuator.value(names[i])
        found.append(Coordinate(names[i], None, value, float(width[i]), False, row.low, row.high))
    correlation = matrix[np.ix_(kept, kept)] / np.outer(width[kept], width[kept])
    values, vectors = np.linalg.eigh(correlation)
    return tuple(found), vectors * np.sqrt(np.maximum(values, 0.0))
