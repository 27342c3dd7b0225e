"""Follow samples as they arrive: block by block, through holes, frozen sensors and divergence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.arguments import checked
from clutchid.codegen.kernels import kernels_in
from clutchid.errors import DataError
from clutchid.inference.filter.joint_filter import (
    Diverged,
    JointInputs,
    JointPass,
    follow,
    init,
)
from clutchid.inference.filter.setup import FilterState, intervals
from clutchid.log import INPUTS, BoolArray, FloatArray, Log, all_of, any_of
from clutchid.observer.air import air_of_samples, at_air
from clutchid.observer.configuration import Observer, start, unknown
from clutchid.observer.gaps import bridged, latest_driven, longest, repeats
from clutchid.observer.mismatch import mismatches
from clutchid.observer.rest import WRONG, new_stretch, rest_pace, watch_rest
from clutchid.observer.state import (
    EMPTY,
    ObserverState,
    RestWatch,
    Sound,
    Tail,
    filter_values,
    last_samples,
    segment_of,
    usable_positions,
)
from clutchid.strokes import rule
from clutchid.strokes.stroke import BEGINS, RESOLUTION, Strokes, count_strokes
from clutchid.strokes.values import (
    BELIEVED,
    Verdicts,
    ends_stretch,
    is_value,
    limits,
    outside,
    supply_differs,
    watched,
    within_rounding,
)

#: Shares of ambient and supply pressure, and distance in m beyond the stops, outside of which a filter has diverged.
PRESSURES, BEYOND_STOPS = (0.01, 10.0), 5e-3

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
    rest : m, (n,)
        How far the vented rest has moved since the calibration, as known at that sample.
    no_zero : (n,)
        Whether the position has jumped, and no vented rest has shown its zero since: it is not used.
    verdicts : (n,)
        On the positions, see `clutchid.strokes.rule`.
    contradicted : (n,)
        Whether innovations have contradicted the inputs in the second before, see `clutchid.observer.contradiction`.
    partial : (n,)
        Whether nothing is learnt from the sample, as its stroke was not followed from its beginning.
    supply_unlike : (n,)
        Whether a supply pressure is recorded that cannot be right, see `clutchid.observer.prior.RecordedSupply`.
    air_refused, air_lost : (n,)
        See `clutchid.observer.air.AirOfSamples`.
    repeated : (n,)
        Whether a sample follows the last one so soon that it repeats it.
    """

    time: FloatArray
    states: FloatArray
    deviations: FloatArray
    innovations: FloatArray
    used: BoolArray
    mismatch: FloatArray
    leaking: BoolArray
    rest: FloatArray
    no_zero: BoolArray
    verdicts: Verdicts
    contradicted: BoolArray
    partial: BoolArray
    supply_unlike: BoolArray
    air_refused: BoolArray
    air_lost: BoolArray
    repeated: BoolArray


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
    repeated, before = repeats(block.time, state.latest, observer.spacing), state
    values, state = _values(observer, state, block, repeated)
    samples, rows, latest_input = bridged(state, values.samples, repeated, values.ends, observer.spacing)
    driven: BoolArray = np.logical_and.reduce(np.isfinite(samples.duties), axis=1)
    observed, stretches = _nothing(observer, samples.time), _stretches(observer, samples, driven)
    rest, unzeroed, moves = _rests(observer, state, samples, stretches, driven, observed)
    counted = subtracted(observer, observed.rest)
    samples = samples._replace(position=np.where(observed.no_zero, np.nan, samples.position - counted))
    strokes, ends = count_strokes(state.strokes, samples.time, samples.position)
    of_air = air_of_samples(observer, state, block.time, block.columns.get("temperature_ambient"))
    air = {int(np.searchsorted(samples.time, block.time[at])): temperature for at, temperature in of_air.changes}
    judged, at_ends = 0, list[ObserverState]()
    for begin, end in stretches:
        if not (driven[begin] and _continues(observer, state, samples.time[begin])):
            state = _ended(observer, state)
        cuts = {begin, end}
        if ends or moves or air:
            cuts |= {*(i + 1 for i in ends if begin <= i < end), *(at for at in (*moves, *air) if begin < at < end)}
        for a, b in pairwise(sorted(cuts)):
            state = _counted(observer, state, float(counted[a]))
            if a in air:
                state = state._replace(temperature=air[a])
            if driven[a]:
                state = _piece(at_air(observer, state.temperature), state, samples, (a, b), observed)
            observed.leaking[a:b] = state.leaking
            if b - 1 in ends:
                state = _stroke_ended(observer, _judged(observer, state, observed, slice(judged, b)))
                latest = float(samples.time[b - 1])
                aired = of_air.aired[block.time <= latest][-1:].tolist() or [state.aired]
                at_ends.append(_ended(observer, state)._replace(latest=latest, aired=aired[0]))
                judged = b
    state = _judged(observer, state, observed, slice(judged, samples.time.size))
    state = state._replace(
        rest=rest, unzeroed=unzeroed, strokes=strokes, known=latest_input,
        aired=float(of_air.aired[-1]) if len(block) else state.aired,
        air_refused=bool(of_air.refused[-1]) if len(block) else state.air_refused,
        latest=float(samples.time[-1]) if samples.time.size else state.latest,
        temperature=air.get(samples.time.size, state.temperature),
    )  # fmt: skip
    if any_of(repeated):
        observed = _of_rows(observed, _latest(observer, before), rows, repeated)
    observed = observed._replace(
        time=block.time, verdicts=values.verdicts, supply_unlike=values.supply_unlike,
        air_refused=of_air.refused, air_lost=of_air.lost, repeated=repeated,
    )  # fmt: skip
    return state, observed, at_ends


class _Values(NamedTuple):
    """The samples of a block, in which what is no value is missing, why, and where a stretch ends."""

    samples: Tail
    verdicts: Verdicts
    supply_unlike: BoolArray
    ends: BoolArray


def _values(observer: Observer, state: ObserverState, block: Log, repeated: BoolArray) -> tuple[_Values, ObserverState]:
    """The values of a block, and the state after it.

    As `clutchid.strokes.values.values_of`, but for a jump of the position, which is believed a second later: there a
    stretch ends. The exported C judges by the same rule, which is printed from that text.
    """
    n, recorded, repeats_some = len(block), "pressure_supply" in block, any_of(repeated)
    names = ("position", *INPUTS, "pressure_supply")
    judged, taken = block, np.arange(n)
    if repeats_some:
        taken = (~repeated).nonzero()[0]
        judged = Log(block.time[taken], {name: block[name][taken] for name in names if name in block})
    duties = judged.duties()
    of_taken, since, watch = watched(state.values, _limits(observer), judged, "position", duties)
    verdicts, position = of_taken, block["position"]
    unlike, jumps, ends = np.zeros((3, n), dtype=bool)
    supply_watch = state.supply
    if repeats_some or any_of(of_taken != rule.VALUE):
        verdicts = np.full(n, rule.VALUE, dtype=np.uint8)
        verdicts[taken] = of_taken
        # what counted for less time before a step was the outlier itself
        jumps[taken] = (of_taken == rule.SEAM) & (since[:, 0] - since[:, 1] >= BELIEVED)
        position, ends = np.where(is_value(verdicts), position, np.nan), ends_stretch(verdicts)
    if recorded and observer.supply is not None:
        unlike[taken], supply_watch = supply_differs(state.supply, observer.supply.recorded, judged)
    samples = Tail(
        block.time,
        within_rounding(block.duties() if repeats_some else duties),
        position,
        np.where(unlike, np.nan, block["pressure_supply"]) if recorded else np.full(n, np.nan),
        np.zeros(n),
    )
    jumped = any_of(jumps)
    after = state._replace(
        values=watch, jumped=state.jumped or jumped, supply=supply_watch,
        unzeroed=(*state.unzeroed, *block.time[jumps].tolist()) if jumped else state.unzeroed,
    )  # fmt: skip
    return _Values(samples, verdicts, unlike, ends), after


@lru_cache(maxsize=4)
def _limits(observer: Observer) -> FloatArray:
    """Limits of the position, which are the same for all samples."""
    return limits(observer.actuator, "position", observer.spacing)


def _latest(observer: Observer, state: ObserverState) -> Observed:
    """Results of the sample before a block, as far as a sample that repeats it has them."""
    latest = _nothing(observer, np.full(1, state.latest))
    latest.rest[:], latest.no_zero[:], latest.leaking[:] = state.rest.shift, bool(state.unzeroed), state.leaking
    latest.contradicted[:] = state.latest < _held_until(state)
    return latest


def _of_rows(observed: Observed, before: Observed, rows: NDArray[np.int64], repeated: BoolArray) -> Observed:
    """Results of the samples of a block, in which nothing is estimated at those that are repeated.

    The first samples may repeat the one `before` the block, whose row is -1.
    """
    columns = zip(before, observed, strict=True)
    observed = Observed._make(np.concatenate([first, column])[rows + 1] for first, column in columns)
    for array in (observed.states, observed.deviations, observed.innovations, observed.mismatch):
        array[repeated] = np.nan
    observed.used[repeated] = False
    return observed


def _stroke_ended(observer: Observer, state: ObserverState) -> ObserverState:
    """The state after a stroke: what is known of the parameters is kept, and gains what the clutch has worn since then.

    The recursion adds that column by column at the corrections that follow.
    """
    wear = state.wear + observer.joint.drifts.shape[1]
    return state._replace(
        filter=state.filter and state.filter._replace(wear=wear), wear=wear,
        sound=Sound(state.theta, state.T, state.G, wear), strokes=Strokes(state.strokes.ended + 1),
        leaking=observer.leaks(state), partial=False,
    )  # fmt: skip


def _judged(observer: Observer, state: ObserverState, observed: Observed, samples: slice) -> ObserverState:
    """The state with the mismatch after some samples; fills that of `observed`."""
    if not observer.compares:
        return state
    running = mismatches(observer, state.mismatch, observed.states[samples], observed.innovations[samples])
    observed.mismatch[samples] = running
    ended = running[np.isfinite(running)]
    return state._replace(mismatch=float(ended[-1])) if ended.size else state


def subtracted(observer: Observer, rest: FloatArray) -> FloatArray:
    """Value in m subtracted from the recorded position, for shifts of the vented rest in m."""
    return rest if observer.zero == "subtract" else np.zeros_like(rest)


def _rests(
    observer: Observer,
    state: ObserverState,
    samples: Tail,
    stretches: Sequence[tuple[int, int]],
    driven: BoolArray,
    observed: Observed,
) -> tuple[RestWatch, tuple[float, ...], list[int]]:
    """State of the vented rest after a block, the jumps whose zero it has not shown, and the samples at which its shift
    is known anew; fills `observed`.
    """
    watch, unzeroed, moves = state.rest, state.unzeroed, list[int]()
    before = observer.calibration.rest if observer.calibration else None
    pace = rest_pace(observer.spacing, observer.actuator.parameters.y_max)
    time, duties = samples.time, samples.duties
    for begin, end in stretches:
        if begin > 0 or not time[begin] - latest_driven(state) <= longest(observer.spacing):
            watch = new_stretch(watch)
        observed.rest[begin:end] = watch.shift
        observed.no_zero[begin:end] = bool(unzeroed) and unzeroed[0] <= time[begin]  # a jump begins a stretch
        # a rest settles all jumps before it: the first of them says enough
        unzeroed = (*unzeroed[:1], *(jump for jump in unzeroed[1:] if jump > time[end - 1]))
        if before is None or not driven[begin]:
            continue
        watch, changes = watch_rest(watch, before, pace, samples.position[begin:end], duties[begin:end])
        for at, shift in changes:
            observed.rest[begin + at : end], observed.no_zero[begin + at : end] = shift, False
            moves.append(begin + at)
            unzeroed = tuple(jump for jump in unzeroed if jump >= time[begin + at - 1])
    return watch, unzeroed, moves


def _counted(observer: Observer, state: ObserverState, zero: float) -> ObserverState:
    """The state at a sample whose position counts from a zero in m; another one ends the stretch.

    What strokes taught that were counted from a wrong zero is forgotten: a wrong load, and that it is certain.
    """
    if zero == state.zero:
        return state
    ended = _ended(observer, state)._replace(zero=zero)
    if abs(zero - state.zero) <= WRONG:
        return ended
    sound = start(observer).sound
    return ended._replace(**sound._asdict(), sound=sound)


def _nothing(observer: Observer, time: FloatArray) -> Observed:
    """Results of samples of which none can be used, to be filled."""
    n = time.size
    states = np.full((n, len(observer.actuator.states)), np.nan)
    used, leaking, no_zero, *others = np.zeros((9, n), dtype=bool)
    innovations, mismatch = np.full((n, 2), np.nan), np.full(n, np.nan)
    verdicts = np.full(n, rule.VALUE, dtype=np.uint8)
    return Observed(
        time, states, states.copy(), innovations, used, mismatch, leaking, np.zeros(n), no_zero, verdicts, *others
    )


def _piece(
    observer: Observer, state: ObserverState, samples: Tail, span: tuple[int, int], observed: Observed
) -> ObserverState:
    """Follow a part of a stretch with known inputs, from each sample after one at which the filter diverged anew."""
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
            end = a + len(passed.states)
            observed.states[a:end], observed.deviations[a:end] = passed.states, passed.deviations
            observed.innovations[a:end], observed.used[a:end] = passed.errors[:, 0], usable
            observed.partial[a:end] = partial
        observed.contradicted[a : a + count] = bool(held)
        a += count
        observed.contradicted[a - 1] |= state.contradicted == samples.time[a - 1]
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


def _stretches(observer: Observer, samples: Tail, driven: BoolArray) -> list[tuple[int, int]]:
    """Ranges of samples with known inputs and without holes, and single samples without inputs."""
    hole = samples.time[1:] - samples.time[:-1] > longest(observer.spacing)
    if all_of(driven) and not any_of(hole):
        return [(0, driven.size)] if driven.size else []
    cuts = np.flatnonzero(hole | ~driven[1:] | ~driven[:-1]) + 1
    return [(a, b) for a, b in pairwise([0, *cuts.tolist(), samples.time.size]) if b > a]


def _continues(observer: Observer, state: ObserverState, time: float) -> bool:
    """Whether a sample with known inputs goes on from the last one."""
    tail = state.tail.time
    return bool(tail.size and time - tail[-1] <= longest(observer.spacing))


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
