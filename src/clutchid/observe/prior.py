"""What the parameters of an observer are known to be before its first sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.least_squares import triangular
from clutchid.uncertainty.change_prior import drift
from clutchid.uncertainty.coordinates import (
    CURVATURE,
    WIDTHS,
    Coordinate,
    Prior,
    coordinates,
    far_stop,
    smoothness,
)

#: Parameter of a leak of chamber A, which is not below 0.
LEAK = "C_A0"

#: Standard deviations of what changes within hours, more than between two recordings: share, s, and m³/(Pa·s).
#: Provenance: docs/derivations.md.
GREASE, DELAY, LEAKING = 0.1, 3e-4, 5e-11


def online_prior(
    actuator: Actuator, names: Sequence[str], modes: int | None = None
) -> tuple[tuple[Coordinate, ...], FloatArray]:
    """Coordinates of the parameters that adapt, and a root T (k, m) of their covariance T T'; their mean is 0.

    The load is that of the calibrated actuator, and may move as smoothly as a clutch wears; everything else drifts as
    between two recordings, see `clutchid.uncertainty.change_prior`.

    Parameters
    ----------
    actuator : Actuator
        As calibrated.
    names
        Load weights and parameters.
    modes
        How many leading modes of the load are kept: directions in which the weights may move most. By default all.
    """
    known = {name: Prior(actuator.value(name), std) for name in names if (std := drift(actuator, name)) > 0.0} | {
        "D_v": Prior(actuator.value("D_v"), GREASE * actuator.value("D_v")),
        "tau_y": Prior(actuator.value("tau_y"), DELAY),
        LEAK: Prior(actuator.value(LEAK), LEAKING),
        "y_max": far_stop(actuator, 0.0),
        "s_pwm": Prior(actuator.value("s_pwm"), WIDTHS["s_pwm"]),
    }
    free = tuple(coordinates(actuator, tuple(names), {}, {n: prior for n, prior in known.items() if n in names}))
    rows = [np.column_stack([np.eye(len(free)), np.zeros(len(free))])]
    if actuator.load.basis == "b-spline" and set(names) & set(actuator.load.names):
        smooth = smoothness(actuator, names, actuator.load.theta, CURVATURE)
        smooth[:, :-1] *= [c.slope(0.0) for c in free]
        rows.append(smooth)
    if not free:
        return free, np.zeros((0, 0))
    inverse = np.linalg.inv(triangular(np.vstack(rows))[: len(free), : len(free)])
    return free, _root(inverse @ inverse.T, sum(c.base in actuator.load.names for c in free), modes)


def _root(covariance: FloatArray, weights: int, modes: int | None) -> FloatArray:
    """Lower trapezoidal root of a covariance, whose first rows are `weights` load weights, reduced to their modes."""
    modes = weights if modes is None else min(modes, weights)
    variance, directions = np.linalg.eigh(covariance[:weights, :weights])
    root = np.zeros((len(covariance), len(covariance) - weights + modes))
    root[:weights, :modes] = (directions * np.sqrt(variance))[:, weights - modes :]
    root[weights:, modes:] = np.linalg.cholesky(covariance[weights:, weights:])
    lower: FloatArray = np.linalg.qr(root.T)[1].T
    return lower
