"""``--free auto``: the parameters that a calibration frees, and its requirements on the recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.errors import DataError
from clutchid.inference.uncertainty.coordinates import Prior, far_stop
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.model.weighted_load import Load
from clutchid.parameters import in_order
from clutchid.preparation.inspection.air import pressure_unit
from clutchid.preparation.inspection.inspected import InspectedRecording
from clutchid.preparation.prepare import FROM_POSITION_ALONE
from clutchid.preparation.pulses import centred, find_carrier
from clutchid.strokes.duty_cycle import duty_grid, duty_period, grid_phase, on_off
from clutchid.strokes.vented_pressure import SIGNIFICANT, VentedPressure, lowest_pressure, vented_pressure, vented_prior

#: The default model of a calibration, and the one in its place where the valves have a carrier.
AUTOMATIC, WITH_CARRIER = "energy-balance-stribeck-proportional", "energy-balance-stribeck"

#: Start values: lag of a sensor in s; decay time of a valve's current and travel time of its armature in carrier
#: periods, of which one has no influence while the other is 0; delay of an on/off valve.
START_LAG, DECAY, TRAVEL, ON_OFF_DELAY = 1.5e-3, 0.1, 0.1, 0.5

#: Standard deviation in Pa at which a search keeps the ambient pressure of a rest with closed valves. Noise may leave
#: more, but errors of the model move it further: on truck 1 of family B, 20 s from seed 12, with its standard error of
#: 0.9 kPa P_0 is 0.9 kPa too low and the load 0.5 % off, with 100 Pa 0.2 kPa and 0.2 %.
CLOSED_STD = 100.0

#: Standard deviation in Pa of the lowest of all mean pressures over a tenth of a second.
_LOWEST_STD = 1e3

#: Range in Pa of the ambient pressure on land, and how far the lowest pressure of a recording may lie above it.
_ON_LAND, _VENTED = (0.5e5, 1.2e5), 2e4


def automatic(
    logs: Sequence[Log], actuator: Actuator, *, shared: bool = False
) -> tuple[Actuator, tuple[str, ...], dict[str, Prior]]:
    """Start values of a calibration with a free load and the identified carrier; free parameters; priors.

    The period of the duty cycles is that of the first recording. The ambient pressure is taken from the vented rest, so
    that an offset of the sensor cancels in the load; `shared` as in `ambient_priors`.

    Raises
    ------
    DataError
        If a recording has no pressure, or the chamber never vents.
    """
    _check(logs, actuator)
    ambient = ambient_priors(logs, shared=shared)
    changes = {
        "P_0": float(np.median([prior.mean for prior in ambient.values()])),
        "tau_y": START_LAG,
        "tau_p": START_LAG,
    }
    pulsed = replace(actuator, model=WITH_CARRIER) if actuator.model == AUTOMATIC else actuator
    carrier = _carrier(logs[0], pulsed) if _can_switch(pulsed) else {}
    actuator, changes = (pulsed if carrier else actuator), changes | carrier
    changes = {name: value for name, value in changes.items() if not actuator.equipment.missing(name)}
    free = freed(actuator.replace({"T_pwm": carrier.get("T_pwm", 0.0)}))
    load = actuator.load if actuator.load.basis == "b-spline" else Load.on_b_splines(actuator.load)
    renewed = duty_period(logs[0])
    renewed = actuator.duty_period if renewed is None else renewed
    begin = replace(actuator, load=load, duty_period=renewed).replace(changes)
    names = [name for item in free for name in (ambient if item == "P_0" else (item,))]
    return begin, (*load.names, *names), {**ambient, "y_max": far_stop(begin, max(log.reach() for log in logs))}


def ambient_priors(logs: Sequence[Log], *, shared: bool = False) -> dict[str, Prior]:
    """Prior of P_0, or of the P_0@STEM of each recording where they are not of one ambient pressure.

    Settled vented rests give it, weighted by their variances, those at the start before those after a stroke.
    Recordings share it where their rests agree, and where no pressure of one without a rest lies below; `shared`, as
    where a prior or bounds of P_0 are given, in any case: what they differ by is then in its standard deviation.
    """
    rests, lowest = [vented_pressure(log) for log in logs], [lowest_pressure(log) for log in logs]
    settled = [rest for rest in rests if rest is not None]
    if not settled:
        return {
            "P_0": min(
                (_unseen(*recording) for recording in zip(logs, lowest, strict=True)), key=lambda prior: prior.std
            )
        }
    best = [rest for rest in settled if rest.closed] or settled
    weights = np.array([rest.std**-2 for rest in best])
    mean, std = float(weights @ [rest.mean for rest in best] / weights.sum()), float(weights.sum() ** -0.5)
    apart = [abs(rest.mean - mean) > SIGNIFICANT * float(np.hypot(rest.std, std)) for rest in settled]
    unseen = [low for low, rest in zip(lowest, rests, strict=True) if rest is None]
    below = [low for low in unseen if low < mean - SIGNIFICANT * _LOWEST_STD]
    if not any(apart) and not below:
        return {"P_0": _at_rest(VentedPressure(mean, std, best[0].closed))}
    if shared:
        spread = float(np.ptp([*(rest.mean for rest in settled), *below]))
        return {"P_0": Prior(mean, math.hypot(std, spread))}
    of_logs = zip(logs, rests, lowest, strict=True)
    return {f"P_0@{log.name}": _at_rest(rest) if rest else _unseen(log, low) for log, rest, low in of_logs}


def _at_rest(rest: VentedPressure) -> Prior:
    return Prior(rest.mean, CLOSED_STD if rest.closed else rest.std)


def _unseen(log: Log, lowest: float) -> Prior:
    """Prior of the ambient pressure without a settled rest: no pressure of a recording lies below it."""
    prior = vented_prior(log)
    return Prior(min(prior.mean, lowest), prior.std)


def freed(actuator: Actuator) -> tuple[str, ...]:
    """Parameters that a calibration frees: those of the rows that have an effect.

    They differ between trucks, and are not known from a drawing as well as areas are; the damping of the stops has
    little influence. A wrong mass is made up for by other parameters, which scale differently when grease and air are
    warmer (docs/derivations.md, "The moving mass").
    """
    acting, equipment = actuator.acting, actuator.equipment
    names = in_order(actuator.rows, lambda row: row.freed)
    return tuple(name for name in names if name in acting and not equipment.missing(name))


def _can_switch(actuator: Actuator) -> bool:
    """Whether the equations of its valves know a carrier."""
    rows = actuator.rows
    return any(rows[name].valves == "switched" for name in actuator.in_equations)


def _carrier(log: Log, actuator: Actuator) -> dict[str, float]:
    """Carrier period of the valves, and start values of their delays and short pulses; empty without a carrier."""
    grid, _ = duty_grid(log)
    travels = {"t_vs": TRAVEL, "t_ve": TRAVEL}
    if on_off(log):
        return {"T_pwm": grid, "s_vs": ON_OFF_DELAY, "s_ve": ON_OFF_DELAY, **travels} if grid > 0.0 else {}
    period, phase = find_carrier(log, actuator)
    if period == 0.0:
        return {}
    # with duty cycles on a grid, the phases of the valves are those in the pressure, less the lag of its sensor
    start = grid_phase(log, period)
    later = 0.0 if start is None else centred(phase - start - START_LAG / period)
    delays = {f"s_{valve}": actuator.value(f"R_0{valve}") + later for valve in ("vs", "ve")}
    return {"T_pwm": period, **delays, **travels, "a_0vs": DECAY, "a_0ve": DECAY}


def _check(logs: Sequence[Log], actuator: Actuator) -> None:
    problems = []
    for log in logs:
        if "pressure_a" not in log or not np.isfinite(log["pressure_a"]).any():
            problems.append(f"{log.name}: no pressure_a; 'auto' needs a recording with pressure. {FROM_POSITION_ALONE}")
            continue
        lowest = float(np.nanpercentile(log["pressure_a"], 1.0))
        if not _ON_LAND[0] < lowest < min(_ON_LAND[1] + _VENTED, actuator.parameters.P_S):
            unit = pressure_unit(InspectedRecording(log, actuator))
            never = (
                f"the chamber never vents, its lowest pressure is {lowest / 1e5:.2f} bar; a calibration "
                "needs the vented rest as its reference. Record a second or more with the exhaust valve open."
            )
            problems.append(f"{log.name}: {never if unit.grade == 'good' else unit.sentence}")
    if problems:
        raise DataError("\n".join(problems))
