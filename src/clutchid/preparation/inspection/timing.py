"""Checks of the time: the sample rate, and the shift between command and motion at the start of strokes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from clutchid.log import HOLE, FloatArray
from clutchid.preparation.inspection.inspected import Check, Grade, InspectedRecording, spread_over
from clutchid.simulation.stiffness import MOST_SUBSTEPS, STABLE_STEP, TOP_SPEED
from clutchid.strokes.duty_cycle import CONTINUOUS_STEP
from clutchid.strokes.sampled import IndexArray, run_ends

_SAMPLE_RATE = "sample rate"

#: Least number of samples per stroke, and in the narrowest knot interval of the load curve.
_PER_STROKE, _PER_INTERVAL = 4, 1

#: Sample rate in Hz at which all changes of duty cycles are recorded, see
#: `clutchid.strokes.duty_cycle.is_slow`.
_LEAST_RATE = 1000.0

#: Interval in s from which milliseconds were probably read as seconds, and below which seconds as something smaller.
_SLOW, _FASTEST = 0.5, 5e-6


def sample_rate(reading: InspectedRecording) -> Check:
    """Whether the sample rate suits the stiffness of the model and the knot intervals of its load curve.

    Inputs are held between samples, so a valve edge is known to one sample only. At top speed the piston travels
    `TOP_SPEED` times that time, and the load of one knot interval is attributed to another.
    """
    step, p = reading.update_interval, reading.actuator.parameters
    if not math.isfinite(step):
        return Check(_SAMPLE_RATE, "-", "undetermined", "a sample rate needs at least two samples.")
    steps = max(1, math.ceil(step * reading.rate / STABLE_STEP * (1 - 1e-9)))
    travel = TOP_SPEED * step
    narrowest = float(np.diff(reading.actuator.load.knots).min())
    if reason := _implausible(reading, steps, slow=_PER_STROKE * travel > p.y_max):
        return Check(_SAMPLE_RATE, f"{1 / step:.4g} Hz", "bad", f"at {1 / step:.4g} Hz {reason}")
    grade: Grade = "good"
    if _PER_STROKE * travel > p.y_max:
        grade = "bad"
    elif _PER_INTERVAL * travel > narrowest or step > CONTINUOUS_STEP:
        grade = "suspect"
    rate = f"{1 / step:.4g} Hz"
    repeated = "" if step < 1.5 * reading.step else f", repeated at {1 / reading.step:.4g} Hz"
    facts = (
        f"the fastest mode of the model is {reading.rate:.3g} 1/s ({steps} integration step{'' if steps == 1 else 's'} "
        f"per sample), and at {TOP_SPEED:g} m/s the piston travels {travel * 1e3:.3g} mm between two samples"
    )
    needed = max(TOP_SPEED * _PER_INTERVAL / narrowest, _LEAST_RATE)
    unit = ", or write the unit of the time as ms if the stamps count milliseconds" if step >= _SLOW else ""
    knots = f", more than the narrowest knot interval of the load curve ({narrowest * 1e3:.3g} mm)"
    advice = {
        "good": "",
        "suspect": (
            f"{knots if _PER_INTERVAL * travel > narrowest else ''}: the valves open and close between the samples, "
            "at times that are not recorded, so the load is smoothed and shifted, and its trust is 'with care' at "
            f"best; record at {needed:.4g} Hz or more."
        ),
        "bad": f" of a stroke of {p.y_max * 1e3:.3g} mm: fast strokes have too few samples and a fit would be wrong; "
        f"record at {needed:.4g} Hz or more{unit}.",
    }
    return Check(_SAMPLE_RATE, rate + repeated, grade, f"at {rate}{repeated} {facts}{advice.get(grade) or '.'}")


def _implausible(reading: InspectedRecording, steps: int, *, slow: bool) -> str:
    """Reason why the rate cannot be that of a recording of this actuator, other than being too `slow`."""
    if reading.update_interval < _FASTEST:
        return (
            "no position sensor is that fast: the time stamps are probably in s or ms, and were read in a smaller "
            "unit; correct the unit of the time."
        )
    if steps > MOST_SUBSTEPS and not slow:
        return (
            f"the model is too stiff ({reading.rate:.3g} 1/s); check the mass, the volumes and the stiffnesses of the "
            "parameters."
        )
    return ""


_TIME_SHIFT = "time shift"

#: Least number of strokes for a standard deviation.
_FEWEST_STROKES = 3

#: Largest lag of a position sensor in s.
_LAG = 2e-3

#: Largest delay of a switched valve until it is half open, as a fraction of its period; usual period in s, 100 Hz.
_VALVE, _PERIOD = 0.2, 0.01

#: Relative change of the start delay if supply pressure, dead volume, mass and valve together differ by 30 % from the
#: model: it depends on their third root.
_ALIKE = 0.1

#: Longest usable interval between values in s: a stroke that starts within 20 ms has one sample then.
_LONGEST_INTERVAL = 0.02


@dataclass(frozen=True, slots=True)
class Allowed:
    """Plausible shifts in s: `early` from friction and sampling, `late` also from valve and sensor."""

    early: float
    late: float


def time_shift(reading: InspectedRecording) -> Check:
    """Delay of the measured motion relative to the simulated one over all strokes, with its standard deviation."""
    if not reading.driven or "position" not in reading.measured:
        return Check(_TIME_SHIFT, "-", "undetermined", "the time shift check needs a position and both duty cycles.")
    moves = starts(reading)
    moved = np.isfinite(moves.measured)
    count, total = int(moved.sum()), moves.measured.size
    if total >= _FEWEST_STROKES and 2 * count < total:
        sentence = (
            f"in {total - count} of {total} strokes the piston does not move within {_AFTER * 1e3:g} ms after the "
            "supply valve opens fully: the time axes, the sign or the unit of the position are wrong, so a fit cannot "
            "estimate the load; check that the channels belong together."
        )
        return Check(_TIME_SHIFT, f"no motion in {total - count} of {total} strokes", "bad", sentence)
    if count < _FEWEST_STROKES:
        sentence = (
            f"{count or 'no'} stroke{'' if count == 1 else 's'} from rest with a fully opened supply valve and motion: "
            f"{_FEWEST_STROKES} are needed."
        )
        return Check(_TIME_SHIFT, "-", "undetermined", sentence)
    late = moves.measured[moved] - moves.simulated[moved] - reading.actuator.parameters.tau_y
    drift = _drift(moves.command[moved], late)
    if abs(drift) > _DRIFT:
        sentence = (
            f"the piston moves {late[0] * 1e3:+.1f} ms later than in the model after the first command and "
            f"{late[-1] * 1e3:+.1f} ms after the last, {drift * 1e3:+.2g} ms more a second: the clocks of the channels "
            f"differ by {100 * abs(drift):.2g} %, so a fit attributes the shift to friction and load; record all "
            "channels on one clock."
        )
        return Check(_TIME_SHIFT, f"{drift * 1e3:+.2g} ms a second over {count} strokes", "bad", sentence)
    usual = float(np.median(moves.simulated[moved]))
    if reading.update_interval > _LONGEST_INTERVAL:
        sentence = (
            f"the interval of {reading.update_interval * 1e3:.3g} ms between samples is too long: in the model a "
            f"stroke starts within {usual * 1e3:.2g} ms of its command."
        )
        return Check(_TIME_SHIFT, "-", "undetermined", sentence)
    return _compared(reading, late, _allowed(reading, float(np.std(late, ddof=1)), usual))


#: Drift of a shift in s a second from which two clocks differ: 0.1 % is 3 ms in half a minute, and cheap crystals keep
#: 0.01 %; a line explains the shifts if it leaves at most this share of their scatter, and at least four of them.
_DRIFT, _OF_A_LINE, _FEWEST_FOR_A_LINE = 5e-4, 0.25, 4


def _drift(command: FloatArray, late: FloatArray) -> float:
    """Growth of the shift of the strokes in s a second, where a straight line explains it; else 0."""
    if late.size < _FEWEST_FOR_A_LINE:
        return 0.0
    line = np.polyfit(command, late, 1)
    left = float(np.std(late - np.polyval(line, command)))
    return float(line[0]) if left <= _OF_A_LINE * float(np.std(late)) else 0.0


def _compared(reading: InspectedRecording, late: FloatArray, allowed: Allowed) -> Check:
    """Compare the shift of each stroke in s with the plausible ones."""
    shift, spread, count = float(np.median(late)), float(np.std(late, ddof=1)), late.size
    # standard error of a median; agreement below the sampling interval is by chance
    error = 2 * 1.25 * max(spread, reading.update_interval / math.sqrt(12)) / math.sqrt(count)
    value = f"{shift * 1e3:+.1f} ms (spread {spread * 1e3:.1f} ms, {count} strokes)"
    beyond = max(shift - error - allowed.late, -shift - error - allowed.early)
    grade: Grade = "good" if beyond <= 0 else "bad" if beyond > allowed.late else "suspect"
    facts = (
        f"the piston moves {abs(shift) * 1e3:.1f} ms {'later' if shift >= 0 else 'earlier'} than in the model after "
        f"the same command (standard deviation {spread * 1e3:.1f} ms over {count} strokes)"
    )
    if grade == "good":
        return Check(_TIME_SHIFT, value, grade, f"{facts}; valve and sensor explain that.")
    why = f"valve and sensor explain {allowed.late * 1e3:.1f} ms" if shift > 0 else "no valve opens before its command"
    sentence = (
        f"{facts}; {why}: the channels do not share one clock, and a fit attributes the shift to friction and load; "
        f"move the position by {-shift * 1e3:+.1f} ms, or give its channel that delay in the channel map."
    )
    return Check(_TIME_SHIFT, value, grade, sentence)


def _allowed(reading: InspectedRecording, spread: float, usual: float) -> Allowed:
    """Plausible shifts, for strokes with a standard deviation `spread` and a usual delay `usual`, both in s."""
    p = reading.actuator.parameters
    # friction may be twice that of the model and the load 50 % larger: time of an open valve to supply that force
    rise = p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0 / p.V_0A
    load = float(reading.actuator.load.force(np.array([least_travel(reading)]))[0])
    force = math.hypot(p.F_C, load / 2) / p.A_A / rise if rise > 0 else 0.0
    # half a step in the rest and half a step in motion; a motion that grows with the third power of time is at three
    # times its mean speed there
    rounding = reading.quanta["position"] / (3 * least_travel(reading) / usual)
    either = math.hypot(force, reading.update_interval, rounding, _ALIKE * usual)
    valve = 0.0 if p.T_pwm > 0 else _VALVE * (reading.carrier_period or _PERIOD) / 2
    lag = 0.0 if p.tau_y else _LAG / 2
    # a change off the time grid takes effect with the next period of the carrier, after up to one period
    wait = 0.0 if reading.duty_period > 0.0 else math.sqrt(3 * max(0.0, spread**2 - reading.update_interval**2 / 12))
    return Allowed(either, valve + lag + wait + math.hypot(either, valve, lag))


#: Time in s for which the supply valve must be closed before a stroke. The rest level comes from the part that ends
#: `_BEFORE` s before the command, so that motion with an early time stamp is detected.
_CLOSED, _BEFORE = 0.25, 0.1

#: Motion is searched for until this time in s after the command.
_AFTER = 0.2

#: Least number of samples for the rest level.
_FEWEST_SAMPLES = 3

#: Least mean opening of the valve until the simulated piston moves; in a slower start the delay is not well defined.
_WIDE = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class StartTimes:
    """Time in s of the command, and from it to the first motion in each stroke: measured (NaN: none) and simulated."""

    command: FloatArray
    measured: FloatArray
    simulated: FloatArray


def starts(reading: InspectedRecording) -> StartTimes:
    """Delays of all usable strokes, of a long recording at most `MOST` of them.

    Motion starts where the travel rises through `least_travel`.
    """
    p, log = reading.actuator.parameters, reading.log
    least = least_travel(reading)
    commands = _commands(reading)
    rows = []
    for k in commands[spread_over(commands.size)].tolist():
        now = float(log.time[k])
        begin, end = (int(i) for i in np.searchsorted(log.time, (now - _BEFORE, now + _AFTER)))
        rest = log["position"][int(np.searchsorted(log.time, now - _CLOSED)) : begin]
        rest = rest[np.isfinite(rest)]
        if rest.size < _FEWEST_SAMPLES or not _resting(rest, reading.extent.low, least, reading.noisy("position")):
            continue
        # the model of a switched valve needs one period of past inputs, so the simulation begins in the rest
        window = log.slice(begin, end)
        time = window.time - now
        motion = _crossing(time, reading.simulated(window, 0.0, p.P_0), least)
        until = begin + int(np.searchsorted(time, np.nan_to_num(motion), side="right"))
        if not motion > 0 or reading.supply[k:until].mean() < _WIDE or reading.exhaust[k:until].any():
            continue
        rows.append((now, _crossing(time, window["position"] - np.median(rest), least), motion))
    return StartTimes(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)


def least_travel(reading: InspectedRecording) -> float:
    """Least travel in m that counts as motion: above noise, quantisation and the seal deflection before sliding."""
    p = reading.actuator.parameters
    return p.F_C / p.K_z + reading.blur("position")


def _resting(rest: FloatArray, bottom: float, least: float, noise: bool) -> bool:
    """Whether the piston is vented before a stroke: still, and as near its end position as friction allows.

    If the position has noise elsewhere, constant samples are saturated and do not count.
    """
    still = np.ptp(rest) <= least and not (noise and np.ptp(rest) == 0.0)
    return bool(still and abs(float(np.median(rest)) - bottom) <= 2 * least)


def _commands(reading: InspectedRecording) -> IndexArray:
    """Samples at which the supply valve opens after `_CLOSED` s, without missing inputs or holes around them."""
    time = reading.log.time
    first, stop = run_ends(reading.supply > 0)
    ended = np.concatenate([[time[0] - _CLOSED], time[stop[:-1] - 1]])[: first.size]
    first = first[time[first] - ended > _CLOSED]
    finite = np.isfinite(reading.log["duty_supply"]) & np.isfinite(reading.log["duty_exhaust"])
    finite[1:] &= np.diff(time) <= HOLE * reading.step
    unknown = np.concatenate([[0], np.cumsum(~finite)])
    ahead = np.searchsorted(time, time[first] + _AFTER)
    behind = np.searchsorted(time, time[first] - _CLOSED) + 1
    whole = (ahead < time.size) & (unknown[ahead] == unknown[np.minimum(behind, time.size)])
    result: IndexArray = first[whole]
    return result


def _crossing(time: FloatArray, motion: FloatArray, level: float) -> float:
    """Time at which a motion first rises through a level and stays above for a sample; NaN if there is none."""
    above = motion > level
    over = np.flatnonzero(above[1:-1] & above[2:] & ~above[:-2])
    if over.size == 0 or not np.isfinite(motion[over[0]]):
        return float("nan")
    i = int(over[0])
    return float(time[i] + (time[i + 1] - time[i]) * (level - motion[i]) / (motion[i + 1] - motion[i]))
