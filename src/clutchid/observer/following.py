"""Follow samples as they arrive: block by block, through holes, frozen sensors and divergence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from clutchid.errors import DataError
from clutchid.inference.filter.joint_filter import Diverged, JointInputs, JointPass, drifted, follow, init
from clutchid.inference.filter.rules import RuleState
from clutchid.inference.filter.setup import intervals
from clutchid.log import HOLE, INPUTS, FloatArray, Log
from clutchid.observer.mismatch import mismatches
from clutchid.observer.observer import Observer, unknown
from clutchid.observer.rest import counted_from, new_stretch, rest_pace, watch_rest
from clutchid.observer.state import (
    EMPTY,
    Mask,
    ObserverState,
    RestWatch,
    Tail,
    last_samples,
    measured_values,
    segment_of,
    usable_positions,
)
from clutchid.strokes.stroke import Strokes, count_strokes

#: Shares of ambient and supply pressure beyond which the pressure in a chamber is that of a filter that has diverged.
PRESSURES = 0.01, 10.0

#: Most samples that are followed at once: where the filter diverges they are followed again.
MOST = 1000

#: A duty cycle may be as far outside 0 to 1.
ROUNDING = 1e-9


class Observed(NamedTuple):
    """Results of an observer in a block, by sample.

    Attributes
    ----------
    time : s, (n,)
        As in the recording.
    states : SI, (n, states)
        NaN where no sample could be used.
    deviations : SI, (n, states)
        Their standard deviations, NaN between corrections.
    innovations : m and m², (n, 2)
        Measured less predicted position, and its variance; NaN where nothing was corrected.
    used : (n,)
        Whether the position of a sample was usable.
    mismatch : 1, (n,)
        See `clutchid.observer.mismatch`; NaN where it does not move.
    leaking : (n,)
        Whether chamber A leaked at the end of the stroke before.
    rest : m, (n,)
        How far the vented rest has moved since the calibration, as known at that sample.
    no_zero : (n,)
        Whether the position has jumped, and no vented rest has shown its zero since: it is not used.
    """

    time: FloatArray
    states: FloatArray
    deviations: FloatArray
    innovations: FloatArray
    used: Mask
    mismatch: FloatArray
    leaking: Mask
    rest: FloatArray
    no_zero: Mask


def observe(observer: Observer, state: ObserverState, block: Log) -> tuple[ObserverState, Observed]:
    """Follow the samples of a block, from the state before its first.

    A stretch without holes starts with its first position. Where the filter diverges, it goes back to what it knew of
    the parameters at the end of the stroke before, and starts anew. Blocks of any length give the same numbers, bit by
    bit.

    Raises
    ------
    DataError
        If the block lacks a column, begins before the last sample, or has a duty cycle outside 0 to 1.
    """
    after, samples, _ = observe_strokes(observer, state, block)
    return after, samples


def observe_strokes(
    observer: Observer, state: ObserverState, block: Log
) -> tuple[ObserverState, Observed, list[ObserverState]]:
    """As `observe`, with the state at the end of each stroke in the block, as if the stretch ended there.

    Raises
    ------
    DataError
        As `observe`.
    """
    _check(state, block)
    n = len(block)
    duties = np.column_stack([block[name] for name in INPUTS])
    supply = block.columns.get("pressure_supply", np.full(n, np.nan))
    found, stretches = _nothing(observer, block.time), _stretches(observer, block.time, duties)
    rest, unzeroed, moves = _rests(observer, state, block, duties, stretches, found)
    counted = subtracted(observer, found.rest)
    samples = Tail(block.time, duties, np.where(found.no_zero, np.nan, block["position"] - counted), supply)
    strokes, ends = count_strokes(state.strokes, block.time, samples.position)
    judged, at_ends = 0, list[ObserverState]()
    for begin, end in stretches:
        if not _continues(observer, state, block.time[begin], duties[begin]):
            state = _ended(observer, state)
        cuts = {begin, end, *(i + 1 for i in ends if begin <= i < end), *(at for at in moves if begin < at < end)}
        for a, b in pairwise(sorted(cuts)):
            state = _counted(observer, state, float(counted[a]))
            state = _piece(observer, state, samples, (a, b), found)
            found.leaking[a:b] = state.leaking
            if b - 1 in ends:
                state = _stroke_ended(observer, _judged(observer, state, found, slice(judged, b)))
                at_ends.append(replace(_ended(observer, state), latest=float(block.time[b - 1])))
                judged = b
    state = _judged(observer, state, found, slice(judged, n))
    if n:
        latest = float(block.time[-1]) if np.isfinite(duties[-1]).all() else float("nan")
        state = replace(state, latest=latest)
    return replace(state, rest=rest, unzeroed=unzeroed, strokes=strokes), found, at_ends


def _stroke_ended(observer: Observer, state: ObserverState) -> ObserverState:
    """The state after a stroke, in which the clutch has worn: what is known of the parameters is kept."""
    T = drifted(observer.joint, state.T)
    state = replace(
        state, T=T, filter=state.filter and state.filter._replace(T=T), sound=(state.theta, T),
        strokes=Strokes(state.strokes.ended + 1),
    )  # fmt: skip
    return replace(state, leaking=observer.leaks(state))


def _judged(observer: Observer, state: ObserverState, found: Observed, samples: slice) -> ObserverState:
    """The state with the mismatch after some samples; fills that of `found`."""
    running = mismatches(observer, state.mismatch, found.states[samples], found.innovations[samples])
    found.mismatch[samples] = running
    known = running[np.isfinite(running)]
    return replace(state, mismatch=float(known[-1])) if known.size else state


def subtracted(observer: Observer, rest: FloatArray) -> FloatArray:
    """Value in m subtracted from the recorded position, for shifts of the vented rest in m."""
    return rest if observer.zero == "subtract" else np.zeros_like(rest)


def _rests(
    observer: Observer,
    state: ObserverState,
    block: Log,
    duties: FloatArray,
    stretches: Sequence[tuple[int, int]],
    found: Observed,
) -> tuple[RestWatch, tuple[float, ...], list[int]]:
    """State of the vented rest after a block, the jumps whose zero it has not shown, and the samples at which its shift
    is known anew; fills `found`.
    """
    watch, unzeroed, moves = state.rest, state.unzeroed, list[int]()
    before = observer.calibration.rest if observer.calibration else None
    pace = rest_pace(observer.spacing, observer.actuator.parameters.y_max)
    for begin, end in stretches:
        if begin > 0 or not block.time[begin] - state.latest <= HOLE * observer.spacing:
            watch = new_stretch(watch)
        found.rest[begin:end] = watch.shift
        found.no_zero[begin:end] = bool(unzeroed) and unzeroed[0] <= block.time[begin]  # a jump begins a stretch
        # a rest settles all jumps before it: the first of them says enough
        unzeroed = (*unzeroed[:1], *(jump for jump in unzeroed[1:] if jump > block.time[end - 1]))
        if before is None or not np.isfinite(duties[begin]).all():
            continue
        watch, changes = watch_rest(watch, before, pace, block["position"][begin:end], duties[begin:end])
        for at, shift in changes:
            found.rest[begin + at : end], found.no_zero[begin + at : end] = shift, False
            moves.append(begin + at)
            unzeroed = tuple(jump for jump in unzeroed if jump >= block.time[begin + at - 1])
    return watch, unzeroed, moves


def _counted(observer: Observer, state: ObserverState, zero: float) -> ObserverState:
    """The state at a sample whose position counts from another zero in m than that of the sample before."""
    states = observer.actuator.states
    sensor = len(states) + observer.joint.measure.index("position")
    return counted_from(state, zero, states.index("y"), sensor)


def _nothing(observer: Observer, time: FloatArray) -> Observed:
    """Results of samples of which none can be used, to be filled."""
    n = time.size
    states = np.full((n, len(observer.actuator.states)), np.nan)
    used, leaking, no_zero = np.zeros((3, n), dtype=bool)
    innovations, mismatch = np.full((n, 2), np.nan), np.full(n, np.nan)
    return Observed(time, states, states.copy(), innovations, used, mismatch, leaking, np.zeros(n), no_zero)


def _piece(
    observer: Observer, state: ObserverState, samples: Tail, span: tuple[int, int], found: Observed
) -> ObserverState:
    """Follow a part of a stretch, from each sample after one at which the filter diverged anew."""
    a, b = span
    while a < b:
        if state.filter is None:
            a += _first(np.isfinite(samples.position[a:b]))
        if a == b or not np.isfinite(samples.duties[a]).all():
            break
        state, done, usable, count = _followed(observer, state, Tail(*(x[a : min(b, a + MOST)] for x in samples)))
        if done is not None:
            end = a + len(done.states)
            found.states[a:end], found.deviations[a:end] = done.states, done.deviations
            found.innovations[a:end], found.used[a:end] = done.errors[:, 0], usable
        a += count
    return state


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
    return replace(state, filter=None, tail=EMPTY, deviations=unknown(observer), number=0)


def _followed(observer: Observer, state: ObserverState, new: Tail) -> tuple[ObserverState, JointPass | None, Mask, int]:
    """Follow new samples of a stretch, up to where the filter diverges.

    Returns
    -------
    state, found, usable, count
        The state after them, what was found, which positions were usable, and how many samples were looked at.
    """
    old, joint = state.tail, observer.joint
    both = Tail(*(np.concatenate([a, b]) for a, b in zip(old, new, strict=True)))
    first, m = old.time.size, both.time.size
    segment = segment_of(both, joint.mapped.actuator)
    usable = usable_positions(both.position)
    values = measured_values(both, usable, observer.supply.ratio if observer.supply else None)
    at = init(joint, segment, state.theta, state.T) if state.filter is None else state.filter
    given = JointInputs(intervals(segment, joint.mapped.actuator, joint.noise, joint.measure), values)
    found, end = _until_diverged(observer, at, given, (first, m), state.number - first)
    if found is None or end < m:
        theta, T = state.sound
        ended = replace(_ended(observer, state), theta=theta, T=T)
        return ended, found, usable[first:end], end + 1 - first
    kept = last_samples(both, joint.mapped.actuator.parameters.T_pwm + 2.0 * observer.spacing)
    corrected = np.flatnonzero(np.isfinite(found.deviations[:, 0]))
    deviations = found.deviations[corrected[-1]].copy() if corrected.size else state.deviations
    state = replace(
        state, filter=found.state, theta=found.state.theta, T=found.state.T, tail=kept, deviations=deviations,
        number=state.number + m - first,
    )  # fmt: skip
    return state, found, usable[first:], m - first


def _until_diverged(
    observer: Observer, at: RuleState, given: JointInputs, span: tuple[int, int], number: int
) -> tuple[JointPass | None, int]:
    """Follow samples up to the first at which the filter diverges; what was found, None if nothing, and that sample."""
    first, end = span
    while end > first:
        found = follow(observer.joint, at, given, (first, end), number)
        if isinstance(found, Diverged):
            end = found.sample
            continue
        possible = first + _impossible(observer, found.states)
        if possible >= end:
            return found, end
        end = possible
    return None, first


def _impossible(observer: Observer, states: FloatArray) -> int:
    """The first of the states (n, states) whose pressure in chamber A is outside of `PRESSURES`; n if none.

    An observer without a covariance takes a spike of its sensor at its word, and recovers by itself.
    """
    if not observer.joint.rule.columns:
        return len(states)
    p, p_A = observer.actuator.parameters, states[:, observer.actuator.states.index("p_A")]
    low, high = PRESSURES
    return int(np.argmax(np.append((p_A < low * p.P_0) | (p_A > high * p.P_S), True)))
