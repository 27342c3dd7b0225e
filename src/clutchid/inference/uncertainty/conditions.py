"""Conditions of a recording that the vehicle measures: ambient temperature and supply pressure.

A calibrated supply pressure is an effective one, and a calibration fixes the ambient temperature. So only the
difference between a recording and the calibration recordings is a measurement, of `P_S` and `T_0` in that recording.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import hypot
from typing import NamedTuple

import numpy as np

from clutchid.errors import DataError
from clutchid.inference.uncertainty.change_prior import assumed_change, changeable
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log import INPUTS, FloatArray, Log
from clutchid.measurements.map.ranges import PLAUSIBLE
from clutchid.model.actuator import Actuator

#: Column of each parameter that a vehicle may measure.
CONDITIONS: Mapping[str, str] = {"T_0": "temperature_ambient", "P_S": "pressure_supply"}

#: Standard deviation of the mean of such a column over a recording, in SI: an ambient temperature sensor in the sun or
#: behind the engine, and a pressure sensor of a brake system (0.5 % of 10 bar). Guessed from data sheets.
ACCURACY: Mapping[str, float] = {"T_0": (AIR_ACCURACY := 2.0), "P_S": 5e3}

#: Lowest and highest air temperature in K that can be right.
AIR = COLDEST, HOTTEST = PLAUSIBLE["temperature_ambient"]

#: Largest range of the air temperature in a recording: 5 K, and 0.2 K more a second (out of a warm hall).
SWING, RATE = 5.0, 0.2

#: Time in us without a temperature of the air after which it is not known any more: by these rates it may then be 17 K
#: off, as much as a temperature that was never recorded (the `AIR_STD` of an observer).
LOST = 60_000_000


class Assumption(NamedTuple):
    """A condition that is not known and may have changed.

    Attributes
    ----------
    name
        T_0 or P_S.
    recordings
        Names of the recordings that lack it.
    value : SI
        As calibrated.
    half_width : SI
        Of its change, by the prior at 95 %.
    recorded
        Whether only the calibration lacks it.
    """

    name: str
    recordings: tuple[str, ...]
    value: float
    half_width: float
    recorded: bool


class RecordedConditions(NamedTuple):
    """Conditions of recordings; None where not recorded.

    Attributes
    ----------
    temperature : K
        Mean ambient temperature.
    supply : Pa
        Mean supply pressure at rest.
    supply_estimated : Pa
        Mean that a calibration estimates of the samples that `supply` is the mean of.
    """

    temperature: float | None = None
    supply: float | None = None
    supply_estimated: float | None = None

    def value(self, name: str) -> float | None:
        """The condition that belongs to the parameter T_0 or P_S."""
        return {"T_0": self.temperature, "P_S": self.supply}[name]


#: Conditions of recordings of a vehicle that measures none.
NOT_RECORDED = RecordedConditions()


def conditions_of(logs: Sequence[Log], actuator: Actuator) -> RecordedConditions:
    """Conditions of recordings, as means over those that have the column.

    Raises
    ------
    DataError
        If a column contradicts itself, see `condition_problems`.
    """
    problems = [f"{log.name}: {sentence}" for log in logs for sentence in condition_problems(log, actuator).values()]
    if problems:
        raise DataError("\n".join(problems))
    means = [[mean for log in logs if (mean := _mean(log, name)) is not None] for name in CONDITIONS]
    return RecordedConditions(*(float(np.mean(of_logs)) if of_logs else None for of_logs in means))


#: Conditions by name: word, unit with its size and zero, and the range in it beyond which recordings of a calibration
#: are unlike, chosen by hand.
_UNLIKE = (("T_0", "air", "°C", 1.0, 273.15, 10.0), ("P_S", "supply", "bar", 1e5, 0.0, 0.3))


def unlike_conditions(logs: Sequence[Log]) -> tuple[str, ...]:
    """Warnings that recordings of a calibration, which has one set of parameters, were made under unlike conditions."""
    warnings = []
    for name, word, unit, size, zero, limit in _UNLIKE:
        means = sorted(((mean - zero) / size, log.name) for log in logs if (mean := _mean(log, name)) is not None)
        if means and means[-1][0] - means[0][0] > limit:
            ends = ", ".join(f"{value:.3g} {unit} in {log}" for value, log in (means[0], means[-1]))
            warnings.append(
                f"the {word} differs ({ends}), and a calibration has one set of parameters: calibrate with recordings "
                "of one condition, and estimate the others from it."
            )
    return tuple(warnings)


def with_estimated_supply(
    conditions: RecordedConditions, logs: Sequence[Log], simulated: Sequence[Log]
) -> RecordedConditions:
    """`conditions` of `logs` with the supply pressure that is estimated where they record one."""
    estimated = []
    for log, states in zip(logs, simulated, strict=True):
        if conditions.supply is not None and "pressure_supply" in log and "pressure_supply" in states:
            recorded = np.isfinite(log["pressure_supply"])
            values = np.where(recorded, np.interp(log.time, states.time, states["pressure_supply"]), np.nan)
            mean = _mean(log.with_columns(pressure_supply=values), "P_S")
            estimated += [] if mean is None else [mean]
    return conditions._replace(supply_estimated=float(np.mean(estimated))) if estimated else conditions


def condition_problems(log: Log, actuator: Actuator) -> dict[str, str]:
    """A sentence for each column of a condition that cannot be right."""
    problems: dict[str, str] = {}
    temperature, supply = _measured(log, "temperature_ambient"), _measured(log, "pressure_supply")
    if temperature.size:
        low, high, seconds = temperature.min(), temperature.max(), log.time[-1] - log.time[0]
        if low < AIR[0] or high > AIR[1]:
            problems["temperature_ambient"] = (
                f"temperature_ambient is {low - 273.15:.4g} to {high - 273.15:.4g} °C, outside {AIR[0] - 273.15:g} "
                f"to {AIR[1] - 273.15:g} °C; correct the unit in the heading (K or degC), or remove the column."
            )
        elif high - low > SWING + RATE * seconds:
            problems["temperature_ambient"] = (
                f"temperature_ambient changes by {high - low:.3g} K in {seconds:.3g} s, where at most "
                f"{SWING + RATE * seconds:.3g} K are possible; remove the values that are not air temperatures."
            )
    ambient = actuator.parameters.P_0
    if supply.size and supply.min() < ambient:
        problems["pressure_supply"] = (
            f"pressure_supply falls to {supply.min() * 1e-5:.3g} bar, below the ambient pressure of "
            f"{ambient * 1e-5:.3g} bar; correct the unit in the heading (bar is absolute, bar(g) gauge), or remove the "
            "column."
        )
    return problems


def known_conditions(
    log: Log, actuator: Actuator, calibrated: RecordedConditions, priors: Mapping[str, Prior]
) -> dict[str, Prior]:
    """Measurements of T_0 and P_S in a recording, by how its conditions differ from the `calibrated` ones.

    Parameters
    ----------
    log : Log
        The recording.
    actuator : Actuator
        As calibrated.
    calibrated : RecordedConditions
        Of the calibration recordings.
    priors : {name: Prior}
        From the user, in place of a column; compared to the value of `actuator` where the calibration has none.

    Raises
    ------
    DataError
        As `conditions_of`.
    """
    now = conditions_of([log], actuator)
    measured: dict[str, Prior] = {}
    for name in CONDITIONS:
        before, own, value = calibrated.value(name), now.value(name), actuator.value(name)
        here = priors.get(name) or (Prior(own, ACCURACY[name]) if own is not None and before is not None else None)
        if here is None:
            continue
        std = here.std if before is None else hypot(here.std, ACCURACY[name])
        at = value if before is None else before
        # both act by their ratio: the calibrated values may be some percent beside the recorded ones
        measured[name] = Prior(value / at * here.mean, value / at * std)
    return measured


#: Name of the fault of a supply pressure that is gauge in one recording and absolute in another; by how much in Pa
#: they differ then: ambient from 2500 m to sea level, and what governors leave.
GAUGE, _ONE_ATMOSPHERE = "gauge for absolute", (0.75e5, 1.3e5)


def supply_difference(log: Log, actuator: Actuator, calibrated: RecordedConditions) -> float | None:
    """Mean supply pressure of a recording less the calibrated one in Pa, where that is nearly one atmosphere."""
    now = conditions_of([log], actuator).supply
    if now is None or calibrated.supply is None:
        return None
    difference = now - calibrated.supply
    return difference if _ONE_ATMOSPHERE[0] <= abs(difference) <= _ONE_ATMOSPHERE[1] else None


def gauge_sentence(difference: float) -> str:
    """Clause about a supply pressure that differs from the calibrated one by an atmosphere."""
    return (
        f"pressure_supply is {abs(difference) * 1e-5:.1f} bar {'below' if difference < 0.0 else 'above'} that of the "
        "calibration: one of them may be gauge pressure that was read as absolute. Correct its unit (bar(g) is gauge)"
    )


def condition_warnings(logs: Sequence[Log], calibrated: RecordedConditions, priors: Mapping[str, Prior]) -> list[str]:
    """A sentence for each condition that a recording has and its calibration lacks."""
    return [
        f"{log.name}: {column} is not used, because the calibration does not have it; record it in the calibration "
        "recording too, and save the calibration again."
        for log in logs
        for name, column in CONDITIONS.items()
        if name not in priors and calibrated.value(name) is None and _measured(log, column).size
    ]


def assumed_conditions(logs: Sequence[Log], measured: Collection[str], actuator: Actuator) -> tuple[Assumption, ...]:
    """Assumptions on unknown conditions that may have changed, for a load that is read from `logs`.

    `measured` are the parameters that are measured or fitted, NAME or NAME@RECORDING; `actuator` is as calibrated.
    """
    assumptions = []
    for name in [name for name in ("P_S", "T_0") if name in changeable(actuator)]:
        lacking = [log for log in logs if name not in measured and f"{name}@{log.name}" not in measured]
        recorded = all(_measured(log, CONDITIONS[name]).size for log in lacking)
        value = actuator.value(name)
        assumption = Assumption(name, tuple(log.name for log in lacking), value, assumed_change(name) * value, recorded)
        assumptions += [assumption] if lacking else []
    return tuple(assumptions)


def by_supply(actuator: Actuator, force: FloatArray) -> FloatArray:
    """Derivative of a load in N with respect to the logarithm of the supply pressure, if the motion stays the same.

    All absolute pressures scale with that of the supply: A_A p_A = f + A_A P_0 at rest.
    """
    p = actuator.parameters
    return force + p.A_A * p.P_0


def _measured(log: Log, column: str) -> FloatArray:
    """Finite samples of a column; none where it is missing or empty."""
    values = log.columns.get(column, np.zeros(0))
    return values[np.isfinite(values)]


def _mean(log: Log, name: str) -> float | None:
    """Mean of a condition in SI; of the supply pressure while no valve is open, if there is such a time."""
    values = log.columns.get(CONDITIONS[name], np.zeros(len(log)) * np.nan)
    counted = np.isfinite(values)
    if name == "P_S":
        closed = np.all([log.columns.get(duty, np.zeros(len(log))) <= 0.0 for duty in INPUTS], axis=0)
        counted = counted & closed if np.any(counted & closed) else counted
    return float(np.mean(values[counted])) if counted.any() else None
