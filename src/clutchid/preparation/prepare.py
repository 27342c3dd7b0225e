"""A recording made ready for an actuator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.preparation.pace import paced
from clutchid.preparation.pulses import pulsed
from clutchid.simulation import Partition
from clutchid.simulation.plan import Plan, plan
from clutchid.simulation.stiffness import stiffness
from clutchid.simulation.windows import GUESS, Track, tracks

#: The steps of the integration follow this many times the stiffness at the start, for values that make it stiffer; from
#: calibrated values, which hardly move, so many times.
MARGIN, CALIBRATED_MARGIN = 1.3, 1.05


def prepare(log: Log, actuator: Actuator, measure: Sequence[str]) -> Plan:
    """A recording made ready for `actuator`: on a time grid that shows its pulses, with the carrier's phase and steps.

    The first guess of the states takes the measured position again and again, so the plan has resets.

    Parameters
    ----------
    log : Log
        With both duty cycles and the columns that are compared.
    actuator : Actuator
        Its carrier is looked for; the plan's actuator has the phase that was found.
    measure : 'position', 'pressure_a'
        Measured columns in use.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle, or a column that the phase is read from.
    """
    with_pressure = "pressure_a" in measure
    found = pulsed(log, actuator, with_pressure)
    step = float(np.median(np.diff(found.log.time))) if len(found.log) > 1 else GUESS
    every = Partition(every=max(2, round(GUESS / step)))
    done = plan(found.log, found.actuator, MARGIN * stiffness(found.actuator), every, with_pressure)
    warnings = (*done.warnings, found.warning) if found.warning else done.warnings
    return replace(done, warnings=warnings, phase_std=found.spread)


def paced_tracks(plans: Sequence[Plan], margin: float) -> tuple[Track, ...]:
    """All segments cut into windows, each with the steps that it needs where it may become `margin` times stiffer."""
    return tuple(paced(track, plans[track.log].actuator, margin) for track in tracks(plans))
