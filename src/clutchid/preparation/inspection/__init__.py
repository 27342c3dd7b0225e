"""Checks of a recording before any fit, reported together: `inspect`, one module a subject.

>>> import numpy as np
>>> from clutchid.preparation.inspection import inspect
>>> from clutchid.log import Log
>>> still = Log(np.arange(200) / 100, {"position": np.zeros(200)})
>>> inspect(still).checks[0].value
'100 Hz'
"""

from __future__ import annotations

from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.preparation.inspection.air import conditions, missing_conditions, pressure_unit, supply_pressure, vented
from clutchid.preparation.inspection.columns import (
    direction,
    motion,
    no_values,
    position_range,
    quantisation,
    rest_check,
    saturation,
    stuck,
)
from clutchid.preparation.inspection.inspected import Check, Grade, InspectedRecording, Inspection
from clutchid.preparation.inspection.timing import sample_rate, time_shift
from clutchid.strokes.values import values_of
from clutchid.strokes.vented_rest import VentedRest, from_rest

__all__ = ["Check", "Grade", "Inspection", "inspect"]


def inspect(log: Log, actuator: Actuator | None = None, rest: VentedRest | None = None) -> Inspection:
    """Check a recording for everything that would corrupt a fit.

    Parameters
    ----------
    log : Log
        Any recording; a check that lacks data is "undetermined".
    actuator : Actuator, optional
        Model that the recording is compared with: stiffness, stroke, supply pressure; the paper's by default.
    rest : VentedRest, optional
        Of the calibration: that of the recording is compared with it, and other checks count the position from there.

    Returns
    -------
    inspection : Inspection
        One result per check, in the order of the table.

    Examples
    --------
    A position with the wrong sign:

    >>> import numpy as np
    >>> from clutchid.simulation import simulate
    >>> t = np.arange(0, 2, 1e-3)
    >>> supply = 1.0 * (t % 1 < 0.1)
    >>> driven = Log(t, {"duty_supply": supply, "duty_exhaust": 1.0 * (t % 1 >= 0.3)}, "run")
    >>> stroke = simulate(Actuator(), driven).log
    >>> turned = driven.with_columns(position=-stroke["position"])
    >>> [f"{check.name}: {check.grade}" for check in inspect(turned).checks if check.grade == "bad"]
    ['range of position: bad', 'sign of position: bad']
    """
    compared = actuator or Actuator()
    values = values_of(log, compared)
    rested = from_rest(values.log, rest)
    reading = InspectedRecording(rested.log, compared)
    checks: list[Check] = [sample_rate(reading)]
    for check in (saturation, quantisation, stuck):
        checks += [check(reading, name) for name in reading.measured]
    if "position" in log:
        checks.append(motion(reading))
    if "position" in reading.measured:
        checks.append(position_range(reading))
    checks.append(direction(reading))
    if "pressure_a" in reading.measured:
        checks += [pressure_unit(reading), vented(reading)]
    checks += [time_shift(reading), supply_pressure(reading), *conditions(reading)]
    checks += [rest_check(rested)] if rest else []
    checks += [no_values(fault) for fault in values.faults]
    return Inspection(log.name, tuple(checks), missing_conditions(reading))
