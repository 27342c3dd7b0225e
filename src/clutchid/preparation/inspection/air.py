"""Checks of the air: unit of the chamber's pressure, the supply pressure that it implies, and recorded conditions."""

from __future__ import annotations

import numpy as np

from clutchid.inference.uncertainty.change_prior import assumed_change
from clutchid.inference.uncertainty.conditions import condition_problems, conditions_of
from clutchid.log import FloatArray, Log
from clutchid.log.units import UNITS, known_units
from clutchid.measurements import UNIT_KEY
from clutchid.parameters import DEFAULTS
from clutchid.preparation.inspection.columns import direction
from clutchid.preparation.inspection.inspected import Check, Grade, InspectedRecording, spread_over
from clutchid.strokes.sampled import run_ends
from clutchid.strokes.vented_pressure import (
    ABSOLUTE,
    UNSETTLED,
    remedy,
    sensor_zero,
    vented_pressure,
    vented_prior,
    without_zeros,
)

_PRESSURE_UNIT = "unit of pressure_a"

#: Lower bound of the lowest pressure as a fraction of the ambient pressure: at 5000 m altitude it is one half; in a
#: chamber that is never vented it is higher.
_LOWEST = 0.5

#: Upper bound of the pressure as a multiple of the supply pressure: air supplies of vehicles reach at most 13 bar.
_HIGHEST = 2.0

#: A vented chamber's pressure is ambient within this factor: altitude, weather and the sensor's offset.
_NEAR = 1.5

#: Least pressure range of a stroke as a fraction of the supply gauge pressure: without a stroke no unit is proposed.
STROKE = 0.125


def pressure_unit(reading: InspectedRecording) -> Check:
    """Whether the range of the pressure is that of an absolute pressure in Pa."""
    p, pressure = reading.actuator.parameters, reading.log["pressure_a"]
    low, high = (float(q) for q in np.nanquantile(pressure, (0.01, 0.99)))
    value = f"{low:.4g} to {high:.4g}"
    if reading.ends["pressure_a"].low == reading.ends["pressure_a"].high:
        sentence = (
            f"pressure_a is {low:.4g} Pa in every sample, so its sensor was not connected or this is the wrong "
            "channel; leave the column out, or use the right channel."
        )
        return Check(_PRESSURE_UNIT, f"{low:.4g} Pa throughout", "bad", sentence)
    written = UNITS.get(reading.log.metadata.get(UNIT_KEY, "Pa"), UNITS["Pa"])
    base = float(reading.log.metadata.get("ambient_Pa", p.P_0)) if written.gauge else 0.0
    if written.gauge and low > _NEAR * p.P_0 and 1 / _NEAR < (low - base) / p.P_0 < _NEAR:
        return Check(_PRESSURE_UNIT, f"{value} Pa", "suspect", _absolute(reading.log.metadata[UNIT_KEY], low, base))
    stroke = STROKE * (p.P_S - p.P_0)
    flat = reading.travels and high - low < stroke
    if _plausible(low, high, p.P_0, p.P_S) and not flat:
        return Check(
            _PRESSURE_UNIT,
            f"{value} Pa",
            "good",
            f"pressure_a ranges from {value} Pa, plausible for an absolute pressure.",
        )
    fitting = _fitting((low - base) / written.scale, (high - base) / written.scale, p.P_0, p.P_S)
    grade: Grade = "bad" if high < p.P_0 or high > _HIGHEST * p.P_S or fitting or flat else "suspect"
    guess = f"it looks like {' or '.join(fitting)}: give that unit" if fitting else "check its unit and its zero"
    what = (
        "too little to move the piston as the position says"
        if flat and low > _LOWEST * p.P_0
        else f"which is not an absolute pressure between ambient ({p.P_0:.4g} Pa) and supply ({p.P_S:.4g} Pa)"
    )
    sentence = (
        f"pressure_a ranges from {value} Pa, {what}; a fit that uses it would be wrong; {guess} in the column "
        "heading or in the channel map."
    )
    return Check(_PRESSURE_UNIT, f"{value} Pa", grade, sentence)


def _absolute(unit: str, low: float, ambient: float) -> str:
    """Why a unit that was written as gauge may be absolute."""
    same = [name for name in known_units("Pa") if UNITS[name].scale == UNITS[unit].scale and not UNITS[name].gauge]
    return (
        f"pressure_a, read as gauge pressure with {ambient * 1e-5:.4g} bar of ambient added, never comes near ambient, "
        f"its lowest is {low * 1e-5:.3g} bar; without that it is {(low - ambient) * 1e-5:.3g} bar, as in a vented "
        f"chamber, so the sensor may show absolute pressure: then write {' or '.join(same)} in place of {unit} in the "
        "column heading or in the channel map; if it is gauge pressure, record a rest with the exhaust valve open."
    )


def _fitting(low: float, high: float, ambient: float, supply: float) -> list[str]:
    """Units in which the range would be plausible; of these, the ones whose lowest pressure is nearest to ambient.

    `low` and `high` are as written in the file.
    """
    lowest = {}
    for name in known_units("Pa"):
        offset = ambient if UNITS[name].gauge else 0.0
        in_pascal = UNITS[name].scale * low + offset, UNITS[name].scale * high + offset
        if _plausible(*in_pascal, ambient, supply) and in_pascal[1] - in_pascal[0] > STROKE * (supply - ambient):
            lowest[name] = abs(in_pascal[0] - ambient)
    return [name for name, distance in lowest.items() if distance <= min(lowest.values()) + 1.0]


def _plausible(low: float, high: float, ambient: float, supply: float) -> bool:
    return _LOWEST * ambient < low and ambient < 1.5 * high and high < _HIGHEST * supply


_VENTED_PRESSURE = "vented pressure"

#: Pressure in Pa below which air at a rest is that of a place above the sea, or the sensor's zero is off.
_LOW_AIR = 1e5


def vented(reading: InspectedRecording) -> Check:
    """Whether the pressure settles at a vented rest, which the load of a calibration counts from."""
    pressure, prior = vented_pressure(reading.log), vented_prior(reading.log)
    shown = _with_std(*(pressure or prior)[:2])
    if pressure is not None:
        low = prior is ABSOLUTE and pressure.mean < _LOW_AIR
        said = (
            "at the vented rest the sensor shows "
            f"{shown}{', because of altitude or a zero error; give --ambient to tell which' * low}."
        )
        _, off = sensor_zero(reading.log)
        return Check(_VENTED_PRESSURE, shown, "suspect" if off else "good", off or said)
    sentence = f"{UNSETTLED}, so a calibration assumes {shown} there; {remedy([reading.log])}."
    return Check(_VENTED_PRESSURE, "not settled", "undetermined", sentence)


def _with_std(mean: float, std: float) -> str:
    return f"{mean * 1e-5:.3f} bar (std {std * 1e-3:.1f} kPa)"


_SUPPLY_PRESSURE = "supply pressure"

#: Opening from which the supply valve counts as fully open.
_OPEN = 0.9

#: Length in s of the final part that must be flat, and least number of samples in it.
_END, _FEWEST = 0.03, 4

#: Largest remaining flow, as a fraction of the choked flow, of a full chamber: within 1 % of the supply pressure.
_TRICKLE = 0.05

#: Relative difference between the supply pressure of the vehicle and of the actuator that a fit tolerates.
_TOLERANCE = 0.02


def supply_pressure(reading: InspectedRecording) -> Check:
    """Plateau of the pressure behind a supply valve that is open for long, or else a lower bound."""
    if "pressure_a" not in reading.measured or not reading.driven:
        lacking = "both duty cycles" if "pressure_a" in reading.measured else "the chamber pressure"
        sentence = f"without {lacking} the supply pressure cannot be checked; a fit keeps its start value."
        return Check(_SUPPLY_PRESSURE, "-", "undetermined", sentence)
    if pressure_unit(reading).grade != "good" or direction(reading).grade == "bad":
        sentence = (
            "the unit of the pressure or the sign of the position is wrong, so the supply pressure cannot be checked."
        )
        return Check(_SUPPLY_PRESSURE, "-", "undetermined", sentence)
    (sound,) = without_zeros([reading.log])
    reading = InspectedRecording(sound, reading.actuator)
    plateaus, nominal = _plateaus(reading), reading.actuator.parameters.P_S
    if plateaus.size:
        return _compared(float(np.median(plateaus)), plateaus.size, nominal)
    # noise alone lifts one of a thousand samples by three standard deviations
    pressure = reading.log["pressure_a"]
    least = float(np.nanquantile(pressure, 0.999)) - 3 * float(np.nan_to_num(reading.noises["pressure_a"]))
    value = f"at least {least * 1e-5:.3g} bar"
    if least > (1 + _TOLERANCE) * nominal:
        sentence = (
            f"the chamber reaches {least * 1e-5:.3g} bar, more than the supply pressure of the actuator, "
            f"{nominal * 1e-5:.3g} bar: a fit would underestimate the air flow; set P_S in the start file, or "
            "free it."
        )
        return Check(_SUPPLY_PRESSURE, value, "bad", sentence)
    sentence = (
        "the supply valve is never open long enough to fill the chamber, so the recording only shows that the supply "
        f"pressure is above {least * 1e-5:.3g} bar; hold the supply valve open for a second at the end of the stroke."
    )
    return Check(_SUPPLY_PRESSURE, value, "undetermined", sentence)


def _compared(implied: float, count: int, nominal: float) -> Check:
    value = f"{implied * 1e-5:.3g} bar ({count} plateau{'' if count == 1 else 's'})"
    facts = f"an open supply valve fills the chamber to {implied * 1e-5:.3g} bar"
    if abs(implied - nominal) <= _TOLERANCE * nominal:
        return Check(_SUPPLY_PRESSURE, value, "good", f"{facts}, the actuator has {nominal * 1e-5:.3g} bar.")
    grade: Grade = "suspect"
    sentence = (
        f"{facts}, but the actuator has P_S = {nominal * 1e-5:.3g} bar: a fit with this value attributes the "
        f"difference to the load; set P_S = {implied:.4g} Pa in the start file, or free it."
    )
    return Check(_SUPPLY_PRESSURE, value, grade, sentence)


def _plateaus(reading: InspectedRecording) -> FloatArray:
    """Pressure in Pa at the end of each interval in which the open supply valve has filled the chamber."""
    p, log = reading.actuator.parameters, reading.log
    first, stop = run_ends((reading.supply >= _OPEN) & (reading.exhaust <= 0))
    choked = p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0
    # the pressure is also constant while the chamber volume grows: wait until the full volume could have been filled
    fill = p.P_S * (p.V_0A + p.A_A * p.y_max) / choked if choked > 0 else np.inf
    long = np.flatnonzero(log.time[stop - 1] - log.time[first] > fill + _END)
    volume = p.V_0A + p.A_A * np.clip(log["position"], 0.0, p.y_max) if "position" in log else None
    plateaus = []
    for i in long[spread_over(long.size)]:
        begin = max(int(first[i]), int(np.searchsorted(log.time, log.time[stop[i] - 1] - _END)))
        end = slice(begin, int(stop[i]))
        pressure = log["pressure_a"][end]
        content = pressure * (p.V_0A if volume is None else volume[end])
        finite = np.isfinite(content)
        if finite.sum() < _FEWEST:
            continue
        flow = float(np.polyfit(log.time[end][finite] - log.time[begin], content[finite], 1)[0])
        if abs(flow) < _TRICKLE * choked:
            plateaus.append(float(np.mean(pressure[finite])))
    return np.array(plateaus)


_RECORD = "record it here and in the calibration"

#: Assumption on a condition that is not recorded, and the worth of recording it: docs/derivations.md, "Known
#: conditions".
_MISSING = {
    "pressure_supply": (
        "supply pressure not recorded: an estimate assumes that of its calibration within "
        f"{100 * assumed_change('P_S'):.0f} %, which doubles the width of its band; {_RECORD} (J1939: AIR1)."
    ),
    "temperature_ambient": (
        "air temperature not recorded: an estimate assumes that of its calibration "
        f"within {assumed_change('T_0') * DEFAULTS.T_0:.0f} K; {_RECORD} (J1939: AMB)."
    ),
}


#: Time in s over which the recorded supply is averaged, such levels that show a change, and by how much of it they may
#: change: a governor keeps it within 5.4 % either way (docs/derivations_online.md).
_LEVEL, _LEVELS, _SWING = 1.0, 4, 0.12


def _supply_change(log: Log) -> tuple[float, float, float] | None:
    """Levels of the recorded supply in Pa before and after its largest change, and its time in s; None without one."""
    values = log["pressure_supply"]
    finite = np.isfinite(values)
    blocks = np.floor((log.time[finite] - log.time[0]) / _LEVEL).astype(np.int64)
    numbers = np.unique(blocks)
    levels = np.array([np.median(values[finite][blocks == number]) for number in numbers])
    if levels.size < _LEVELS:
        return None
    errors = [levels[:i].var() * i + levels[i:].var() * (levels.size - i) for i in range(1, levels.size)]
    at = int(np.argmin(errors)) + 1
    before, after = float(np.mean(levels[:at])), float(np.mean(levels[at:]))
    if abs(after - before) <= _SWING * np.mean(levels):
        return None
    return before, after, float(log.time[0] + numbers[at] * _LEVEL)


def conditions(reading: InspectedRecording) -> list[Check]:
    """A check of each recorded condition."""
    problems = condition_problems(reading.log, reading.actuator)
    names = {"temperature_ambient": "ambient temperature", "pressure_supply": "recorded supply pressure"}
    sound = conditions_of([reading.log.without(*problems)], reading.actuator)
    values = {
        "temperature_ambient": None if sound.temperature is None else f"{sound.temperature - 273.15:.3g} degC",
        "pressure_supply": None if sound.supply is None else f"{sound.supply * 1e-5:.3g} bar",
    }
    checks = [Check(names[column], "-", "bad", sentence) for column, sentence in problems.items()]
    change = _supply_change(reading.log) if sound.supply is not None else None
    if change is not None:
        before, after, at = change
        moves = "falls" if after < before else "rises"
        sentence = (
            f"the recorded supply {moves} from {before * 1e-5:.2g} to {after * 1e-5:.2g} bar at {at:.3g} s; a fit "
            "takes its mean, so estimate the parts before and after separately."
        )
        checks.append(Check(names["pressure_supply"], str(values.pop("pressure_supply")), "suspect", sentence))
    return checks + [
        Check(names[column], value, "good", "it is used where the calibration has it too.")
        for column, value in values.items()
        if value is not None
    ]


def missing_conditions(reading: InspectedRecording) -> tuple[str, ...]:
    """Assumption on each condition that a recording of an actuator lacks, and the worth of recording it."""
    recorded = [name for name, values in reading.log.columns.items() if np.isfinite(values).any()]
    return tuple(text for column, text in _MISSING.items() if reading.driven and column not in recorded)
