"""Drift of parameters between two recordings of one actuator, and consider parameters of a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.coordinates import Coordinate
from clutchid.uncertainty.noise import Noise

#: Standard deviation of the change of a fixed parameter between two recordings of one actuator: relative to its value,
#: or in its unit if it may be 0.
DRIFT_SHARES: Mapping[str, float] = {
    "P_S": 0.0015, "C_vs": 0.0012, "C_ve": 0.0012, "V_0A": 0.05, "F_C": 0.15, "c_F": 0.06, "D_v": 0.003, "T_w": 0.0015,
    "h_A": 0.03, "V_S": 0.06, "A_A": 0.0003, "P_0": 0.0006,
}  # fmt: skip
DRIFT_WIDTHS: Mapping[str, float] = {"R_0vs": 6e-4, "R_0ve": 6e-4, "tau_y": 3e-5, "m_ve": 0.003}

#: Factor on all standard deviations, without and with a correlation time of the residuals; chosen on trucks of the
#: proving ground: 95 % intervals then contain the true load at 96.4 % of the points of 240 of them, see docs/truck.md.
DEVIATION_FACTOR, DEVIATION_FACTOR_WITH_MEMORY = 0.85, 0.55


def deviation_factor(noise: Noise) -> float:
    """Factor on all standard deviations."""
    return DEVIATION_FACTOR_WITH_MEMORY if noise.memory > 0.0 else DEVIATION_FACTOR


def drift(actuator: Actuator, name: str) -> float:
    """Standard deviation in SI of the change of a parameter between two recordings of one actuator."""
    own = actuator.own_row(name)
    if own is not None:
        return own.drift
    return DRIFT_WIDTHS.get(name, DRIFT_SHARES.get(name, 0.0) * abs(actuator.value(name)))


def calibrated_deviation(actuator: Actuator, name: str, calibration: Calibration) -> float:
    """Standard deviation in SI of a calibrated parameter in another recording: calibration and drift."""
    return float(np.sqrt(calibration.covariance_of((name,))[0, 0] + drift(actuator, name) ** 2))


def consider_parameters(
    actuator: Actuator, free: Sequence[Coordinate], calibration: Calibration | None
) -> tuple[tuple[Coordinate, ...], FloatArray]:
    """Parameters that are fixed but uncertain (Schmidt 1966), and the square root of their covariance.

    Each is a coordinate with a width of one standard deviation; the root, shape (m, m), contains their correlations.
    """
    free_names = {c.base for c in free} | set(actuator.load.names)
    calibrated = calibration.names if calibration else ()
    names = tuple(n for n in dict.fromkeys([*DRIFT_SHARES, *DRIFT_WIDTHS, *calibrated]) if n not in free_names)
    matrix = np.diag([drift(actuator, name) ** 2 for name in names])
    if calibration:
        matrix = matrix + calibration.covariance_of(names)
    width = np.sqrt(np.diag(matrix))
    kept = [i for i in range(len(names)) if 0.0 < width[i] < np.inf]
    considered = []
    for i in kept:
        row = actuator.row(names[i])
        value = actuator.value(names[i])
        considered.append(Coordinate(names[i], None, value, float(width[i]), False, row.low, row.high))
    correlation = matrix[np.ix_(kept, kept)] / np.outer(width[kept], width[kept])
    values, vectors = np.linalg.eigh(correlation)
    return tuple(considered), vectors * np.sqrt(np.maximum(values, 0.0))
