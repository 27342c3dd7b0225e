"""Conditions that the vehicle may record: ambient temperature and supply pressure, and what is assumed without."""

from __future__ import annotations

import numpy as np

from clutchid.inspection.check import Check
from clutchid.inspection.reading import Reading
from clutchid.parameters import Parameters
from clutchid.uncertainty.change_prior import assumed_change
from clutchid.uncertainty.conditions import condition_problems, conditions_of

_RECORD = "record it here and in the calibration"

#: What is assumed of a condition that is not recorded, and what it would be worth: docs/derivations.md, "Known
#: conditions".
_MISSING = {
    "pressure_supply": (
        "supply pressure not recorded: a reading assumes that of its calibration "
        f"within {100 * assumed_change('P_S'):.0f} %, with twice as wide a band if it changed; {_RECORD} (J1939: AIR1)."
    ),
    "temperature_ambient": (
        "air temperature not recorded: a reading assumes that of its calibration "
        f"within {assumed_change('T_0') * Parameters().T_0:.0f} K; {_RECORD} (J1939: AMB)."
    ),
}


def conditions(reading: Reading) -> list[Check]:
    """A check of each recorded condition."""
    problems = condition_problems(reading.log, reading.actuator)
    names = {"temperature_ambient": "ambient temperature", "pressure_supply": "recorded supply pressure"}
    sound = conditions_of([reading.log.without(*problems)], reading.actuator)
    values = {
        "temperature_ambient": None if sound.temperature is None else f"{sound.temperature - 273.15:.3g} degC",
        "pressure_supply": None if sound.supply is None else f"{sound.supply * 1e-5:.3g} bar",
    }
    checks = [Check(names[column], "-", "bad", sentence) for column, sentence in problems.items()]
    return checks + [
        Check(names[column], value, "good", "it is used where the calibration has it too.")
        for column, value in values.items()
        if value is not None
    ]


def missing_conditions(reading: Reading) -> tuple[str, ...]:
    """What is assumed of each condition that a recording of an actuator lacks, and what it would be worth."""
    recorded = [name for name, values in reading.log.columns.items() if np.isfinite(values).any()]
    return tuple(text for column, text in _MISSING.items() if reading.driven and column not in recorded)
