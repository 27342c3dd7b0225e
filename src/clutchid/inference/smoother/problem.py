"""Multiple shooting as a least-squares problem: linearised at a point and condensed to its free parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from clutchid.inference.problem import Problem, prior_rows
from clutchid.inference.smoother.rows import (
    Eliminated,
    LinearisedWindows,
    Sensors,
    eliminate,
    first_rows,
    link_costs,
    link_rows,
    stacked_factor,
    window_rows,
)
from clutchid.log import FloatArray
from clutchid.numerics.failure import Failure
from clutchid.numerics.least_squares import triangular
from clutchid.numerics.threads import map_pairs
from clutchid.simulation.parameter_map import ParameterMap
from clutchid.simulation.windows import Track


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedWindows:
    """The windows of a track at a point: extrapolated linearisation, and final states and costs.

    `ends` (windows, n) and `costs` (windows,) come from the last simulation, with the linear change since then.
    `distance` (windows,) is the length of that change in standard deviations of residuals and final state.
    """

    linearised: LinearisedWindows
    ends: FloatArray
    costs: FloatArray
    distance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Rows of a track at a point: prior of the first state, windows, and links between them."""

    first: FloatArray
    windows: SimulatedWindows
    links: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedProblem:
    """The problem linearised at a point: prior rows ``[theta | r]``, chains, and the cost (sum of losses).

    With fixed theta the chains have no columns for it.
    """

    x: FloatArray
    X: tuple[FloatArray, ...]
    prior: FloatArray
    chains: tuple[Chain, ...]
    cost: float


def linearise(problem: Problem, x: FloatArray, X: Sequence[FloatArray]) -> LinearisedProblem | Failure:
    """Linearise at parameters `x` and window starts `X`, one array per track; a `Failure` if a simulation fails."""
    parameter_maps = problem.parameter_maps(x)
    if isinstance(parameter_maps, Failure):
        return parameter_maps
    simulated = []
    for track, starts in zip(problem.tracks, X, strict=True):
        linearised = linearise_windows(problem, track, parameter_maps, starts, range(len(track.windows)))
        if isinstance(linearised, Failure):
            return linearised
        simulated.append(SimulatedWindows(linearised, linearised.end, linearised.cost, np.zeros(len(track.windows))))
    cost = total_cost(problem, parameter_maps, x, X, simulated)
    return assemble(problem, parameter_maps, (x, X), simulated, cost) if np.isfinite(cost) else NOT_FINITE


def linearise_windows(
    problem: Problem,
    track: Track,
    parameter_maps: Mapping[str, ParameterMap],
    starts: FloatArray,
    places: Sequence[int],
) -> LinearisedWindows | Failure:
    """Linearise the windows `places` of a track at `starts`."""
    mapped = parameter_maps[problem.stems[track.log]]
    sensors = Sensors.of(track, mapped, problem.measure, problem.noise)
    work = partial(window_rows, track, mapped=mapped, sensors=sensors)
    rows = []
    for window in map_pairs(work, [track.windows[i] for i in places], [starts[i] for i in places]):
        if isinstance(window, Failure):
            return window
        rows.append(window)
    return LinearisedWindows.stack(rows)


def assemble(
    problem: Problem,
    parameter_maps: Mapping[str, ParameterMap],
    at: tuple[FloatArray, Sequence[FloatArray]],
    simulated: Sequence[SimulatedWindows],
    cost: float,
) -> LinearisedProblem:
    """The linearised problem at a point with simulated windows and known cost."""
    x, X = at
    chains = []
    for track, sigma, starts, windows in zip(problem.tracks, problem.sigmas, X, simulated, strict=True):
        mapped = parameter_maps[problem.stems[track.log]]
        first, _ = first_rows(track, starts[0], mapped, "pressure_a" in problem.measure, problem.noise)
        links = link_rows(windows.linearised, windows.ends, starts, sigma, mapped.actuator, problem.noise.outlier)
        chains.append(Chain(first, windows, links))
    return LinearisedProblem(x, tuple(X), prior_rows(problem, x), tuple(chains), cost)


#: Answer for a point whose cost is not finite.
NOT_FINITE = Failure("the cost is not finite")


def total_cost(
    problem: Problem,
    parameter_maps: Mapping[str, ParameterMap],
    x: FloatArray,
    X: Sequence[FloatArray],
    simulated: Sequence[SimulatedWindows],
) -> float:
    """Cost of a point with simulated windows."""
    total = float(np.sum(prior_rows(problem, x)[:, -1] ** 2))
    for track, sigma, starts, windows in zip(problem.tracks, problem.sigmas, X, simulated, strict=True):
        mapped = parameter_maps[problem.stems[track.log]]
        total += first_rows(track, starts[0], mapped, "pressure_a" in problem.measure, problem.noise)[1]
        total += float(np.sum(windows.costs + link_costs(windows.ends, starts, sigma, problem.noise.outlier)))
    return total


def data_factor(problem: Problem, linear: LinearisedProblem) -> FloatArray:
    """Triangular factor ``[R | q]`` of the rows of the data alone, in theta after elimination of the states."""
    without = replace(linear, prior=linear.prior[:0])
    return condense(problem, without)[0]


def condense(
    problem: Problem, linear: LinearisedProblem, damping: Sequence[FloatArray] | None = None
) -> tuple[FloatArray, list[Eliminated]]:
    """Triangular factor ``[R | q]`` in theta after elimination of the states, and the eliminated chains.

    `damping` of the window starts: one array per track. With fixed theta the factor is empty.
    """
    names = problem.actuator.states
    weight = np.diag([row.step for row in problem.actuator.state_rows.values()])
    chains = []
    for track, chain in enumerate(linear.chains):
        windows = chain.windows.linearised.state_rows
        if damping is not None:
            damped = np.zeros_like(windows)
            damped[:, :, : len(names)] = np.sqrt(damping[track])[:, None, None] * weight
            windows = np.concatenate([windows, damped], axis=1)
        chains.append(eliminate(chain.first, windows, chain.links))
    size = linear.chains[0].first.shape[1] - len(names) - 1
    if size == 0:
        return np.zeros((0, 1)), chains
    theta_rows = [stacked_factor(chain.windows.linearised.theta_rows) for chain in linear.chains]
    factor = triangular(np.vstack([linear.prior, *theta_rows, *(chain.rows for chain in chains)]))
    return factor[: size + 1], chains
