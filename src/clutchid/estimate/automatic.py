"""``--free auto``: which parameters of a model a calibration frees, and what it needs of the recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.errors import DataError
from clutchid.log import Log
from clutchid.measured import SENSOR_PARAMETERS
from clutchid.model.actuator import Actuator, Load
from clutchid.preparation.carrier import centred, duty_grid, find_carrier, grid_phase, on_off
from clutchid.signals.excitation import VENTED_POSITION
from clutchid.signals.runs import runs
from clutchid.uncertainty.coordinates import Prior, far_stop

#: The model that a calibration takes where none is named.
AUTOMATIC = "energy-balance-stribeck"

#: Parameters that a calibration frees, where the model knows them: what differs from truck to truck and is not on a
#: drawing. Areas are; mass and damping of the stops hardly show.
PAPER = (
    "C_vs", "C_ve", "R_0vs", "R_0ve", "R_1vs", "R_1ve", "V_0A", "P_S", "P_0", "F_C", "D_v", "K_z", "D_zdot", "C_r",
    "y_max", "tau_y", "tau_p",
)  # fmt: skip
SHAPES = ("B_vs", "B_ve")
BALANCE = ("mu_h", "K_h", "b_vs", "m_vs", "b_ve", "m_ve", "T_w", "h_A", "V_S", "tau_S")
STRIBECK = ("c_F", "R_S", "v_S")
CARRIER = ("s_vs", "s_ve", "a_0vs", "a_0ve", "t_vs", "t_ve")

#: Where a search begins: lag of a sensor in s; in parts of a period how long the current of a valve takes to decay and
#: its armature to travel, of which one has no influence while the other is 0; and the delay of an on/off valve.
LAG, DECAY, TRAVEL, ON_OFF_DELAY = 1.5e-3, 0.1, 0.1, 0.5

#: The chamber vents when its pressure falls this near to the ambient, in Pa, which on land is in this range.
VENTED, AMBIENT = 2e4, (0.5e5, 1.2e5)

#: Samples of a rest, at least, that tell its pressure.
RESTING = 20

#: Standard deviation of the ambient pressure that a vented rest of some hundred samples tells, in Pa.
VENTED_STD = 100.0


def automatic(logs: Sequence[Log], actuator: Actuator) -> tuple[Actuator, tuple[str, ...], dict[str, Prior]]:
    """The actuator to start a calibration from, with a free load and the carrier found; what to free; and priors.

    The ambient pressure is read off the vented rest, so that an offset of the sensor cancels in the load.

    Raises
    ------
    DataError
        If a recording has no pressure, or never vents.
    """
    _check(logs, actuator)
    ambient = float(np.median([_vented_pressure(log) for log in logs]))
    changes = {"P_0": ambient, "tau_y": LAG, "tau_p": LAG}
    known = {*actuator.in_equations, *SENSOR_PARAMETERS}
    found = _carrier(logs[0], actuator) if known >= set(CARRIER) else {}
    changes |= found
    candidates = (*PAPER, *SHAPES, *BALANCE, *(CARRIER if found else ()), *STRIBECK)
    free = [name for name in candidates if name in known]
    load = actuator.load if actuator.load.basis == "b-spline" else Load.on_b_splines(actuator.load)
    begin = replace(actuator, load=load).replace(changes)
    priors = {"P_0": Prior(ambient, VENTED_STD), "y_max": far_stop(begin, max(log.reach() for log in logs))}
    return begin, (*load.names, *free), priors


def _carrier(log: Log, actuator: Actuator) -> dict[str, float]:
    """Period of the valves' carrier, and where the search for delays and short pulses begins; empty without one."""
    grid, _ = duty_grid(log)
    travels = {"t_vs": TRAVEL, "t_ve": TRAVEL}
    if on_off(log):
        return {"T_pwm": grid, "s_vs": ON_OFF_DELAY, "s_ve": ON_OFF_DELAY, **travels} if grid > 0.0 else {}
    period, phase = find_carrier(log, actuator)
    if period == 0.0:
        return {}
    # on a grid of the duty cycles the valves' own phases lead to what the pressure shows, less the lag of its sensor
    start = grid_phase(log, period)
    later = 0.0 if start is None else centred(phase - start - LAG / period)
    delays = {f"s_{valve}": actuator.value(f"R_0{valve}") + later for valve in ("vs", "ve")}
    return {"T_pwm": period, **delays, **travels, "a_0vs": DECAY, "a_0ve": DECAY}


def _check(logs: Sequence[Log], actuator: Actuator) -> None:
    problems = []
    for log in logs:
        if "pressure_a" not in log or not np.isfinite(log["pressure_a"]).any():
            problems.append(
                f"{log.name}: no pressure_a; 'auto' needs a recording with pressure. From position alone free the "
                "load: --start CALIBRATION.toml --free load."
            )
        elif not AMBIENT[0] < _vented_pressure(log) < min(AMBIENT[1] + VENTED, actuator.parameters.P_S):
            problems.append(
                f"{log.name}: the chamber never vents, its lowest pressure is {_vented_pressure(log) / 1e5:.2f} bar; a "
                "calibration needs the vented rest as its zero. Record a second or more with the exhaust valve open."
            )
    if problems:
        raise DataError("\n".join(problems))


def _vented_pressure(log: Log) -> float:
    """Pressure of the vented chamber: at the rest before the first stroke, else at the end of a later, else the lowest.

    The chamber empties after the piston has come back, so only the second half of a later rest counts.
    """
    pressure, known = log["pressure_a"], np.isfinite(log["pressure_a"])
    lowest = float(np.percentile(pressure[known], 1.0))
    idle = (np.abs(np.nan_to_num(log["position"])) <= VENTED_POSITION) & ~(log["duty_supply"] > 0.0)
    spans = [(a if a == 0 else (a + b) // 2, b) for a, b in runs(idle)]
    rests = {a: float(np.median(pressure[a:b][known[a:b]])) for a, b in spans if known[a:b].sum() >= RESTING}
    vented = {a: found for a, found in rests.items() if found < lowest + VENTED}
    return vented.get(0, min(vented.values(), default=lowest))
