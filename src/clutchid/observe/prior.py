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


def online_prior(actuator: Actuator, names: Sequence[str]) -> tuple[tuple[Coordinate, ...], FloatArray]:
    """Coordinates of the parameters that adapt, and a root T (k, k) of their covariance T T'; their mean is 0.

    The load is that of the calibrated actuator, and may move as smoothly as a clutch wears; everything else drifts as
    between two recordings, see `clutchid.uncertainty.change_prior`.

    Parameters
    ----------
    actuator : Actuator
        As calibrated.
    names
        Load weights and parameters.
    """
    known = {name: Prior(actuator.value(name), std) for name in names if (std := drift(actuator, name)) > 0.0} | {
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
    root: FloatArray = np.linalg.cholesky(inverse @ inverse.T)
    return free, root
