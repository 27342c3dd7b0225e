"""Honest uncertainty: what is estimated, what is only taken as known, and what the model does not say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from clutchid.estimate.calibration import Calibration
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.parameters import Parameters
from clutchid.simulation.windows import units
from clutchid.smoother.elimination import Eliminated, recover
from clutchid.smoother.problem import Chain, FitProblem, condense, linearise
from clutchid.smoother.projection import ShootingSolution
from clutchid.uncertainty.coordinates import Coordinate
from clutchid.uncertainty.noise import Noise

#: How much a number that is taken as known may differ between two recordings of one actuator, as a share of its value
#: or, where it may be 0, in its own unit.
DRIFT: Mapping[str, float] = {
    "P_S": 0.0015, "C_vs": 0.0012, "C_ve": 0.0012, "V_0A": 0.05, "F_C": 0.15, "c_F": 0.06, "D_v": 0.003, "T_w": 0.0015,
    "h_A": 0.03, "V_S": 0.06, "A_A": 0.0003, "P_0": 0.0006,
}  # fmt: skip
DRIFT_WIDTH: Mapping[str, float] = {"R_0vs": 6e-4, "R_0ve": 6e-4, "tau_y": 3e-5, "m_ve": 0.003}

#: Residuals are coloured: this many neighbouring samples tell what one would, were they independent. The bootstrap over
#: strokes finds 1 to 4 on trucks.
COLOUR = 2.0

#: All deviations are taken by this factor, where every sample counts and where residuals have a memory: 95 % bands then
#: hold the true load at 94 and 95 % of the points on 240 trucks of the proving ground; docs/truck.md has the figures.
SCALE, SCALE_WITH_MEMORY = 0.85, 0.55

#: Draws from the distribution of the states, for the band of the pressure.
DRAWS = 48


def scale(noise: Noise) -> float:
    """The factor on all deviations."""
    return SCALE_WITH_MEMORY if noise.memory > 0.0 else SCALE


def drift(actuator: Actuator, name: str) -> float:
    """How much a number may differ between two recordings of one actuator, as a standard deviation in SI."""
    return DRIFT_WIDTH.get(name, DRIFT.get(name, 0.0) * abs(actuator.value(name)))


def deviation(actuator: Actuator, name: str, calibration: Calibration) -> float:
    """Standard deviation of a calibrated number in another recording, in SI: as calibrated, and as far as it drifts."""
    return float(np.sqrt(calibration.covariance_of((name,))[0, 0] + drift(actuator, name) ** 2))


def considered(task: FitProblem, calibration: Calibration | None) -> tuple[tuple[Coordinate, ...], FloatArray]:
    """Numbers that a fit takes as known although they are not exactly, and the square root of their covariance.

    Each is a coordinate of width one standard deviation; the root, shape (m, m), holds their correlations.
    """
    taken = {c.base for c in task.coordinates} | set(task.actuator.load.names)
    known = calibration.names if calibration else ()
    names = tuple(n for n in dict.fromkeys([*DRIFT, *DRIFT_WIDTH, *known]) if n not in taken)
    matrix = np.diag([drift(task.actuator, name) ** 2 for name in names])
    if calibration:
        matrix = matrix + calibration.covariance_of(names)
    width = np.sqrt(np.diag(matrix))
    kept = [i for i in range(len(names)) if 0.0 < width[i] < np.inf]
    found = []
    for i in kept:
        row = Parameters.row(names[i])
        value = task.actuator.value(names[i])
        found.append(Coordinate(names[i], None, value, float(width[i]), False, row.low, row.high))
    correlation = matrix[np.ix_(kept, kept)] / np.outer(width[kept], width[kept])
    values, vectors = np.linalg.eigh(correlation)
    return tuple(found), vectors * np.sqrt(np.maximum(values, 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Covariance of the free numbers x, and what else is needed to draw states that go with them.

    `known` is the part that the recording's noise leaves, `moved` the shift of x with the considered numbers.
    """

    task: FitProblem
    chains: tuple[Eliminated, ...]
    known: FloatArray
    moved: FloatArray
    root: FloatArray

    @property
    def matrix(self) -> FloatArray:
        """Covariance of x, shape (k, k)."""
        return scale(self.task.noise) ** 2 * (self.known @ self.known.T + self.moved @ self.moved.T)


def spread(task: FitProblem, found: ShootingSolution, calibration: Calibration | None) -> Spread | Failure:
    """How uncertain the free numbers are.

    The considered numbers (Schmidt 1966) are not estimated: their spread moves the estimate through the information
    that the recording has on both.
    """
    k = len(task.coordinates)
    extra, root = considered(task, calibration)
    wide = replace(task, coordinates=(*task.coordinates, *extra))
    linear = linearise(wide, np.concatenate([found.x, np.zeros(len(extra))]), found.X)
    if isinstance(linear, Failure):
        return linear
    own = [*range(k), *range(k + len(extra), linear.prior.shape[0])]
    linear = replace(linear, prior=linear.prior[own])
    searched, _ = condense(wide, linear)
    moved = -np.linalg.pinv(searched[:k, :k]) @ searched[:k, k : k + len(extra)] @ root
    factor, chains = condense(wide, replace(linear, chains=tuple(_counted(chain) for chain in linear.chains)))
    known = np.linalg.pinv(factor[:k, :k]).astype(np.float64)
    return Spread(wide, tuple(chains), known, moved, root)


def _counted(chain: Chain) -> Chain:
    """A chain with `COLOUR` neighbouring samples counted as one; what is known of its first state stands."""
    share, linearised = 1.0 / np.sqrt(COLOUR), chain.windows.linearised
    windows = replace(chain.windows, linearised=replace(linearised, own=share * linearised.own, r=share * linearised.r))
    return replace(chain, windows=windows, links=share * chain.links)


def pressure_spread(of: Spread) -> list[FloatArray]:
    """Standard deviation of the pressure at the start of every window in Pa, an array a track."""
    rng = np.random.default_rng(0)
    moved = rng.standard_normal((of.root.shape[0], DRAWS))
    theta = of.known @ rng.standard_normal((of.known.shape[0], DRAWS)) + of.moved @ moved
    at = of.task.actuator.states.index("p_A")
    unit = units(of.task.actuator)[at]
    result = []
    for chain in of.chains:
        own = chain.own.copy()
        own[:, :, -1] = 0.0
        noise = rng.standard_normal((*own.shape[:2], DRAWS))
        draws = recover(replace(chain, own=own), np.vstack([theta, of.root @ moved]), noise)
        result.append(scale(of.task.noise) * np.std(draws[:, at, :], axis=1) * unit)
    return result
