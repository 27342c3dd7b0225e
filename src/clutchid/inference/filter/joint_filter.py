"""The joint filter of an actuator: how it is made, its state, and pure functions that start it and follow samples."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernels_in
from clutchid.inference.filter.setup import (
    BESIDE,
    LAG,
    LAG_OF,
    OFFSET_OF,
    STATE,
    WEIGHT,
    FilterArrays,
    FilterOutput,
    FilterState,
    FreeArrays,
    Intervals,
    SettingsArrays,
    Window,
    derived_arrays,
    first_state,
    intervals,
    measured_values,
    model_arrays,
    scratch,
    sensor_rows,
)
from clutchid.inference.uncertainty.coordinates import Coordinate
from clutchid.log import FloatArray, IntArray
from clutchid.log.states import SENSORS
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import few_suffice, preparation_kernel, step
from clutchid.numerics.failure import Failure
from clutchid.simulation.noise import Noise, start_deviations
from clutchid.simulation.parameter_map import ParameterMap, parameter_map
from clutchid.simulation.plan import OUTSIDE, Segment
from clutchid.simulation.run import Columns, columns, inputs_of
from clutchid.simulation.stiffness import AS_PLANNED, Pace
from clutchid.simulation.windows import Track


@dataclass(frozen=True, slots=True)
class JointSettings:
    """Settings of the joint filter.

    Parameters
    ----------
    every
        Samples from one correction to the next, at least 1.
    spacing : s
        Time from one sample to the next.
    least_speed : m/s
        The parameters adapt only while the piston is faster.
    """

    every: int = 10
    spacing: float = 1e-3
    least_speed: float = 5e-3


@dataclass(frozen=True, slots=True, eq=False)
class MovingColumns:
    """The columns that move between corrections, [Gamma | Phi], see `transition`.

    `of_model` and `of_sensors` are the columns in S of the free parameters of the model and of the sensors, which have
    the first and the last responses; between them are `window` load weights of those that are free, whose basis
    functions and columns in S are `weight_bases` and `weight_columns`, by their place in the stroke. `which` are the
    columns of the parameters, for the generated step.
    """

    of_model: IntArray
    of_sensors: IntArray
    weight_bases: IntArray
    weight_columns: IntArray
    window: int
    which: Columns

    @property
    def responses(self) -> int:
        """Number of columns of Gamma."""
        return self.of_model.size + self.window + self.of_sensors.size

    def of_window(self, first: int) -> IntArray:
        """The column in S of each column of Gamma, for a window from the free load weight number `first`."""
        weights = self.weight_columns[first : first + self.window]
        return np.concatenate([self.of_model, weights, self.of_sensors])

    def columns(self) -> Columns:
        """Columns of the generated step, with a window of its own, which is not placed."""
        weights = self.of_model.size + np.arange(self.window)
        return replace(self.which, table_basis=self.weight_bases[: self.window].copy(), table_column=weights)

    def response(self, column: int) -> int:
        """The column of Gamma of a parameter of a sensor with this column in S; -1 for none."""
        at = np.flatnonzero(self.of_sensors == column)
        return self.of_model.size + self.window + int(at[0]) if at.size else -1


def _moving_columns(which: Columns, free: FreeArrays) -> MovingColumns:
    """The columns that move of a filter whose free parameters are `which` in S."""
    places, order = free.places, np.lexsort(free.pieces[which.table_basis].T[::-1])
    no_weight, sensors = places[:, WEIGHT] < 0, np.maximum(places[:, LAG_OF], places[:, OFFSET_OF]) >= 0
    of_model, of_sensors = np.flatnonzero(no_weight & ~sensors), np.flatnonzero(no_weight & sensors)
    bases, at = which.table_basis[order], np.arange(free.pieces.max(initial=0) + 1)
    first, last = free.pieces[bases].T[:, :, None]
    acting = int(((first <= at) & (at <= last)).sum(axis=0).max(initial=0))
    return MovingColumns(
        of_model, of_sensors, bases, which.table_column[order], min(acting + BESIDE, bases.size),
        replace(which, fill_column=np.searchsorted(of_model, which.fill_column)),
    )  # fmt: skip


class Considered(NamedTuple):
    """Parameters that are not known and do not adapt, by their effect on the states of the model in SI, (n, c) each.

    `start` are the derivatives of the first state with respect to each in its standard deviations, `rate` those of the
    states' rates of change.
    """

    start: FloatArray
    rate: FloatArray


#: Module of the recursion of the Kalman filter.
_RECURSION = "clutchid.inference.filter.recursion"


@dataclass(frozen=True, slots=True, eq=False)
class JointFilter:
    """The joint filter of an actuator, as `joint_filter` makes it.

    `mapped` has the actuator at the means of the free parameters, `which` their columns in S and `moving` those that
    move, which the lags of `sensors` name; `free` is what is fixed about them, `drifts` (k, d) the root of what their
    covariance gains in a stroke. With `few`, the model's step for few parameters computes all derivatives. What is
    `considered` acts on no mean.
    """

    mapped: ParameterMap
    which: Columns
    moving: MovingColumns
    coordinates: tuple[Coordinate, ...]
    measure: tuple[str, ...]
    noise: Noise
    settings: JointSettings
    free: FreeArrays
    drifts: FloatArray
    pace: Pace
    sensors: IntArray
    few: bool
    considered: Considered | None = None

    def si(self, theta: FloatArray) -> dict[str, float]:
        """Values of the free parameters in SI by name."""
        return {c.base: c.si(value) for c, value in zip(self.coordinates, theta.tolist(), strict=True)}

    def actuator(self, theta: FloatArray) -> Actuator:
        """The actuator at theta.

        Raises
        ------
        ParameterError
            If values contradict each other.
        """
        return self.mapped.actuator.replace(self.si(theta))


def joint_filter(
    actuator: Actuator,
    coordinates: Sequence[Coordinate],
    bounds: tuple[FloatArray, FloatArray],
    measure: Sequence[str],
    noise: Noise,
    settings: JointSettings,
    *,
    drifts: FloatArray | None = None,
    pace: Pace = AS_PLANNED,
    considered: Considered | None = None,
) -> JointFilter:
    """The joint filter of an actuator.

    Parameters
    ----------
    actuator : Actuator
        Its values are those of all parameters that are not free.
    coordinates : k coordinates
        The free parameters.
    bounds : (k,), (k,)
        Bounds of theta.
    measure : 'position', 'pressure_a'
        Measured columns in use.
    noise : Noise
        Of sensors and model; samples within its `memory` have the information of one.
    drifts : (k, d), optional
        Root of the covariance that theta gains in a stroke, lower trapezoidal; by default none. See `drifted`.
    pace
        Integration steps by position and speed, see `clutchid.simulation.stiffness.pace`; by default those of the
        segment.
    considered : Considered, optional
        Parameters that widen what is said to be uncertain.
    """
    k, names = len(coordinates), [c.base for c in coordinates]
    mean = actuator.replace({c.base: c.si(0.0) for c in coordinates})
    mapped = parameter_map(mean, names, range(k), np.ones(k), k)
    which, free = columns(mean, names), _free_arrays(mean, coordinates, bounds, measure)
    moving, sensors = _moving_columns(which, free), sensor_rows(mapped, measure)
    few = few_suffice(mean.model, which.fill_slot.tolist())
    sensors[:, LAG] = [moving.response(j) for j in sensors[:, LAG].tolist()]
    return JointFilter(
        mapped=mapped,
        which=which,
        moving=moving,
        coordinates=tuple(coordinates),
        measure=tuple(measure),
        noise=noise,
        settings=settings,
        free=free,
        drifts=np.zeros((k, 0)) if drifts is None else np.ascontiguousarray(drifts),
        pace=pace,
        sensors=sensors,
        few=few,
        considered=considered,
    )


def _free_arrays(
    actuator: Actuator, coordinates: Sequence[Coordinate], bounds: tuple[FloatArray, FloatArray], measure: Sequence[str]
) -> FreeArrays:
    weights, parameters = actuator.load.names, actuator.parameter_names
    lags, offsets = ([getattr(SENSORS[name], kind) for name in measure] for kind in ("lag", "offset"))
    numbers = [
        (c.mean, c.width, float(c.positive), c.low, c.high, low, high)
        for c, low, high in zip(coordinates, *(side.tolist() for side in bounds), strict=True)
    ]
    places = [
        [names.index(c.base) if c.base in names else -1 for names in (weights, parameters, lags, offsets)]
        for c in coordinates
    ]
    acting = np.any(actuator.load.coefficients != 0.0, axis=2)
    pieces = [(int(a.argmax()), int(a.size - 1 - a[::-1].argmax())) for a in acting]
    places_array = np.array(places, dtype=np.int64).reshape(-1, 4)
    return FreeArrays(np.array(numbers).reshape(-1, 7), places_array, np.array(pieces))


@dataclass(frozen=True, slots=True)
class Diverged(Failure):
    """The filter left the finite numbers at `sample` of the segment, with what it knows of the parameters before."""

    sample: int


class JointInputs(NamedTuple):
    """A segment for the filter: its intervals, and the measurements (samples, sensors), NaN for none."""

    intervals: Intervals
    values: FloatArray


class JointPass(NamedTuple):
    """Result of the filter over some samples: state after them, and by sample innovations and states of the model.

    `errors` (samples, sensors, 2) are innovations in SI with their variances, NaN where nothing was corrected; `states`
    (samples, n) are those after the correction, and `deviations` (samples, n) their standard deviations, NaN where no
    correction was due.
    """

    state: FilterState
    errors: FloatArray
    states: FloatArray
    deviations: FloatArray


def inputs(joint: JointFilter, track: Track) -> JointInputs:
    """A segment of a recording for the filter."""
    inputs_of(track.segment, joint.mapped.actuator.model)
    arrays = intervals(track.segment, joint.mapped.actuator, joint.noise, joint.measure)
    return JointInputs(arrays, measured_values(track, joint.measure, joint.measure))


def init(
    joint: JointFilter,
    segment: Segment,
    theta: FloatArray,
    T: FloatArray,
    G: FloatArray | None = None,
    wear: IntArray | None = None,
) -> FilterState:
    """State at the start of a segment.

    Parameters
    ----------
    theta : (k,)
        Mean of the free parameters.
    T : (k, k)
        Square root of their covariance T T', lower triangular.
    G : (k, c), optional
        Derivatives of their error with respect to what is considered, by default 0.
    wear : (1,), optional
        Columns of drift that T has still to gain, see `FilterState`; by default none.
    """
    k, responses = theta.size, joint.moving.responses
    none = np.zeros(1, dtype=np.int64)
    mapped = parameter_map(joint.actuator(theta), joint.mapped.bases, range(k), np.ones(k), k)
    y_max = mapped.actuator.parameters.y_max
    segment = replace(segment, position_start=min(max(segment.position_start, -OUTSIDE), y_max + OUTSIDE))
    L = np.diag(start_deviations(segment, mapped.actuator, "pressure_a" in joint.measure, joint.noise))
    if not segment.vented:  # a piston that moves has the pressure of its friction beside that of the load
        (at_v, at_p_A), p = (mapped.actuator.states.index(name) for name in ("v", "p_A")), mapped.actuator.parameters
        L[at_p_A, at_v] = p.D_v / p.A_A * L[at_v, at_v]
    x, S = first_state(segment, mapped, joint.which, L, joint.measure)
    moved = np.eye(x.size, responses + x.size, responses)
    E = _with_outputs(joint, joint.considered.start) if joint.considered else np.zeros((x.size, 0))
    G = np.zeros((k, E.shape[1])) if G is None else G.copy()
    return FilterState(
        x, S, theta.copy(), np.array(T, order="C"), np.zeros(x.size), moved, none, E, G, np.zeros(x.size),
        np.zeros_like(moved), np.zeros(x.size), none.copy(), np.zeros(len(joint.measure)), none.copy(),
        none.copy() if wear is None else wear.copy(),
    )  # fmt: skip


def _with_outputs(joint: JointFilter, of_states: FloatArray) -> FloatArray:
    """Derivatives of x, (size, c), from those of the states of the model, whose sensors show them, (n, c)."""
    return np.ascontiguousarray(np.vstack([of_states, of_states[joint.sensors[:, STATE]]]))


def follow(
    joint: JointFilter, state: FilterState, segment: JointInputs, span: tuple[int, int], number: int = 0
) -> JointPass | Diverged:
    """Filter the samples of a segment from the first of `span` to before the last, from the state before the first.

    A recording that is filtered in parts has the same result bit by bit, if `number` is that of the first sample of the
    part in the recording.
    """
    after = FilterState._make(array.copy() for array in state)
    n, sensors, count = len(joint.mapped.actuator.states), len(joint.measure), span[1] - span[0]
    one_gain, nothing = np.empty((1, sensors, n + sensors + 1)), (np.empty((0, sensors, 1)), np.empty((0, 1)))
    output = FilterOutput(np.empty((count, sensors, 2)), np.empty((count, n)), np.empty((count, n)), one_gain, *nothing)
    call, arrays = _prepared(joint, after, (*segment.intervals, segment.values))
    failed: int = call(*calls(joint), after, arrays, segment.intervals, segment.values, output, (*span, number))
    values = [array for name, array in after._asdict().items() if name != "at_values"]
    finite = np.isfinite(np.concatenate(values, axis=None)).all()  # of all at once: a call takes longer than the work
    if failed >= 0 or not finite:
        at = failed if failed >= 0 else span[1] - 1
        return Diverged(f"the filter diverged at sample {at} of the segment", at)
    return JointPass(after, output.errors, output.states, output.deviations)


class _Latest(threading.local):
    """Filter that a thread used last, shapes of its state, and arrays that the kernel fills from theta anew.

    Samples may come one by one. Then the compiled kernel is called without Numba's look at the types of 79 arguments.
    """

    prepared: tuple[JointFilter | None, Any, tuple[tuple[int, ...], ...]] = (None, None, ())
    arrays: FilterArrays
    compiled: Any = None


_latest = _Latest()


def _prepared(joint: JointFilter, state: FilterState, inputs: Sequence[NDArray[Any]]) -> tuple[Any, FilterArrays]:
    """The kernel, and its arrays; a kernel without types, as where Numba is switched off, is called as it is."""
    kernel, shapes = kernels_in(_RECURSION).follow_segment, (state.x.shape, state.T.shape)
    before, before_kernel, before_shapes = _latest.prepared
    if before is not joint or before_kernel is not kernel or before_shapes != shapes:
        _latest.prepared, _latest.arrays, _latest.compiled = (joint, kernel, shapes), _arrays(joint, state), None
        return kernel, _latest.arrays
    overloads = getattr(kernel, "overloads", {})
    if _latest.compiled is None and len(overloads) == 1:
        (only,) = overloads.values()
        _latest.compiled = only.entry_point
    alike = _latest.compiled is not None and all(array.flags.c_contiguous for array in inputs)
    return _latest.compiled if alike else kernel, _latest.arrays


def drifted(joint: JointFilter, T: FloatArray, wear: IntArray) -> FloatArray:
    """Square root (k, k) of the covariance of the free parameters with the columns of drift that are still to be added.

    After a stroke it is a root of T T' + drifts drifts'; `wear` is that of `FilterState`.
    """
    after, left, turns = T.copy(), wear.copy(), np.empty((2, T.shape[0]))
    while left[0] > 0:
        kernels_in(_RECURSION).add_drift(after, joint.drifts, left, turns)
    return after


def calls(joint: JointFilter) -> tuple[Any, Any]:
    """The generated step of the model, and what computes its constants."""
    model = joint.mapped.actuator.model
    return step(model, joint.few), preparation_kernel(model, joint.few)


def covariance(joint: JointFilter, at: FilterState) -> FloatArray:
    """Covariance of x and theta, shape (size + k, size + k)."""
    k, moving = at.theta.size, joint.moving
    slopes = np.array([c.slope(value) for c, value in zip(joint.coordinates, at.theta.tolist(), strict=True)])
    S = at.S
    for moved, first in [(at.at_moved, at.at_first)] * int(at.due[0] > 0) + [(at.moved, at.first)]:
        S = moved[:, moving.responses :] @ S
        S[:, moving.of_window(int(first[0]))] += moved[:, : moving.responses]
    root = np.block([[S[:, :k] * slopes @ at.T, S[:, k:]], [at.T, np.zeros((k, at.x.size))]])
    result: FloatArray = root @ root.T
    return result


def _source(joint: JointFilter, size: int) -> FloatArray:
    """Increase of E from one correction to the next, (size, c)."""
    if joint.considered is None:
        return np.zeros((size, 0))
    rate, seconds = joint.considered.rate, joint.settings.spacing * joint.settings.every
    return np.ascontiguousarray(np.vstack([seconds * rate, np.zeros((size - len(rate), rate.shape[1]))]))


def _arrays(joint: JointFilter, state: FilterState) -> FilterArrays:
    """Arrays of the recursion: derived from theta, settings, and scratch."""
    s, moving, actuator = joint.settings, joint.moving, joint.mapped.actuator
    n, names = len(actuator.states), actuator.states
    model = model_arrays(joint.mapped, moving.columns(), moving.responses + state.x.size, joint.few)
    own = model._replace(p=model.p.copy(), load=model.load.copy())
    deviations = [joint.noise.of_samples(name, s.spacing * s.every) for name in joint.measure]
    derived = derived_arrays(actuator, joint.measure, deviations, state.theta.size)
    columns = moving.of_window(0)
    placed = columns[moving.of_model.size : moving.of_model.size + moving.window]
    window = Window(own.table_basis, columns, placed, moving.weight_bases, moving.weight_columns)
    settings = SettingsArrays(
        s.every,
        float(joint.noise.outlier),
        s.least_speed,
        names.index("v"),
        names.index("y"),
        -1,
        _source(joint, state.x.size),
        joint.drifts,
        0.5 * s.every * s.spacing,
        s.spacing,
    )
    room = scratch(state.x.size, state.S.shape[1], state.T, n, len(joint.measure))
    return FilterArrays(own, joint.free, derived, joint.sensors, settings, joint.pace, window, room)
