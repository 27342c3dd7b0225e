"""Honest uncertainty: what is estimated, what is only taken as known, and what the model does not say."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.simulation.windows import units
from clutchid.smoother.elimination import Eliminated, recover
from clutchid.smoother.problem import Chain, FitProblem, condense, linearise
from clutchid.smoother.projection import ShootingSolution
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.drift import considered, scale

#: Residuals are coloured: this many neighbouring samples tell what one would, were they independent. The bootstrap over
#: strokes finds 1 to 4 on trucks.
COLOUR = 2.0

#: Draws from the distribution of the states, for the band of the pressure.
DRAWS = 48


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
    extra, root = considered(task.actuator, task.coordinates, calibration)
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
