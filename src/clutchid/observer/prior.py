"""What the parameters of an observer are known to be before its first sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from clutchid.inference.uncertainty.change_prior import drift
from clutchid.inference.uncertainty.coordinates import (
    CURVATURE,
    STOP_STD,
    Coordinate,
    Prior,
    coordinates,
    far_stop,
    smoothness,
)
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.least_squares import triangular

#: Parameter of a leak of chamber A, which is not below 0.
LEAK = "C_A0"

#: Bounds of the adapting parameters in prior standard deviations.
BOUND = 5.0

#: Positions over which modes of the load are chosen, and distance in m from which on the load that they leave out may
#: grow in proportion to the position. Other modes need another `state_file.FORMAT`. Provenance: docs/derivations.md.
POSITIONS, NEAR = 200, 3e-3


class OnlinePrior(NamedTuple):
    """The parameters that adapt and their prior, of mean 0 in their coordinates.

    `actuator` is the calibrated one with the functions of the load that adapt, `root` (k, k) a lower triangular root of
    the covariance of the coordinates `free`, and `weights` (weights, k) the derivatives of the calibrated load's
    weights with respect to them.
    """

    actuator: Actuator
    free: tuple[Coordinate, ...]
    root: FloatArray
    weights: FloatArray


def online_prior(actuator: Actuator, names: Sequence[str], modes: int | None = None) -> OnlinePrior:
    """Prior of the parameters that adapt.

    The load is that of the calibrated actuator, and may move as smoothly as a clutch wears; everything else drifts as
    between two recordings, see `clutchid.inference.uncertainty.change_prior`.

    Parameters
    ----------
    actuator : Actuator
        As calibrated.
    names
        Load weights and parameters.
    modes
        How many modes of the load adapt in place of its weights; by default, and if there are no more weights than
        that, the weights.
    """
    known = {name: Prior(actuator.value(name), std) for name in names if (std := drift(actuator, name)) > 0.0}
    for name, row in actuator.rows.items():
        if row.adapts and row.adapts.std is not None:
            known[name] = Prior(actuator.value(name), row.adapts.std * row.size(actuator.value(name)))
    known["y_max"] = far_stop(actuator, 0.0)
    free = tuple(coordinates(actuator, tuple(names), {}, {n: prior for n, prior in known.items() if n in names}))
    rows = [np.column_stack([np.eye(len(free)), np.zeros(len(free))])]
    if actuator.load.basis == "b-spline" and set(names) & set(actuator.load.names):
        smooth = smoothness(actuator, names, actuator.load.theta, CURVATURE)
        smooth[:, :-1] *= [c.slope(0.0) for c in free]
        rows.append(smooth)
    weights = np.array([[c.width * (c.base == name) for c in free] for name in actuator.load.names])
    if not free:
        return OnlinePrior(actuator, free, np.zeros((0, 0)), weights)
    inverse = np.linalg.inv(triangular(np.vstack(rows))[: len(free), : len(free)])
    whole = OnlinePrior(actuator, free, np.linalg.cholesky(inverse @ inverse.T), weights)
    return whole if modes is None or modes >= len(weights) or not np.any(weights) else _reduced(whole, modes)


def _reduced(whole: OnlinePrior, modes: int) -> OnlinePrior:
    """The prior with the load's leading modes in place of its weights: the calibrated load plus multiples of them.

    The modes are the principal components of the prior of the load over the stroke, so that their multiples are
    independent with a prior of 0 ± 1, like the coordinates of the parameters. The positions are those of Chebyshev,
    denser at the ends, where a few components are else worst, up to the bound of the far stop. At small positions,
    where recordings determine the load best, less may be left out.
    """
    actuator, load = whole.actuator, whole.actuator.load
    end = actuator.parameters.y_max + BOUND * STOP_STD
    position = 0.5 * end * (1.0 - np.cos(np.linspace(0.0, np.pi, POSITIONS)))
    root = whole.weights @ whole.root
    components = np.linalg.svd(load.phi(position) / (NEAR + position)[:, None] @ root)[2][:modes]
    shapes = root @ components.T
    shapes *= np.sign(shapes[0])  # a saved state is read with the modes of another machine
    functions = (load.theta, *(tuple(shape) for shape in shapes.T.tolist()))
    in_modes = replace(actuator, load=replace(load, theta=(1.0, *[0.0] * modes), functions=functions))
    names = in_modes.load.names[1:]
    of_modes = coordinates(in_modes, names, {}, dict.fromkeys(names, Prior(0.0, 1.0)))
    free = (*of_modes, *(c for c in whole.free if c.base not in load.names))
    weights = np.zeros((len(load.theta), len(free)))
    weights[:, :modes] = shapes
    return OnlinePrior(in_modes, free, np.eye(len(free)), weights)
