"""Conditions that the vehicle records: ambient temperature and supply pressure, where there are such columns."""

from __future__ import annotations

from clutchid.inspection.check import Check
from clutchid.inspection.reading import Reading
from clutchid.uncertainty.conditions import condition_problems, conditions_of


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
