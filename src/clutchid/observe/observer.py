"""An observer: a calibrated actuator, what of it adapts, and the filter that does it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from clutchid.errors import DataError
from clutchid.filter.joint_filter import JointInputs, JointPass, JointState, follow, init
from clutchid.filter.joint_setup import JointFilter, JointSettings, joint_filter
from clutchid.filter.pace import pace
from clutchid.filter.setup import intervals
from clutchid.log import HOLE, INPUTS, FloatArray, Log
from clutchid.measured import SENSORS
from clutchid.model.actuator import Actuator
from clutchid.model.weighted_load import Load
from clutchid.numerics.failure import Failure
from clutchid.observe.methods import method_for
from clutchid.observe.prior import online_prior
from clutchid.observe.strokes import NO_STROKES, Strokes, count_strokes
from clutchid.observe.supply import Supply, supply_of
from clutchid.observe.tail import EMPTY, Mask, Tail, last_samples, measured_values, segment_of, usable_positions
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.noise import Noise

#: Correlation time of what the model misses in s, and covariance that load weights and parameters gain in a stroke, as
#: a share of that of their prior. Provenance: docs/derivations.md.
MEMORY, DRIFT = 0.01, 2e-4

#: Factor on the stiffness of the calibrated actuator, whose parameters adapt.
MARGIN = 1.05

#: A duty cycle may be as far outside 0 to 1.
ROUNDING = 1e-9

#: Bounds of the adapting parameters in prior standard deviations.
BOUND = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class ObserverState:
    """What an observer knows between two samples.

    `theta` (k,) and `T` (k, m), a root of their covariance, are what is known of the parameters that adapt; `filter` is
    None before the first sample of a stretch. `deviations` (states,) are those of the last correction, NaN before it.
    `number` counts the samples of the stretch.
    """

    filter: JointState | None
    theta: FloatArray
    T: FloatArray
    tail: Tail
    deviations: FloatArray
    number: int = 0
    strokes: Strokes = NO_STROKES


class Observed(NamedTuple):
    """What an observer found in a block, by sample.

    `states` (n, states) in SI, NaN where no sample could be used; `deviations` (n, states) their standard deviations,
    NaN between corrections; `innovations` (n, 2) with their variances, NaN where nothing was corrected; `used` (n,)
    whether the position of a sample was usable.
    """

    time: FloatArray
    states: FloatArray
    deviations: FloatArray
    innovations: FloatArray
    used: Mask


@dataclass(frozen=True, slots=True, eq=False)
class Observer:
    """An observer of a calibrated actuator, as `observer` makes it.

    `missed` is how far off in N a load from position alone was on the calibration recordings, rms over the stroke;
    `supply` is None where the recorded supply pressure is not used.
    """

    actuator: Actuator
    method: str
    joint: JointFilter
    root: FloatArray
    spacing: float
    missed: float
    supply: Supply | None = None
    calibration: Calibration | None = None

    def load(self, state: ObserverState) -> Load:
        """The load as it is known in a state."""
        return self.joint.actuator(state.theta).load

    def load_deviation(self, state: ObserverState, position: FloatArray) -> FloatArray:
        """Standard deviation in N of that load at positions in m, shape (n,).

        It has parts that no recording makes smaller: what the model missed on the calibration recordings, and the
        accuracy of a recorded supply pressure.
        """
        load, basis = self.load(state), np.zeros((position.size, len(self.joint.coordinates)))
        functions = load.phi(position)
        for j, c in enumerate(self.joint.coordinates):
            if c.base in load.names:
                basis[:, j] = functions[:, load.names.index(c.base)] * c.slope(float(state.theta[j]))
        deviation: FloatArray = np.hypot(np.linalg.norm(basis @ state.T, axis=1), self.missed)
        if self.supply is None:
            return deviation
        return np.hypot(deviation, self.supply.load_deviation(self.actuator, load, position))


def observer(
    actuator: Actuator, method: str = "joint", spacing: float = 1e-3, calibration: Calibration | None = None
) -> Observer:
    """An observer of a calibrated actuator.

    Parameters
    ----------
    actuator : Actuator
        As calibrated; the observer starts from its load.
    method
        One of `clutchid.observe.methods.METHODS`.
    spacing : s
        Time from one sample to the next.
    calibration : Calibration, optional
        Its errors from position alone are part of every band.

    Raises
    ------
    ParameterError
        If there is no such method, or it does not take the actuator.
    """
    chosen = method_for(method, actuator)
    supply = supply_of(actuator, calibration) if chosen.corrects_supply else None
    measure = ("position",) if supply is None else ("position", "pressure_supply")
    free, root = online_prior(actuator, chosen.adapting(actuator), chosen.modes)
    k = len(free)
    settings = JointSettings(every=max(1, round(chosen.every * 1e-3 / spacing)), spacing=spacing)
    noise = Noise(
        measured={name: SENSORS[name].noise for name in measure},
        states={name: row.noise for name, row in actuator.state_rows.items()},
        memory=MEMORY,
    )
    limits = -BOUND * np.ones(k), BOUND * np.ones(k)
    return Observer(
        actuator=actuator,
        method=method,
        joint=joint_filter(
            actuator,
            free,
            limits,
            measure,
            noise,
            settings,
            np.sqrt(DRIFT) * root,
            pace(actuator, MARGIN),
            chosen.rule(actuator, free, root, spacing),
        ),
        root=root,
        spacing=spacing,
        missed=_missed(actuator, calibration),
        supply=supply,
        calibration=calibration,
    )


def _missed(actuator: Actuator, calibration: Calibration | None) -> float:
    """Error in N of a load from position alone of the calibration recordings, rms over the stroke."""
    if calibration is None or calibration.position_only is None:
        return 0.0
    position = np.linspace(0.0, actuator.parameters.y_max, 100)
    shift = calibration.position_only.shift((), list(actuator.load.names))
    return float(np.sqrt(np.mean((actuator.load.phi(position) @ shift) ** 2)))


def start(observer: Observer) -> ObserverState:
    """The state before the first sample."""
    return ObserverState(None, np.zeros(len(observer.root)), observer.root.copy(), EMPTY, _unknown(observer))


def blank(observer: Observer) -> JointState:
    """A state of the filter with the shapes that all of its states have."""
    at_rest = Tail(np.zeros(1), np.zeros((1, 2)), np.zeros(1), np.zeros(1))
    segment = segment_of(at_rest, observer.joint.mapped.actuator)
    return init(observer.joint, segment, np.zeros(len(observer.root)), observer.root)


def _unknown(observer: Observer) -> FloatArray:
    return np.full(len(observer.actuator.states), np.nan)


def observe(observer: Observer, state: ObserverState, block: Log) -> tuple[ObserverState, Observed]:
    """Follow the samples of a block, from the state before its first.

    A stretch without holes starts with its first position. Blocks of any length give the same numbers, bit by bit.

    Raises
    ------
    DataError
        If the block lacks a column, begins before the last sample, or has a duty cycle outside 0 to 1.
    """
    _check(state, block)
    duties = np.column_stack([block[name] for name in INPUTS])
    n = len(block)
    states = np.full((n, len(observer.actuator.states)), np.nan)
    deviations = states.copy()
    innovations, used = np.full((n, 2), np.nan), np.zeros(n, dtype=bool)
    known: Mask = np.isfinite(block["position"])
    supply = block.columns.get("pressure_supply", np.full(n, np.nan))
    for begin, b in _stretches(observer, block.time, duties):
        if not _continues(observer, state, block.time[begin], duties[begin]):
            state = _ended(observer, state)
        a = begin if state.filter is not None else begin + _first(known[begin:b])
        if a == b or not np.isfinite(duties[a]).all():
            continue
        new = Tail(block.time[a:b], duties[a:b], block["position"][a:b], supply[a:b])
        state, found, usable = _stretch(observer, state, new)
        if found is not None:
            states[a:b], deviations[a:b], innovations[a:b] = found.states, found.deviations, found.errors[:, 0]
            used[a:b] = usable
    strokes, _ = count_strokes(state.strokes, block.time, block["position"])
    state = replace(state, strokes=strokes)
    return state, Observed(block.time, states, deviations, innovations, used)


def _first(known: Mask) -> int:
    """Number of the first known sample, as many as there are if none is."""
    return int(np.argmax(np.append(known, True)))


def _check(state: ObserverState, block: Log) -> None:
    absent = [name for name in ("position", *INPUTS) if name not in block]
    if absent:
        raise DataError(f"{block.name}: no column '{absent[0]}'; it has {', '.join(block.columns)}.")
    if len(block) and state.tail.time.size and block.time[0] <= state.tail.time[-1]:
        raise DataError(
            f"{block.name}: begins at {block.time[0]:.6g} s, but the observer is at {state.tail.time[-1]:.6g} s; time "
            "must go on."
        )
    for name in INPUTS:
        outside = (block[name] < -ROUNDING) | (block[name] > 1.0 + ROUNDING)
        if outside.any():
            at = int(np.argmax(outside))
            raise DataError(
                f"{block.name}: {name} is {block[name][at]:.4g} at {block.time[at]:.6g} s; a duty cycle is from 0 to 1."
            )


def _stretches(observer: Observer, time: FloatArray, duties: FloatArray) -> list[tuple[int, int]]:
    """Ranges of samples with known inputs and without holes, and single samples without inputs."""
    known: Mask = np.all(np.isfinite(duties), axis=1)
    hole = np.diff(time) > HOLE * observer.spacing
    cuts = np.flatnonzero(hole | ~known[1:] | ~known[:-1]) + 1
    return [(a, b) for a, b in pairwise([0, *cuts.tolist(), time.size]) if b > a]


def _continues(observer: Observer, state: ObserverState, time: float, duties: FloatArray) -> bool:
    """Whether a sample goes on from the last one."""
    tail = state.tail.time
    return bool(tail.size and time - tail[-1] <= HOLE * observer.spacing and np.isfinite(duties).all())


def _ended(observer: Observer, state: ObserverState) -> ObserverState:
    """The state after a hole: what is known of the parameters stays."""
    return replace(state, filter=None, tail=EMPTY, deviations=_unknown(observer), number=0)


def _stretch(observer: Observer, state: ObserverState, new: Tail) -> tuple[ObserverState, JointPass | None, Mask]:
    """Follow new samples of a stretch; the state after them, what was found, and which positions were usable."""
    old = state.tail
    both = Tail(*(np.concatenate([a, b]) for a, b in zip(old, new, strict=True)))
    first, m, joint = old.time.size, both.time.size, observer.joint
    segment = segment_of(both, joint.mapped.actuator)
    usable = usable_positions(both.position)
    values = measured_values(both, usable, observer.supply.ratio if observer.supply else None)
    at = init(joint, segment, state.theta, state.T) if state.filter is None else state.filter
    given = JointInputs(intervals(segment, joint.mapped.actuator, joint.noise, joint.measure), values)
    found = follow(joint, at, given, (first, m), state.number - first)
    kept = last_samples(both, joint.mapped.actuator.parameters.T_pwm + 2.0 * observer.spacing)
    if isinstance(found, Failure):
        return _ended(observer, state), None, usable[first:]
    after, number = found.state, state.number + m - first
    corrected = np.flatnonzero(np.isfinite(found.deviations[:, 0]))
    deviations = found.deviations[corrected[-1]].copy() if corrected.size else state.deviations
    state = replace(state, filter=after, theta=after.theta, T=after.T, tail=kept, deviations=deviations, number=number)
    return state, found, usable[first:]
