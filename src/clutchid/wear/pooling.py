r"""Pool of the vehicles of a type: variances of wear and use, and how rates and uses are spread (empirical Bayes).

The rate of a vehicle is log-normal, :math:`\log r_i \sim N(m, t^2)`, its use likewise; m and t are those of largest
density given all vehicles (expectation maximisation on a grid of logarithms), the nodes of the variances are weighed by
the evidence of all vehicles together. V(m) as Hartung and Knapp have it (Statistics in Medicine 20, 3875, 2001).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import special

from clutchid.log import FloatArray
from clutchid.wear.evidence import (
    USE_NODES,
    USUAL_USE,
    WEAR_NODES,
    WIDE_LEVEL,
    WIDE_RATE,
    LifeEvidence,
    UseNode,
    WearNode,
)


class Guess(NamedTuple):
    """Assumption before vehicles of a type teach it: a node of the variances, mean and spread of a logarithm."""

    node: WearNode | UseNode
    mean: float
    spread: float


#: Of the rate, in usual wear a life, and of the use in its nodes: a third to three times of the usual. Guesses.
RATE_GUESS = Guess(WearNode(1.0, 1.0, 0.4, 0.05), float(np.log(0.6)), 0.9)
USE_GUESSES = tuple(Guess(UseNode(0.2, 0.1), float(usual), 0.6) for usual in USUAL_USE)

#: Vehicles from which a type is pooled; fewer have the guess.
POOLED = 4

#: Vehicles that the guess of a spread is worth, and the spread that they have: between one half and double.
_WORTH, _SPREAD = 2.0, 0.5

#: TypeSpread of the logarithms of the variances around the guessed ones, in factors.
_FACTOR = 4.0

#: Most vehicles from which the variances of a type are learnt, and the spread of its rates: more hardly change them.
_ENOUGH, _MANY = 400, 4000

#: Least weight of a node of the variances that counts.
LEAST_WEIGHT = 0.01

#: Logarithms of rates, in usual wear a life.
_GRID = np.linspace(np.log(3e-3), np.log(30.0), 121)

#: Standard deviation of a logarithm below which a rate is not resolved by the grid.
_STEP = 0.5 * float(_GRID[1] - _GRID[0])

_ITERATIONS = 30


class TypeSpread(NamedTuple):
    """How a logarithm is spread over the vehicles of a type, by node of its variances.

    Attributes
    ----------
    weight : (nodes,)
        Posterior probability.
    mean, error, std : (nodes,)
        Mean with its standard deviation, and the spread of the vehicles around it.
    """

    weight: FloatArray
    mean: FloatArray
    error: FloatArray
    std: FloatArray

    @property
    def of_new(self) -> FloatArray:
        """Standard deviation of a vehicle without recordings, (nodes,)."""
        return np.hypot(self.std, self.error)

    @property
    def best(self) -> int:
        """The most probable node."""
        return int(np.argmax(self.weight))


class TypePool(NamedTuple):
    """Rates of the `vehicles` of a type, and their uses a day and a km."""

    vehicles: int
    rate: TypeSpread
    use: tuple[TypeSpread, TypeSpread]

    @property
    def is_guess(self) -> bool:
        """Whether there are too few vehicles to learn from."""
        return self.vehicles < POOLED


def pooled(evidence: LifeEvidence) -> TypePool:
    """Pool of vehicles of a type from their evidence."""
    count = evidence.limit.size
    uses = [_use(_some(evidence.use[:, q], _MANY), guess) for q, guess in enumerate(USE_GUESSES)]
    rate = _rate(_some(evidence.wear, _ENOUGH))
    if count > _ENOUGH:
        nodes = np.flatnonzero(rate.weight >= LEAST_WEIGHT * rate.weight.max())
        wear = _some(evidence.wear[:, nodes], _MANY)
        for part, finer in zip(rate[1:], _spread(rate_likelihood(wear)), strict=True):
            part[nodes] = finer
    return TypePool(count, rate, (uses[0], uses[1]))


def _some(rows: FloatArray, most: int) -> FloatArray:
    """Vehicles out of all, evenly."""
    return np.asarray(rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), most)).astype(int))])


def _rate(wear: FloatArray) -> TypeSpread:
    """The spread of rates from `LifeEvidence.wear` of the vehicles."""
    guess, likelihood = RATE_GUESS, rate_likelihood(wear)
    m, error, t = _spread(likelihood)
    shares = np.log(np.einsum("inj,nj->in", likelihood, _density(m, t)) + 1e-300)
    return TypeSpread(_weights((wear[:, :, 0] + shares).sum(axis=0), WEAR_NODES, guess), m, error, t)


def _spread(likelihood: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean with its standard deviation, and spread, of the logarithms of rates by node, from those of vehicles."""
    count, nodes = likelihood.shape[:2]
    m, t = np.full(nodes, RATE_GUESS.mean), np.full(nodes, RATE_GUESS.spread)
    if count >= POOLED:
        for _ in range(_ITERATIONS):
            m, t = _updated(*_moments(likelihood, m, t), t, RATE_GUESS)
    variance = _moments(likelihood, m, t)[1]
    return m, _error(1 / np.maximum(1 / variance - 1 / t**2, 1e-12), t), t


def rate_likelihood(wear: FloatArray) -> FloatArray:
    """Likelihood of the rates of the grid by vehicle and node, without their wide prior, (k, nodes, grid)."""
    rate, mean, variance = np.exp(_GRID), wear[..., 2, None], wear[..., 4, None]
    variance = variance + (_STEP * rate) ** 2
    exponent = -((rate - mean) ** 2) / (2 * variance) + rate**2 / (2 * WIDE_RATE**2)
    return np.exp(exponent - 0.5 * np.log(variance / WIDE_RATE**2))


def rate_posterior(wear: FloatArray, spread: TypeSpread, node: int) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation of the logarithm of each vehicle's rate at a node, (k,)."""
    m, t = spread.mean[[node]], spread.of_new[[node]]
    mean, variance = _moments(rate_likelihood(wear[:, [node]]), m, t)
    return mean[:, 0], np.sqrt(variance[:, 0])


def _moments(likelihood: FloatArray, m: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and variance of the logarithm of the rate of each vehicle, by node, (k, nodes)."""
    weights = likelihood * _density(m, t) + 1e-300
    weights /= weights.sum(axis=-1, keepdims=True)
    mean = weights @ _GRID
    return mean, weights @ _GRID**2 - mean**2


def _density(m: FloatArray, t: FloatArray) -> FloatArray:
    """The prior on the grid, (nodes, grid)."""
    density = np.exp(-0.5 * ((_GRID - m[:, None]) / t[:, None]) ** 2)
    return np.asarray(density / density.sum(axis=-1, keepdims=True))


def _updated(mean: FloatArray, variance: FloatArray, t: FloatArray, guess: Guess) -> tuple[FloatArray, FloatArray]:
    """A step of expectation maximisation from the posterior moments of the vehicles."""
    count = len(mean)
    worth = (t / guess.spread) ** 2
    centre = (mean.sum(axis=0) + worth * guess.mean) / (count + worth)
    spread = (variance + (mean - centre) ** 2).sum(axis=0) + _WORTH * _SPREAD**2
    return centre, np.sqrt(spread / (count + _WORTH))


def _error(variance: FloatArray, t: FloatArray) -> FloatArray:
    """Standard deviation of the mean of a type, from the variances of its vehicles without it, (nodes,)."""
    if len(variance) < POOLED:
        return np.zeros_like(t)
    return np.asarray(1 / np.sqrt((1 / (t**2 + variance)).sum(axis=0)))


def _weights(evidence: FloatArray, nodes: tuple[WearNode, ...] | tuple[UseNode, ...], guess: Guess) -> FloatArray:
    """Posterior probabilities of nodes from the logarithms of their evidence."""
    factors = np.log(np.array(nodes) / np.array(guess.node)) / np.log(_FACTOR)
    log = evidence - 0.5 * np.square(factors).sum(axis=1)
    return np.asarray(special.softmax(log))


def _use(use: FloatArray, guess: Guess) -> TypeSpread:
    """The spread of a use from its evidence (k, nodes, 3); vehicles whose use is not known say nothing."""
    use = use[np.isfinite(use[:, 0, 1])]
    nodes = len(USE_NODES)
    m, t = np.full(nodes, guess.mean), np.full(nodes, guess.spread)
    own, v = level_likelihood(use, guess)
    if len(use) >= POOLED:
        for _ in range(_ITERATIONS):
            gain = t**2 / (t**2 + v)
            m, t = _updated(m + gain * (own - m), gain * v, t, guess)
    total = use[:, :, 0] + 0.5 * np.log((WIDE_LEVEL**2 + v) / (t**2 + v)) - 0.5 * (own - m) ** 2 / (t**2 + v)
    total += 0.5 * (own - guess.mean) ** 2 / (WIDE_LEVEL**2 + v)
    return TypeSpread(_weights(total.sum(axis=0), USE_NODES, guess), m, _error(v, t), t)


def level_likelihood(use: FloatArray, guess: Guess) -> tuple[FloatArray, FloatArray]:
    """Mean and variance of the level of a use that a vehicle's own recordings say, without the wide prior."""
    variance = 1 / np.maximum(1 / np.maximum(use[..., 2], 1e-12) - 1 / WIDE_LEVEL**2, 1e-9)
    return variance * (use[..., 1] / np.maximum(use[..., 2], 1e-12) - guess.mean / WIDE_LEVEL**2), variance


def level_posterior(use: FloatArray, spread: TypeSpread, node: int, guess: Guess) -> tuple[FloatArray, FloatArray]:
    """Mean and variance of the level of each vehicle's use at a node, (k,)."""
    own, v = level_likelihood(use[:, node], guess)
    gain = spread.of_new[node] ** 2 / (spread.of_new[node] ** 2 + v)
    return spread.mean[node] + gain * (own - spread.mean[node]), gain * v
