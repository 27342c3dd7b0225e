"""Parameters of a fit that are fixed but uncertain: by their calibration, and by their drift since."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import drift
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.parameters import in_order

#: Factor on all standard deviations of a fit by prediction error; chosen on trucks of the proving ground,
#: docs/truck.md.
DEVIATION_FACTOR = 0.85


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
    drifting = in_order(actuator.rows, lambda row: row.drift)
    names = tuple(n for n in dict.fromkeys([*drifting, *calibrated]) if n not in free_names)
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
