"""Checks of measured columns: saturation, stuck sensor, quantisation; motion, range, sign and rest of the position."""

from __future__ import annotations

import math

import numpy as np

from clutchid.log import INPUTS, FloatArray
from clutchid.preparation.inspection.inspected import Check, Grade, InspectedRecording, shown, spread_over
from clutchid.simulation.plan import outside_stroke
from clutchid.strokes.sampled import LEFT_OUT, Runs
from clutchid.strokes.values import Fault
from clutchid.strokes.vented_rest import ZeroedLog

#: A constant run counts as saturation above this multiple of the longest usual run, and above this number of samples.
_LONGER, _SHORTEST = 5, 5


def saturation(reading: InspectedRecording, name: str) -> Check:
    """Whether the column `name` is cut off at its largest or smallest value.

    At an end stop the noise remains, so runs of equal values are no longer there than elsewhere. Without visible noise,
    the check is undetermined.
    """
    title, runs, (low, high) = f"saturation of {name}", reading.runs[name], reading.ends[name]
    if not reading.noisy(name):
        return Check(title, "-", "undetermined", no_noise(name))
    cut = []
    for level, side in ((low, "smallest"), (high, "largest")):
        at = runs.value == level
        usual = runs.longest((runs.value != low) & (runs.value != high), LEFT_OUT)
        longest = runs.longest(at)
        if longest > max(_LONGER * usual, _SHORTEST):
            cut.append((level, side, _total(runs, level, _LONGER * usual) * reading.step, longest))
    if not cut:
        value = f"{shown(low, name)} to {shown(high, name)}"
        return Check(title, value, "good", f"{name} has noise at both ends of its range, so it is not saturated.")
    level, side, seconds, _ = max(cut, key=lambda end: end[2])
    sentence = (
        f"{name} stays at its {side} value, {shown(level, name)}, without noise for {seconds:.3g} s in total: the "
        "sensor or its channel saturates there. A fit would take this limit for an end stop and distort the load "
        "before it; extend the range of the channel, or leave these samples empty."
    )
    return Check(title, f"{seconds:.3g} s at {shown(level, name)}", "bad", sentence, *_longest(reading, name, level))


def no_noise(name: str) -> str:
    """The sentence for a column without visible noise."""
    return f"{name} has no noise above its quantisation step, so repeated values have no meaning."


def _total(runs: Runs, level: float, longer: int) -> int:
    """Number of samples in the long runs at one level."""
    return int(runs.length[(runs.value == level) & (runs.length > longer)].sum())


def _longest(reading: InspectedRecording, name: str, level: float) -> tuple[float, float]:
    """Start and end in s of the longest run at one level."""
    runs = reading.runs[name]
    at = np.flatnonzero(runs.value == level)
    k = at[np.argmax(runs.length[at])]
    first, last = runs.start[k], runs.start[k] + runs.length[k] - 1
    return float(reading.log.time[first]), float(reading.log.time[last])


#: Shortest time in s that counts as stuck: shorter ones are lost messages, which a logger fills with the last value.
_LEAST = 0.05

#: Fraction of the reach next to each end in which the piston may stand still.
_NEAR_END = 0.2

#: Factor by which supply pressure, dead volume and load may lengthen the time until the piston moves.
_PATIENCE = 2.0


def stuck(reading: InspectedRecording, name: str) -> Check:
    """Whether the sensor of the column `name` was stuck.

    Detected by missing noise, which a piston at rest still shows; for the position also by a valve that is open for
    longer than the model needs to move the piston by a tenth of its stroke.
    """
    title, noise = f"stuck {name}", reading.noisy(name)
    by_valves = name == "position" and reading.driven
    unmoved, tested = _unmoved(reading) if by_valves else ([], 0)
    spans = _joined([*(_frozen(reading, name) if noise else []), *unmoved])
    if not spans:
        if noise or tested:
            return Check(title, "never", "good", f"{name} changes all the time.")
        return Check(title, "-", "undetermined", no_noise(name))
    seconds = sum(stop - start for start, stop in spans)
    grade: Grade = "bad" if any(_pushed(reading, *span) for span in spans) else "suspect"
    start, stop = max(spans, key=lambda span: span[1] - span[0])
    more = f" and {len(spans) - 1} more" if len(spans) > 1 else ""
    sentence = (
        f"{name} is constant from {start:.3f} to {stop:.3f} s{more}, {seconds:.3g} s in total, although noise or the "
        "open valve should change it: the sensor was stuck, its last value was repeated, or a duty cycle is inverted. "
        "A fit would take it for a piston at rest and estimate a load that does not exist; leave these samples empty, "
        "or correct the duty cycle."
    )
    return Check(title, f"{seconds:.3g} s from {start:.3f} s", grade, sentence, start, stop)


def _frozen(reading: InspectedRecording, name: str) -> list[tuple[float, float]]:
    """Start and end times of constant runs, except at the extreme values: those are checked for saturation."""
    runs, ends, time = reading.runs[name], reading.ends[name], reading.log.time
    inner = (runs.value != ends.low) & (runs.value != ends.high)
    usual = runs.longest(inner, LEFT_OUT)
    long = inner & (runs.length > _LONGER * usual) & (runs.length * reading.step > _LEAST)
    return [(float(time[a]), float(time[a + n - 1])) for a, n in zip(runs.start[long], runs.length[long], strict=True)]


def _pushed(reading: InspectedRecording, start: float, stop: float) -> bool:
    """Whether a valve was open between two times in s for long enough to move the piston."""
    if not reading.driven:
        return False
    span = slice(*np.searchsorted(reading.log.time, (start, stop)).tolist())
    passed = reading.supply[span].sum(), reading.exhaust[span].sum()
    return any(opened * reading.step > needed for opened, needed in zip(passed, reading.quick, strict=True))


def _unmoved(reading: InspectedRecording) -> tuple[list[tuple[float, float]], int]:
    """Start and end times of openings without motion although the piston was not at that end; number of tested ones."""
    y, time = reading.log["position"], reading.log.time
    low, high = reading.extent
    blur, margin = reading.blur("position"), _NEAR_END * (high - low)
    stretches, tested = [], 0
    for supply, needed in zip((True, False), reading.quick, strict=True):
        opened = np.concatenate([[0.0], np.cumsum(reading.supply if supply else reading.exhaust)]) * reading.step
        starts, stops = reading.open_alone(supply)
        # pulse edges are known to one sample only
        long = np.flatnonzero(opened[stops] - opened[starts] > _PATIENCE * needed + 2 * reading.step)
        for i in long[spread_over(long.size)]:
            part = _finite(y[starts[i] : stops[i]])
            # a piston that never moved is at the vented end
            away = part.size > 1 and (part.max() <= high - margin if supply else part.min() > low + margin)
            tested += int(away)
            if away and np.ptp(part) <= blur:
                stretches.append((float(time[starts[i]]), float(time[stops[i] - 1])))
    return stretches, tested


def _finite(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def _joined(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Merge overlapping intervals."""
    joined: list[tuple[float, float]] = []
    for start, stop in sorted(spans):
        if joined and start <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(stop, joined[-1][1]))
        else:
            joined.append((start, stop))
    return joined


#: Noise of half a step randomises the rounding error (dither): its mean is then below 1 % of the step.
_DITHER = 2.0

#: A step below this fraction of the friction does not matter, with or without noise.
_SMALL = 0.1

#: Least number of steps in the narrowest knot interval of the load curve, and from ambient to supply pressure.
_PER_INTERVAL, _PER_RANGE = 4, 40


def quantisation(reading: InspectedRecording, name: str) -> Check:
    """Whether the step of the column `name` is too coarse for a fit.

    A step is harmless if noise dithers it, or if it is small compared with the friction: for the position with the seal
    deflection before sliding, F_C / K_z, for the pressure with F_C / A_A.

    A knot interval of the load curve with fewer than `_PER_INTERVAL` steps cannot be fitted.
    """
    title, p = f"quantisation of {name}", reading.actuator.parameters
    step, noise = reading.quanta[name], reading.noises[name]
    if step == 0.0 or step < 1e-3 * noise:
        return Check(title, "none", "good", f"{name} has no visible quantisation step.")
    narrowest = float(np.diff(reading.actuator.load.knots).min())
    of_position = name == "position"
    friction = p.F_C / (p.K_z if of_position else p.A_A)
    most = narrowest / _PER_INTERVAL if of_position else (p.P_S - p.P_0) / _PER_RANGE
    undithered = not (math.isfinite(noise) and step <= _DITHER * noise)
    grade: Grade = "good"
    if undithered and step > _SMALL * friction:
        grade = "bad" if step > most else "suspect"
    value = f"{_fine(step, name)}, noise {_fine(noise, name)}"
    if grade == "good":
        return Check(title, value, grade, f"{name} has a quantisation step of {_fine(step, name)}, which is harmless.")
    sentence = (
        f"{name} has a quantisation step of {_fine(step, name)}, noise of {_fine(noise, name)}, and the friction of "
        f"the model corresponds to {_fine(friction, name)}: the rounding error is not random, so a fit distorts the "
        "load and its intervals are too narrow; record with more digits or bits."
    )
    return Check(title, value, grade, sentence)


def _fine(value: float, name: str) -> str:
    """A small value with its unit, um or mbar."""
    if not math.isfinite(value):
        return "unknown"
    return f"{value * 1e6:.3g} um" if name == "position" else f"{value * 1e-2:.3g} mbar"


MOTION = "motion"

#: A duty cycle that never exceeds this in a recording with motion is a fraction that was read as per cent.
_FRACTION = 0.0101

#: Least reach of the piston as a fraction of its stroke, and length of a recording in s: half of a fast stroke.
_REACH, _LONG = 0.02, 0.2


def motion(reading: InspectedRecording) -> Check:
    """Whether the recording is long enough for a fit, the piston moves far enough, and a valve moves it."""
    log = reading.log
    length = float(log.time[-1] - log.time[0]) if len(log) else 0.0
    if "position" not in reading.measured or length < _LONG:
        count = f"{int(np.isfinite(log['position']).sum()):,}"
        sentence = (
            f"the position has {count} samples in {length:.3g} s, less than a stroke, so nothing can be fitted; record "
            "some strokes, and check the unit of the time."
        )
        return Check(MOTION, f"{length:.3g} s", "bad", sentence)
    low, high = reading.extent
    reach = high - low
    value = f"{shown(reach, 'position')} in {length:.3g} s"
    if reach <= max(_REACH * reading.actuator.parameters.y_max, reading.blur("position")):
        sentence = (
            f"the position changes by {shown(reach, 'position')} only, so it contains no information about the load; "
            "record strokes, and check the channel and the unit of the position."
        )
        return Check(MOTION, value, "bad", sentence)
    if reading.driven and all(_is_constant(log[name]) for name in INPUTS):
        sentence = (
            "the piston moves, but neither duty cycle ever changes, so a fit cannot know what moves it; use the "
            "right channels for duty_supply and duty_exhaust."
        )
        return Check(MOTION, value, "bad", sentence)
    closed = [name for name in INPUTS if reading.driven and 0.0 < np.fmax.reduce(log[name], initial=0.0) <= _FRACTION]
    if closed:
        sentence = (
            f"the piston moves, but {' and '.join(closed)} never exceeds 1 %, which opens no valve: the values seem "
            "to be fractions in a column labelled %; write the unit 1 in the column heading or in the channel map."
        )
        return Check(MOTION, value, "bad", sentence)
    return Check(MOTION, f"for {length:.3g} s", "good", f"the piston moves over {value}.")


def _is_constant(values: FloatArray) -> bool:
    finite = values[np.isfinite(values)]
    return finite.size == 0 or bool(finite.min() == finite.max())


#: Reach below this share of the stroke that an open valve contradicts, and how many times longer half a stroke takes
#: than its first tenth: virtual trucks of both families do 0.60 to 0.85 of it in 3.5 to 5 such times.
_SHORT, _HALF_A_STROKE = 0.15, 3.0


def position_range(reading: InspectedRecording) -> Check:
    """Whether the position lies in the stroke, by `clutchid.simulation.plan.outside_stroke`."""
    title, log = "range of position", reading.log
    low, high = reading.extent
    value = f"{shown(low, 'position')} to {shown(high, 'position')}"
    sentences, alien = outside_stroke(log, reading.actuator.parameters.y_max)
    if not sentences and high - low < _SHORT * reading.actuator.parameters.y_max and _passes_half_a_stroke(reading):
        sentence = (
            f"the position ranges from {value} only, although the supply valve is open long enough for half of the "
            f"stroke of {shown(reading.actuator.parameters.y_max, 'position')}; check its unit, which may be ten times "
            "as large."
        )
        return Check(title, value, "bad", sentence)
    if not sentences:
        return Check(title, value, "good", f"the position ranges from {value}, inside the stroke.")
    return Check(title, value, "bad" if alien else "suspect", sentences[0].removeprefix(f"{log.name}: "))


def _passes_half_a_stroke(reading: InspectedRecording) -> bool:
    """Whether the supply valve is once open alone for long enough for half a stroke."""
    if not reading.driven:
        return False
    starts, stops = reading.open_alone(supply=True)
    opened = np.concatenate([[0.0], np.cumsum(reading.supply)]) * reading.step
    return bool(np.any(opened[stops] - opened[starts] > _HALF_A_STROKE * reading.quick[0]))


SIGN = "sign of position"

#: Time in s for which motion continues after a valve has closed.
_AFTER = 0.02

#: The sign is right if the net fraction of the motion in the expected direction is above this, wrong if below minus it.
_CLEAR = 0.5


def direction(reading: InspectedRecording) -> Check:
    """Whether the piston goes up while the supply valve alone is open and down while the exhaust valve alone is."""
    if not reading.driven or "position" not in reading.measured:
        return Check(SIGN, "-", "undetermined", "the sign check needs a position and both duty cycles.")
    up, down = _moved(reading, True), _moved(reading, False)
    count = up.size + down.size
    if count < 2:
        sentence = "the piston does not move while only one valve is open, so the sign cannot be determined."
        return Check(SIGN, "-", "undetermined", sentence)
    share = float((up.sum() - down.sum()) / (np.abs(up).sum() + np.abs(down).sum()))
    grade: Grade = "good" if share > _CLEAR else "bad" if share < -_CLEAR else "suspect"
    value = f"{(1 + share) / 2:.0%} of the motion in the expected direction"
    facts = (
        f"the open supply valve changes the position by {up.sum() * 1e3:+.3g} mm in total, the open exhaust valve "
        f"by {down.sum() * 1e3:+.3g} mm"
    )
    rest = shown(reading.extent[1], "position")
    advice = {
        "good": ".",
        "suspect": ": position and valves do not match, so a fit cannot estimate the load; check that the channels "
        "belong to one actuator and one time axis.",
        "bad": ": the sign of the position is wrong, or the duty cycles are swapped, so a fit cannot estimate the "
        f"load; invert the position (in a channel map sign = -1, and an offset by which the end at {rest} becomes 0, "
        "if the clutch is engaged there), or swap the duty cycles.",
    }
    return Check(SIGN, value, grade, facts + advice[grade])


def _moved(reading: InspectedRecording, supply: bool) -> FloatArray:
    """Changes of the position in m while only one valve is open, those above the noise."""
    starts, stops = reading.open_alone(supply)
    chosen = spread_over(starts.size)
    y, last = reading.log["position"], len(reading.log) - 1
    after = np.minimum(stops[chosen] - 1 + round(_AFTER / reading.step), last)
    change = y[after] - y[starts[chosen]]
    return change[np.isfinite(change) & (np.abs(change) > reading.blur("position"))]


VENTED_REST = "vented rest"


def rest_check(rested: ZeroedLog) -> Check:
    """Whether the vented rest is where it was at the calibration."""
    shift = rested.shift
    if shift is None:
        sentence = "the vented rest cannot be compared with that of the calibration: one has none."
        return Check(VENTED_REST, "-", "undetermined", sentence)
    value = str(shift)
    if not shift.moved:
        return Check(VENTED_REST, value, "good", f"it is where it was at the calibration, {value}.")
    causes = "the position sensor or its bracket" if shift.value > 0.0 else "wear or the position sensor"
    sentence = (
        f"it has moved by {value} since the calibration, because of {causes}; an estimate subtracts this shift "
        "unless --zero keep is given."
    )
    return Check(VENTED_REST, value, "suspect", sentence)


def no_values(fault: Fault) -> Check:
    """Samples that are no values, which every fit leaves out."""
    what = f"values of {fault.channel}"
    count = "a jump" if fault.kind == "seam" else f"{fault.samples:,} missing"
    return Check(what, f"{count} from {fault.first:.3f} s", "suspect", fault.sentence, fault.first, fault.first)
