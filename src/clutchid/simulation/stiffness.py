"""Number of integration steps: of an interval between two samples, and in each range of positions and speeds."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernels_in
from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import Model, kernels, parameter_names, state_rows
from clutchid.model.own import OwnModel
from clutchid.model.weighted_load import Load
from clutchid.parameters import Parameters
from clutchid.simulation.partition import Partition
from clutchid.strokes.stroke import QUICKEST

#: Classical RK4 is stable for real eigenvalues down to -2.785 / h; 2.5 leaves a margin.
STABLE_STEP = 2.5

#: More steps in an interval mean that a parameter or a unit is wrong.
MOST_SUBSTEPS = 1000

#: Fastest motion of the piston in m/s: a full stroke of a clutch actuator in a tenth of a second.
TOP_SPEED = 0.3

#: Fastest motion in m/s after resets that conserve the masses of air: the pressure jumps, by bars at large errors.
_RESET_SPEED = 0.9


#: Positions of the whole stroke.
_EVERYWHERE = -np.inf, np.inf

#: Slope of a load in N/m up to which loads count as one: somewhat more than that of the paper.
_USUAL_SLOPE = 2.0**20

#: Number and length in s of the steps in which own states settle: longer than a stroke; overshoot is halved each time.
_SETTLING_STEPS, _SETTLING_STEP = 20, 1e-2


def top_speed(partition: Partition | None) -> float:
    """Fastest motion in m/s for which the integration must be stable."""
    if partition is None or partition.parts == 1 or partition.carry == "p":
        return TOP_SPEED
    return _RESET_SPEED


def stiffness(actuator: Actuator, speed: float = TOP_SPEED) -> float:
    """Largest eigenvalue magnitude in 1/s of the model's Jacobian over its operating range, up to `speed` in m/s.

    It is bounded from above, within some 1 %, by the norm of a high power of the Jacobian. The range includes a full
    stroke in `QUICKEST` s if that is faster.

    Examples
    --------
    Chamber B at full stroke is the stiffest part of the paper's model:

    >>> 2000 < stiffness(Actuator()) < 2500
    True
    """
    return local_stiffness(actuator, _top(speed, actuator.parameters), _EVERYWHERE)


def _top(speed: float, p: Parameters) -> float:
    return max(speed, p.y_max / QUICKEST)


def stiffness_by_slope(actuator: Actuator, steepest: float, speed: float = TOP_SPEED) -> float:
    """`stiffness` with a load that rises or falls by `steepest`: the same for all loads that are no steeper.

    Examples
    --------
    The load of a clutch has no influence on it:

    >>> f"{stiffness_by_slope(Actuator(), _USUAL_SLOPE) / stiffness(Actuator()):.3f}"
    '1.000'
    """
    # a rising load adds to the stops: that of a usual one is a thirtieth of theirs
    slopes = (-steepest,) if steepest == _USUAL_SLOPE else (-steepest, steepest)
    p = actuator.parameters
    loads = [_line(slope, p.y_max) for slope in slopes]
    return max(_radius(actuator.model, p, actuator.own, load, _top(speed, p), _EVERYWHERE) for load in loads)


@lru_cache(maxsize=64)
def _line(slope: float, y_max: float) -> Load:
    return Load(tuple(slope * y_max * i / 3 for i in range(4)), (0.0, y_max), basis="b-spline")


@lru_cache(maxsize=1024)
def steepest_slope(load: Load) -> float:
    """One of the `steepest_slopes`: that of a load."""
    return float(steepest_slopes(load.breakpoints, load.combined()))


def steepest_slopes(breakpoints: FloatArray, load: FloatArray) -> FloatArray:
    """Powers of two in N/m that no slope of a load exceeds, at least `_USUAL_SLOPE`; (...) for `load` (..., s, 4).

    A slope, a parabola in each piece, lies between its Bézier points.
    """
    width = np.concatenate([[0.0], np.diff(breakpoints), [0.0]])
    first, half = load[..., 1], width * load[..., 2]
    controls = np.abs([first, first + half, first + 2.0 * half + 3.0 * width**2 * load[..., 3]])
    return np.asarray(np.exp2(np.ceil(np.log2(np.maximum(controls.max(axis=(0, -1)), _USUAL_SLOPE)))))


def local_stiffness(actuator: Actuator, speed: float, reach: tuple[float, float]) -> float:
    """`stiffness` over positions within `reach` in m and speeds up to `speed` in m/s.

    Examples
    --------
    Chamber B is large while the piston rests:

    >>> local_stiffness(Actuator(), 0.1, (0.0, 1e-3)) < 0.6 * stiffness(Actuator())
    True
    """
    return _radius(actuator.model, actuator.parameters, actuator.own, actuator.load, speed, reach)


@lru_cache(maxsize=1024)
def _radius(
    model: Model, p: Parameters, own: tuple[float, ...], load: Load, speed: float, reach: tuple[float, float]
) -> float:
    values, tables = np.append(p.array(), own) if own else p.array(), (load.breakpoints, load.combined())
    x, u = _operating_points(model, speed, reach, (p.P_0, p.P_S, p.T_0, p.y_max, p.d_stop))
    if isinstance(model, OwnModel) and model.states:
        x, u = _with_own_states(x.copy(), u, model, values, tables)
    _, jacobian = _linearised(x, u, model, values, tables)
    radius: float = kernels_in("clutchid.numerics.spectral_radius").spectral_radius(jacobian, _scale(model))
    return radius


@lru_cache(maxsize=64)
def _scale(model: Model) -> FloatArray:
    return np.array([row.scale for row in state_rows(model).values()])


@lru_cache(maxsize=64)
def _operating_points(
    model: Model, speed: float, reach: tuple[float, float], of_actuator: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """States (n, n_states) and inputs at which the Jacobian is taken, for P_0, P_S, T_0, y_max and d_stop."""
    P_0, P_S, T_0, y_max, d_stop = of_actuator
    near = 5e-4 * P_0
    places = (-2 * d_stop, d_stop, y_max / 2, y_max - d_stop, y_max + 2 * d_stop)
    ranges = {
        "y": sorted({min(max(place, reach[0]), reach[1]) for place in places}),
        "v": (-speed, 0.0, speed),
        "p_A": (P_0 + near, (P_0 + P_S) / 2, P_S - near),
        "p_B": (P_0 - near, P_0 + near, 1.3 * P_0),
        "T_A": (1.3 * T_0,),
        "T_B": (T_0,),
        "p_S": (P_S,),
        "p_G": (P_S,),
    }
    states = [*state_rows(model)]
    values = [ranges.get(name, (0.0,)) for name in states]
    corners = _corners(tuple(map(len, values)), *map(states.index, ("p_A", "p_B")))
    x = np.array([*chain.from_iterable(values)])[corners]
    duties = np.repeat(((1.0, 0.0), (0.0, 1.0)), len(x) // 2, axis=0)
    spools = [i for i, name in enumerate(states) if name in ("x_vs", "x_ve")]
    if spools:
        x[:, spools] = duties[:, : len(spools)]
    u = np.zeros((len(x), len(kernels(model).INPUTS)))
    u[:, :2] = duties
    return x, u


@lru_cache(maxsize=64)
def _corners(counts: tuple[int, ...], state: int, follower: int) -> NDArray[np.intp]:
    """Combinations of one value a state, twice, by the places of the values one after the other.

    The values of the `follower` go with those of a `state` that has as many: the pressures of the chambers meet only in
    the motion of the piston, and each with each would be at most 1.3 % stiffer (1,600 actuators drawn at random).
    """
    places = np.indices([1 if i == follower else count for i, count in enumerate(counts)]).reshape(len(counts), -1).T
    places[:, follower] = places[:, state]
    places += np.cumsum((0, *counts[:-1]))
    return np.ascontiguousarray(np.concatenate([places, places]))  # the kernel is compiled for rows


def _linearised(
    x: FloatArray, u: FloatArray, model: Model, values: FloatArray, tables: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Rates, shape (n, n_states), and Jacobians at the states `x`, with the constant inputs of each."""
    rates, jacobian = np.empty_like(x), np.empty((*x.shape, x.shape[1]))
    kernels(model).linearise(x, u, values, *tables, rates, jacobian)
    return rates, jacobian


def _with_own_states(
    x: FloatArray, u: FloatArray, model: OwnModel, values: FloatArray, tables: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """The states `x` with those of an own model where they start, and where they settle while the others stay.

    They move by the linearly implicit Euler method, which no stiffness makes unstable.
    """
    rows, names = state_rows(model), parameter_names(model)
    own = [i for i, name in enumerate(rows) if name in model.states]
    starts = [row.starts_at for name, row in rows.items() if name in model.states]
    x[:, own] = [values[names.index(start)] if start else 0.0 for start in starts]
    settled = x.copy()
    for _ in range(_SETTLING_STEPS):
        rates, jacobian = _linearised(settled, u, model, values, tables)
        matrix = np.eye(len(own)) / _SETTLING_STEP - jacobian[:, own][:, :, own]
        good = np.all(np.isfinite(matrix), axis=(1, 2)) & np.all(np.isfinite(rates), axis=1)
        good[good] = np.abs(np.linalg.det(matrix[good])) > 0.0
        step = np.linalg.solve(matrix[good], rates[good][:, own, None])[:, :, 0]
        settled[np.ix_(good, own)] += step
    return np.concatenate([x, settled]), np.concatenate([u, u])


def stiffness_over(actuator: Actuator, bounds: Mapping[str, tuple[float, float]], speed: float = TOP_SPEED) -> float:
    """Largest `stiffness` within `bounds`, by coordinate search: each parameter in turn at both bounds, two passes.

    Load weights have no influence; combinations that contradict each other are left out.
    """
    stiffest, rate = actuator, stiffness(actuator, speed)
    moving = [(name, limit) for name, limits in bounds.items() for limit in limits if name not in actuator.load.names]
    for name, limit in moving * 2:
        with suppress(ParameterError):
            changed = stiffest.replace({name: limit})
            if (faster := stiffness(changed, speed)) > rate:
                stiffest, rate = changed, faster
    return rate


def substeps(dt: FloatArray, rate: float) -> NDArray[np.int32]:
    """Integration steps for each interval `dt` in s, so that no step exceeds `STABLE_STEP` / `rate`.

    Raises
    ------
    ParameterError
        If an interval would need more than `MOST_SUBSTEPS`.
    """
    steps = np.maximum(1.0, np.ceil(dt * rate / STABLE_STEP * (1 - 1e-9)))
    if not steps.max(initial=1.0) <= MOST_SUBSTEPS:
        raise ParameterError(
            f"the model is too stiff for this recording: its fastest mode, {rate:.3g} 1/s, needs {steps.max():.3g} "
            f"steps in an interval of {dt.max():.3g} s, at most {MOST_SUBSTEPS} are taken; check the mass, the "
            "volumes and the stiffnesses, their bounds, and the sample rate."
        )
    return steps.astype(np.int32)


#: Position in m, and shares of the stroke, that separate ranges of different stiffness; how far in m the piston may be
#: from its estimate.
_NEAR_REST, _SHARES, _REACH = 2e-3, (0.6, 0.9), 1e-3

#: Speeds in m/s that separate ranges of different stiffness, and how much faster the piston may become in an interval.
SPEEDS, _GAIN = (0.02, 0.05, 0.1, 0.2), 0.05

#: Positions in m and speeds in m/s that separate ranges, and the integration steps a second in each; see `pace`.
Pace = tuple[FloatArray, FloatArray, FloatArray]

#: The steps of the plan, whatever the state.
AS_PLANNED: Pace = (np.zeros(0), np.zeros(0), np.zeros((0, 0)))


def pace(actuator: Actuator, margin: float) -> Pace:
    """Steps a second by position and speed, for `margin` times the stiffness of an actuator.

    Most of its stiffness is that of the friction at full speed: at a tenth of it one step a millisecond is enough.
    """
    y_max = actuator.parameters.y_max
    positions = np.array([_NEAR_REST, *(share * y_max for share in _SHARES)])
    reaches = zip([-np.inf, *positions - _REACH], [*positions + _REACH, np.inf], strict=True)
    speeds = [min(speed + _GAIN, TOP_SPEED) for speed in (*SPEEDS, TOP_SPEED)]
    rates = [[local_stiffness(actuator, speed, reach) for speed in speeds] for reach in reaches]
    return positions, np.array(SPEEDS), margin / STABLE_STEP * np.array(rates)
