"""Follow samples as they arrive: block by block, through holes, frozen sensors and divergence."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from clutchid.arguments import checked
from clutchid.codegen.kernels import kernels_in
from clutchid.codegen.records import Records, record_copy
from clutchid.errors import DataError
from clutchid.inference.filter.joint_filter import Diverged, JointInputs, JointPass, follow, init
from clutchid.inference.filter.setup import FilterState, intervals
from clutchid.log import INPUTS, BoolArray, FloatArray, IntArray, Log, any_of
from clutchid.observer import flags
from clutchid.observer.air import at_air
from clutchid.observer.configuration import Observer, start, unknown
from clutchid.observer.inputs import taken_in
from clutchid.observer.mismatch import normalised
from clutchid.observer.rest import WRONG
from clutchid.observer.state import (
    EMPTY,
    ObserverState,
    Sound,
    Tail,
    filter_values,
    last_samples,
    segment_of,
    usable_positions,
)
from clutchid.strokes.stroke import BEGINS, RESOLUTION
from clutchid.strokes.values import Verdicts, outside

#: Shares of ambient and supply pressure, and distance in m beyond the stops, outside of which a filter has diverged: no
#: load presses the air of a closed chamber to twice the supply, and a filter that began anew has said 2.5 times.
PRESSURES, BEYOND_STOPS = (0.01, 2.0), 5e-3

#: Standard deviation of the time that a valve is open besides its held duty cycle, as a share of the interval.
#: Provenance: docs/derivations_online.md.
UNKNOWN_SHARE = 0.3

#: Where innovations contradict the inputs, what was learnt since the last stroke is taken back, and nothing is learnt
#: for this time in s. Provenance: docs/derivations_online.md.
HELD_BACK = 1.0

#: Most samples that are followed at once: where the filter diverges they are followed again.
_MOST = 1000


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
    contradicted : (n,)
        Whether innovations have contradicted the inputs in the second before, see `clutchid.observer.contradiction`.
    partial : (n,)
        Whether nothing is learnt from the sample, as its stroke was not followed from its beginning.
    rest : m, (n,)
        How far the vented rest has moved since the calibration, as known at that sample.
    flags, verdicts : (n,)
        Flags that show before the filter takes a sample, see `clutchid.observer.flags`, and the verdict on its
        position, see `clutchid.strokes.rule`.
    lost, ends : (n,)
        Number of samples that are missing in a hole before it, and 1 where a stroke ends.
    """

    time: FloatArray
    states: FloatArray
    deviations: FloatArray
    innovations: FloatArray
    used: BoolArray
    mismatch: FloatArray
    leaking: BoolArray
    contradicted: BoolArray
    partial: BoolArray
    rest: FloatArray
    flags: IntArray
    verdicts: Verdicts
    lost: IntArray
    ends: IntArray

    def flagged(self, flag: int) -> BoolArray:
        """Whether each sample has a flag, by its bit."""
        return np.asarray(self.flags & flag != 0)


@checked
def observe(observer: Observer, state: ObserverState, block: Log) -> tuple[ObserverState, Observed]:
    """Follow the samples of a block, from the state before its first.

    A stretch without holes starts with its first position; within a stroke, where the pressure is guessed, it learns
    nothing before that stroke ends. Where the filter diverges, it goes back to what it knew of the parameters at the
    end of the stroke before, and starts anew. Blocks of any length give the same numbers, bit by bit.

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
    taken, inputs = taken_in(observer, state.inputs, state.latest, block)
    observed, at = _nothing(observer, block.time, taken), np.flatnonzero(taken["flags"] != flags.REPEATED_TIME)
    single = taken if at.size == taken.size else taken[at]
    samples, at_ends = _tail(observer, block.time[at], single), list[ObserverState]()
    for a, b in pairwise(_cuts(state, single)):
        sample, rows = single[a], _rows(at[a:b])
        if sample["begins"]:
            state = _ended(observer, state)
        if sample["forgets"]:
            state = _forgotten(observer, state)
        state = _counted(observer, state, float(sample["zero"]))._replace(temperature=float(sample["air"]))
        if sample["driven"]:
            state = _piece(at_air(observer, state.temperature), state, samples, (a, b), at, observed)
        observed.leaking[rows] = state.leaking
        state = _judged(observer, state, observed, rows, single[a:b])
        if single["ends"][b - 1]:
            state = _stroke_ended(observer, state)
            air_known = bool(single["air_known"][b - 1])
            at_ends.append(_ended(observer, state)._replace(latest=float(samples.time[b - 1]), air_known=air_known))
    if len(block):
        state = state._replace(latest=float(block.time[-1]), air_known=bool(taken["air_known"][-1]))
    return state._replace(inputs=inputs), observed, at_ends


def _rows(at: IntArray) -> IntArray | slice:
    """Places of samples, as a slice where none is left out, which is faster."""
    return slice(at[0], at[-1] + 1) if at[-1] - at[0] == at.size - 1 else at


def _tail(observer: Observer, time: FloatArray, taken: Records) -> Tail:
    """Samples as the filter takes them."""
    open_std = UNKNOWN_SHARE * observer.spacing * np.sqrt(taken["unknown"])
    duties = np.column_stack([taken["duty_supply"], taken["duty_exhaust"]])
    return Tail(time, duties, taken["position"].copy(), taken["supply_pressure"].copy(), open_std)


def _cuts(state: ObserverState, taken: Records) -> list[int]:
    """Samples where a stretch, another zero, temperature or load begins, or a stroke has ended; and their number."""
    begins = (taken["begins"] == 1) | (taken["forgets"] == 1)
    for name, before in (("zero", state.zero), ("air", state.temperature)):
        begins |= np.append(before, taken[name][:-1])[: taken.size] != taken[name]
    begins[1:] |= taken["ends"][:-1] == 1
    begins[:1] = True
    return [*np.flatnonzero(begins).tolist(), taken.size]


def _stroke_ended(observer: Observer, state: ObserverState) -> ObserverState:
    """The state after a stroke: what is known of the parameters is kept, and gains what the clutch has worn since then.

    The recursion adds that column by column at the corrections that follow.
    """
    wear = state.wear + observer.joint.drifts.shape[1]
    return state._replace(
        filter=state.filter and state.filter._replace(wear=wear), wear=wear,
        sound=Sound(state.theta, state.T, state.G, wear), strokes=state.strokes + 1,
        leaking=observer.leaks(state), partial=False,
    )  # fmt: skip


def _judged(
    observer: Observer, state: ObserverState, observed: Observed, rows: IntArray | slice, taken: Records
) -> ObserverState:
    """The state with the mismatch after some samples, of which the last one may end a stroke; fills `observed`."""
    if not observer.compares:
        return state
    rule, after = kernels_in("clutchid.observer.mismatch_rule"), record_copy(state.nis)
    squares = normalised(observer, observed.states[rows], observed.innovations[rows])
    means = np.full(squares.size, np.nan)
    rule.count_innovations(after, squares, observer.usual, means)
    observed.mismatch[rows] = means
    lost = np.isnan(observed.states[rows, 0]) & (taken["driven"] == 1)
    if any_of(observed.contradicted[rows]) or any_of(lost) or any_of(taken["flags"] & flags.SIGNAL_FAULTS != 0):
        after.faulty = 1
    if taken["ends"][-1]:
        rule.end_of_stroke(after)
    return state._replace(nis=after)


def subtracted(observer: Observer, rest: FloatArray) -> FloatArray:
    """Value in m subtracted from the recorded position, for shifts of the vented rest in m."""
    return rest if observer.zero == "subtract" else np.zeros_like(rest)


def _counted(observer: Observer, state: ObserverState, zero: float) -> ObserverState:
    """The state at a sample whose position counts from a zero in m; another one ends the stretch.

    What strokes taught that were counted from a wrong zero is forgotten: a wrong load, and that it is certain.
    """
    if zero == state.zero:
        return state
    wrong = abs(zero - state.zero) > WRONG
    return (_forgotten if wrong else _ended)(observer, state)._replace(zero=zero)


def _forgotten(observer: Observer, state: ObserverState) -> ObserverState:
    """The state after a stretch that taught something wrong: the parameters are those of the calibration."""
    fresh = start(observer)
    return _ended(observer, state)._replace(**fresh.sound._asdict(), sound=fresh.sound, nis=fresh.nis)


def _nothing(observer: Observer, time: FloatArray, taken: Records) -> Observed:
    """Results of samples of which none can be used, to be filled."""
    n = time.size
    states, innovations = np.full((n, len(observer.actuator.states)), np.nan), np.full((n, 2), np.nan)
    used, leaking, contradicted, partial = np.zeros((4, n), dtype=bool)
    return Observed(
        time, states, states.copy(), innovations, used, np.full(n, np.nan), leaking, contradicted, partial,
        taken["rest"].copy(), taken["flags"].copy(), taken["verdict"].astype(np.uint8), taken["lost"].copy(),
        taken["ends"].copy(),
    )  # fmt: skip


def _piece(
    observer: Observer, state: ObserverState, samples: Tail, span: tuple[int, int], at: IntArray, observed: Observed
) -> ObserverState:
    """Follow a part of a stretch with known inputs, from each sample after one at which the filter diverged anew.

    `at` are the places of the samples in `observed`.
    """
    a, b = span
    while a < b:
        if state.filter is None:
            a += _first(np.isfinite(samples.position[a:b]))
        if a == b:
            break
        end = min(b, a + _MOST)
        held = int(samples.time[a:end].searchsorted(_held_until(state)))
        end = a + held if held else end
        partial = state.partial if state.filter else bool(samples.position[a] > BEGINS)
        state = state._replace(partial=partial)
        observing = _not_learning(observer) if held or partial else observer
        state, passed, usable, count = _followed(
            observing, state, Tail(*(x[a:end] for x in samples)), observer.joint.settings.least_speed
        )
        if passed is not None:
            rows = _rows(at[a : a + len(passed.states)])
            observed.states[rows], observed.deviations[rows] = passed.states, passed.deviations
            observed.innovations[rows], observed.used[rows] = passed.errors[:, 0], usable
            observed.partial[rows] = partial
        observed.contradicted[_rows(at[a : a + count])] = bool(held)
        a += count
        observed.contradicted[at[a - 1]] |= state.contradicted == samples.time[a - 1]
    return state


def _held_until(state: ObserverState) -> float:
    """Time in s from which the parameters adapt again, after innovations have contradicted the inputs."""
    return state.contradicted + HELD_BACK - 0.5 * RESOLUTION if math.isfinite(state.contradicted) else -math.inf


@lru_cache(maxsize=4)
def _not_learning(observer: Observer) -> Observer:
    """The observer with parameters that do not adapt."""
    joint = observer.joint
    return replace(observer, joint=replace(joint, settings=replace(joint.settings, least_speed=np.inf)))


def _first(mask: BoolArray) -> int:
    """Number of the first sample in a mask, as many as there are without one."""
    return int(mask.argmax()) if any_of(mask) else mask.size


def _check(state: ObserverState, block: Log) -> None:
    absent = [name for name in ("position", *INPUTS) if name not in block]
    if absent:
        raise DataError(f"{block.name}: no column '{absent[0]}'; it has {', '.join(block.columns)}.")
    if len(block) and state.tail.time.size and block.time[0] <= state.tail.time[-1]:
        raise DataError(
            f"{block.name}: begins at {block.time[0]:.6g} s, but the observer is at {state.tail.time[-1]:.6g} s; give "
            "the recording that follows."
        )
    for name in INPUTS:
        if any_of(wrong := outside(name, block[name])):
            at = int(np.argmax(wrong))
            raise DataError(
                f"{block.name}: {name} is {block[name][at]:.4g} at {block.time[at]:.6g} s; a duty cycle is from 0 to 1."
            )


def _ended(observer: Observer, state: ObserverState) -> ObserverState:
    """The state after a hole: what is known of the parameters stays."""
    return state._replace(filter=None, tail=EMPTY, deviations=unknown(observer), number=0, excess=0.0)


def _followed(
    observer: Observer, state: ObserverState, new: Tail, least_speed: float
) -> tuple[ObserverState, JointPass | None, BoolArray, int]:
    """Follow new samples of a stretch, up to where the filter diverges or innovations contradict the inputs.

    Parameters
    ----------
    least_speed : m/s
        Above which parameters adapt, unless nothing is learnt after a contradiction.

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
    values = filter_values(both, usable, observer.supply.ratio if observer.supply else None)
    at = state.filter or init(joint, segment, state.theta, state.T, state.G, state.wear)
    inputs = JointInputs(intervals(segment, joint.mapped.actuator, joint.noise, joint.measure), values)
    passed, end = _until_diverged(observer, at, inputs, (first, m), state.number - first)
    contradiction, excess = _contradiction(observer, state.excess, passed, least_speed)
    if passed is not None and contradiction < len(passed.states):
        end = first + contradiction
        passed = _until(observer, at, inputs, (first, end), state.number - first)
        state = state._replace(contradicted=float(new.time[contradiction]))
    if passed is None or end < m:
        ended = _ended(observer, state)._replace(**state.sound._asdict())
        return ended, passed, usable[first:end], end + 1 - first
    tail = last_samples(both, joint.mapped.actuator.parameters.T_pwm + 2.0 * observer.spacing)
    corrected = np.isfinite(passed.deviations[:, 0]).nonzero()[0]
    deviations = passed.deviations[corrected[-1]].copy() if corrected.size else state.deviations
    after = passed.state
    state = state._replace(
        filter=after, theta=after.theta, T=after.T, G=after.G, wear=after.wear, tail=tail, deviations=deviations,
        number=state.number + m - first, excess=excess,
    )  # fmt: skip
    return state, passed, usable[first:], m - first


def _until(
    observer: Observer, at: FilterState, inputs: JointInputs, span: tuple[int, int], number: int
) -> JointPass | None:
    """Follow samples of which it is known that the filter does not diverge; None without any."""
    passed = follow(observer.joint, at, inputs, span, number) if span[1] > span[0] else None
    return None if isinstance(passed, Diverged) else passed


def _contradiction(
    observer: Observer, excess: float, passed: JointPass | None, least_speed: float
) -> tuple[int, float]:
    """The first sample at which innovations contradict the inputs, as many as there are if none does.

    Also the sum of their excess at the end; `excess` is that before.
    """
    if passed is None:
        return 0, 0.0
    total, settings, velocity = np.array([excess]), observer.joint.settings, observer.actuator.states.index("v")
    at: int = kernels_in("clutchid.observer.contradiction").first_contradiction(
        total, passed.errors, passed.states, velocity, least_speed, settings.every * settings.spacing
    )
    return at, float(total[0])


def _until_diverged(
    observer: Observer, at: FilterState, inputs: JointInputs, span: tuple[int, int], number: int
) -> tuple[JointPass | None, int]:
    """Follow samples up to the first at which the filter diverges; what was found, None if nothing, and that sample."""
    first, end = span
    while end > first:
        passed = follow(observer.joint, at, inputs, (first, end), number)
        if isinstance(passed, Diverged):
            end = passed.sample
            continue
        possible = first + _impossible(observer, passed.states)
        if possible >= end:
            return passed, end
        end = possible
    return None, first


def _impossible(observer: Observer, states: FloatArray) -> int:
    """The first of the states (n, states) that is outside of `PRESSURES` or `BEYOND_STOPS`; n if none."""
    p, names, (low, high) = observer.actuator.parameters, observer.actuator.states, PRESSURES
    p_A, y = states[:, names.index("p_A")], states[:, names.index("y")]
    outside = (y < -BEYOND_STOPS) | (y > p.y_max + BEYOND_STOPS)
    return _first(outside | (p_A < low * p.P_0) | (p_A > high * p.P_S))
