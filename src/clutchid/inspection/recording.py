"""`inspect`: every check on one recording."""

from __future__ import annotations

from clutchid.inspection.direction import direction
from clutchid.inspection.finding import Finding, Inspection
from clutchid.inspection.position_range import position_range
from clutchid.inspection.pressure_unit import pressure_unit
from clutchid.inspection.quantisation import quantisation
from clutchid.inspection.reading import Reading
from clutchid.inspection.sample_rate import sample_rate
from clutchid.inspection.saturation import saturation
from clutchid.inspection.stuck import stuck
from clutchid.inspection.supply_pressure import supply_pressure
from clutchid.inspection.time_shift import time_shift
from clutchid.log import Log
from clutchid.model.actuator import Actuator


def inspect(log: Log, actuator: Actuator | None = None) -> Inspection:
    """Everything in a recording that would spoil a fit, told at once.

    Parameters
    ----------
    log : Log
        Any recording; what a check needs and the recording lacks makes it "not tellable".
    actuator : Actuator, optional
        What the recording is compared with: its stiffness, its strokes, its supply pressure; the paper's by default.

    Returns
    -------
    inspection : Inspection
        A finding for each check, in the order of the table.

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
    >>> [f"{f.check}: {f.verdict}" for f in inspect(turned).findings if f.verdict == "bad"]
    ['range of position: bad', 'sign of position: bad']
    """
    reading = Reading(log, actuator or Actuator())
    findings: list[Finding] = [sample_rate(reading)]
    for check in (saturation, quantisation, stuck):
        findings += [check(reading, name) for name in reading.measured]
    if "position" in reading.measured:
        findings.append(position_range(reading))
    findings.append(direction(reading))
    if "pressure_a" in reading.measured:
        findings.append(pressure_unit(reading))
    findings += [time_shift(reading), supply_pressure(reading)]
    return Inspection(log.name, tuple(findings))
