"""`Truck`: parameters of a virtual truck, one row per parameter with unit, meaning, range and source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields, replace
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.names import unknown_name
from clutchid.parameters import Row

LOADS = ("diaphragm", "kluever")
DRIVES = ("pwm", "bang-bang")

_FACTS = "truck specification"
_PAPER = "Appendix A"


def _row(value: float, unit: str, meaning: str, low: float, high: float, source: str = _FACTS) -> Any:
    return field(default=value, metadata={"row": Row(unit, meaning, low, high, True, source)})


@dataclass(frozen=True, slots=True, kw_only=True)
class Truck:
    """Actuator, air supply, clutch, sensors and controller of a truck in SI; by default close to the paper's plant.

    `wear` and `cycles` are its age, see `clutchid.truck.aged`; all other parameters are those of the new truck.

    Raises
    ------
    ParameterError
        If values are not admissible; the text lists all of them.

    Examples
    --------
    >>> t = Truck()
    >>> f"{t.A_A * (t.P_S - t.P_0):.0f} N"
    '9824 N'
    """

    # actuator
    A_A: float = _row(12.3e-3, "m²", "area of the piston in chamber A", 1e-3, 0.1, _PAPER)
    A_B: float = _row(11.848e-3, "m²", "area of the piston in chamber B", 1e-3, 0.1, _PAPER)
    V_0A: float = _row(0.148e-3, "m³", "volume of chamber A at the engaged rest of the new clutch", 1e-5, 1e-2, _PAPER)
    V_0B: float = _row(1.2e-4, "m³", "dead volume of chamber B at full stroke", 1e-5, 1e-2, _PAPER)
    y_max: float = _row(0.025, "m", "stroke from the rest of the new clutch to the far stop", 0.021, 0.1, _PAPER)
    M: float = _row(10.0, "kg", "moving mass", 0.1, 100, _PAPER)
    # air
    R: float = _row(287.05, "J/(kg·K)", "gas constant of air", 200, 400, "textbook")
    gamma: float = _row(1.4, "1", "ratio of specific heats of air", 1.001, 2, "textbook")
    P_0: float = _row(1.013e5, "Pa", "ambient pressure", 5e4, 1.2e5, "sea level")
    T_0: float = _row(293.15, "K", "ambient temperature", 243.15, 353.15)
    dT_w: float = _row(5.0, "K", "temperature of the actuator wall above ambient", 0, 60, "assumption")
    h_A: float = _row(60.0, "W/(m²·K)", "heat transfer in chamber A at 1 bar and 293.15 K", 0, 1e7)
    h_B: float = _row(30.0, "W/(m²·K)", "heat transfer in chamber B at 1 bar and 293.15 K", 0, 1e7)
    # supply
    P_S: float = _row(9e5, "Pa", "set supply pressure, mean of the governor's saw-tooth", 3e5, 1.6e6, _PAPER)
    dP_G: float = _row(0.2e5, "Pa", "half the range of the governor", 0, 2e5)
    r_up: float = _row(0.1e5, "Pa/s", "pressure rise while the compressor runs", 1, 1e5, "assumption")
    r_down: float = _row(0.03e5, "Pa/s", "pressure fall while it is off", 1, 1e5, "assumption")
    V_S: float = _row(
        9e-3, "m³", "reservoir of the clutch circuit", 1e-4, 1e9, "assumption, for a pressure drop of 0.1 to 0.4 bar"
    )
    G_S: float = _row(
        2e-7, "kg/(Pa·s)", "line from the governor to the reservoir", 0, 1e-3, "assumption, for that pressure drop"
    )
    UA_S: float = _row(5.0, "W/K", "heat transfer of the reservoir", 0, 1e9, "assumption")
    # valves
    C_s: float = _row(19e-9, "m³/(Pa·s)", "sonic conductance of the supply valve", 0, 1e-6, _PAPER)
    b_s: float = _row(0.25, "1", "its critical pressure ratio", 0, 0.9, "ISO 6358")
    m_s: float = _row(0.55, "1", "its subsonic index", 0.3, 3, "ISO 6358")
    C_e: float = _row(17.5e-9, "m³/(Pa·s)", "sonic conductance of exhaust valve and silencer", 0, 1e-6, _PAPER)
    b_e: float = _row(0.1, "1", "their critical pressure ratio", 0, 0.9, "ISO 6358")
    m_e: float = _row(0.8, "1", "their subsonic index", 0.3, 3, "ISO 6358")
    C_r: float = _row(5e-8, "m³/(Pa·s)", "sonic conductance of the orifice of chamber B", 0, 1e-5, _PAPER)
    b_r: float = _row(0.35, "1", "its critical pressure ratio", 0, 0.9, "ISO 6358")
    m_r: float = _row(0.5, "1", "its subsonic index", 0.3, 3, "ISO 6358")
    r_lam: float = _row(0.995, "1", "pressure ratio above which a flow is laminar", 0.95, 0.9999, "regularisation")
    t_1s: float = _row(0.7e-3, "s", "supply valve: current until the armature moves", 0, 0.02)
    t_2s: float = _row(1.0e-3, "s", "supply valve: opening ramp", 1e-4, 0.02)
    t_3s: float = _row(0.8e-3, "s", "supply valve: decay until the armature moves back", 0, 0.02)
    t_4s: float = _row(1.2e-3, "s", "supply valve: closing ramp", 1e-4, 0.02)
    t_1e: float = _row(0.7e-3, "s", "exhaust valve: current until the armature moves", 0, 0.02)
    t_2e: float = _row(1.0e-3, "s", "exhaust valve: opening ramp", 1e-4, 0.02)
    t_3e: float = _row(0.8e-3, "s", "exhaust valve: decay until the armature moves back", 0, 0.02)
    t_4e: float = _row(1.2e-3, "s", "exhaust valve: closing ramp", 1e-4, 0.02)
    C_AB: float = _row(1e-12, "m³/(Pa·s)", "leak past the piston seal", 0, 1e-7)
    C_A0: float = _row(5e-13, "m³/(Pa·s)", "leak from chamber A to ambient", 0, 1e-7)
    # friction
    F_C: float = _row(140.0, "N", "Coulomb friction of the seals without pressure", 0.01, 5e3)
    c_F: float = _row(1.5e-4, "m²", "its increase with the pressure over the piston", 0, 1e-2)
    R_S: float = _row(1.35, "1", "ratio of static to Coulomb friction", 1, 3)
    v_S: float = _row(0.01, "m/s", "Stribeck velocity", 1e-4, 1)
    K_z: float = _row(1e6, "N/m", "stiffness of the seals", 1e4, 1e7, _PAPER)
    D_z: float = _row(4000.0, "N·s/m", "damping of their deflection at rest", 0, 1e4)
    v_z: float = _row(0.05, "m/s", "velocity at which this damping is halved", 1e-4, 1e3, "assumption")
    D_v: float = _row(4000.0, "N·s/m", "viscous friction at 293.15 K", 0, 2e4, "2000 to 5000")
    beta: float = _row(0.0125, "1/K", "temperature coefficient of the grease viscosity", 0, 0.05)
    # clutch
    E: float = _row(206e9, "Pa", "diaphragm: Young's modulus", 1e9, 1e12)
    nu: float = _row(0.3, "1", "diaphragm: Poisson's ratio", 0, 0.49)
    h: float = _row(5.6e-3, "m", "diaphragm: thickness", 1e-3, 0.02)
    H: float = _row(9.9e-3, "m", "diaphragm: height of the free cone", 1e-3, 0.05)
    R_d: float = _row(0.204, "m", "diaphragm: outer radius", 0.05, 0.5)
    r_d: float = _row(0.160, "m", "diaphragm: inner radius of the cone", 0.02, 0.5)
    R_1: float = _row(0.202, "m", "diaphragm: radius on the pressure plate", 0.05, 0.5)
    r_1: float = _row(0.163, "m", "diaphragm: radius on the cover", 0.02, 0.5)
    l_0: float = _row(7.5e-3, "m", "diaphragm: deflection with the new clutch", 1e-3, 0.03)
    K_c: float = _row(60e6, "N/m", "stiffness of cover and fingers, at the rim", 1e6, 1e10)
    F_cu: float = _row(30e3, "N", "cushion: force", 1e3, 1e5)
    c_cu: float = _row(0.8e-3, "m", "cushion: its compression", 1e-4, 3e-3)
    n_cu: float = _row(2.2, "1", "cushion: exponent", 1, 4)
    i_l: float = _row(6.3, "1", "lever from actuator to rim", 1, 20)
    F_k: float = _row(4000.0, "N", "Kluever's load: amplitude", 100, 1e4, "Kluever 6.28")
    a_k: float = _row(500.0, "1/m", "Kluever's load: steepness", 10, 5e3, "Kluever 6.28")
    k_k: float = _row(20000.0, "N/m", "Kluever's load: decrease with travel", 0, 1e5, "Kluever 6.28")
    F_r: float = _row(
        40.0, "N", "return coil spring: preload at the rest of the new clutch", 1, 500, "shared data, 30 N"
    )
    k_r: float = _row(1500.0, "N/m", "return coil spring: stiffness", 0, 1e4, "assumption")
    F_h: float = _row(25.0, "N", "release bearing: friction without load", 1e-4, 500, "assumption")
    mu_h: float = _row(0.035, "1", "release bearing: half hysteresis over load", 0, 0.2, "5 to 10 % of load")
    K_h: float = _row(5e5, "N/m", "release bearing: stiffness before it slips", 1, 1e7, "assumption")
    K_stop: float = _row(1.15e9, "N/m^1.5", "end stops: contact", 1e7, 2e10, "0.3 mm at full pressure")
    chi: float = _row(4.0, "s/m", "end stops: damping", 0, 100, "Hunt and Crossley")
    # age
    wear: float = _row(0.0, "m", "wear of the facing", 0, 1)
    cycles: float = _row(0.0, "1", "number of strokes", 0, 1e8)
    w_max: float = _row(3.5e-3, "m", "largest wear of the facing", 1e-4, 0.02, "assumption")
    i_w: float = _row(0.3, "1", "shift of the engaged rest per wear; 6.3 without an adjuster", 0, 10, _FACTS)
    a_k_w: float = _row(30.0, "1/m", "Kluever's load: increase with wear", 0, 500, "assumption, 3 % per mm")
    a_F: float = _row(0.25, "1", "relative increase of seal friction per million strokes", 0, 5, "assumption")
    a_C: float = _row(1.5, "1", "relative increase of leakage per million strokes", 0, 50, "assumption")
    a_H: float = _row(
        0.008, "1", "final relaxation of the springs' free height", 0, 0.1, "assumption, 1 to 2 % of load"
    )
    # sensors
    q_y: float = _row(1.2e-5, "m", "position: quantum", 0, 1e-3)
    s_y: float = _row(2e-5, "m", "position: white noise, rms", 0, 1e-3)
    a_vib: float = _row(3e-5, "m", "position: engine-order vibration, amplitude", 0, 1e-3)
    order: float = _row(3.0, "1", "position: engine order of the vibration", 0.5, 12, "six cylinders")
    tau_y: float = _row(1.5e-3, "s", "position: lag", 0, 0.1)
    e_y: float = _row(0.0, "m", "position: error of the estimated zero", -1e-3, 1e-3, "assumption")
    q_p: float = _row(500.0, "Pa", "pressure: quantum", 0, 1e5, "assumption")
    s_p: float = _row(3000.0, "Pa", "pressure: white noise, rms", 0, 1e5)
    tau_p: float = _row(1.5e-3, "s", "pressure: lag", 0, 0.1)
    e_p: float = _row(0.0, "Pa", "pressure: offset", -2e4, 2e4, "assumption")
    e_clock: float = _row(2e-5, "1", "bus clock: drift", -1e-3, 1e-3, "quartz")
    j_clock: float = _row(3e-4, "s", "bus clock: jitter of a message", 0, 5e-3, "assumption")
    # controller
    T_pwm: float = _row(0.01, "s", "period over which the duty cycles are held", 1e-3, 0.1)
    L_p: float = _row(5e-3, "m", "error at which a valve is fully open", 1e-4, 0.05, "tuned")
    t_lead: float = _row(0.012, "s", "prediction time of the controller", 0, 0.1, "tuned")
    e_in: float = _row(0.12e-3, "m", "error below which both valves close", 0, 5e-3, "tuned")
    e_out: float = _row(0.25e-3, "m", "error above which a valve opens again", 0, 5e-3, "tuned")
    load: str = "diaphragm"
    drive: str = "pwm"

    def __post_init__(self) -> None:
        problems = [text for item in fields(self) if "row" in item.metadata for text in self._checked(item)]
        problems += [
            f"{name} = {value!r}: must be one of {', '.join(known)}."
            for name, value, known in (("load", self.load, LOADS), ("drive", self.drive, DRIVES))
            if value not in known
        ]
        if not problems:
            problems = [*_contradictions(self)]
        if problems:
            raise ParameterError("\n".join(problems))

    def _checked(self, item: Field[float]) -> list[str]:
        name, row = item.name, item.metadata["row"]
        value = getattr(self, name)
        if isinstance(value, bool) or not isinstance(value, (int, float, np.floating, np.integer)):
            return [f"{name} = {value!r}: a number in {row.unit} is needed ({row.meaning})."]
        object.__setattr__(self, name, float(value))
        if row.admits(float(value)):
            return []
        unit = "" if row.unit == "1" else f" {row.unit}"
        return [f"{name} = {value:g}{unit}: {row.meaning} is {row.allowed}{unit}."]

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of all parameters, in the order of the table."""
        return tuple(item.name for item in fields(cls) if "row" in item.metadata)

    @classmethod
    def row(cls, name: str) -> Row:
        """The row of the parameter `name`.

        Raises
        ------
        ParameterError
            If there is no such parameter; the text names the nearest known one.
        """
        if name not in cls.names():
            raise ParameterError(unknown_name(name, cls.names(), "parameter of a truck"))
        row: Row = next(item.metadata["row"] for item in fields(cls) if item.name == name)
        return row

    def replace(self, changes: Mapping[str, Any]) -> Truck:
        """A copy with changed values, validated again.

        Raises
        ------
        ParameterError
            For an unknown name or an impossible value.
        """
        known = (*self.names(), "load", "drive")
        unknown = [unknown_name(name, known, "parameter of a truck") for name in changes if name not in known]
        if unknown:
            raise ParameterError("\n".join(unknown))
        return replace(self, **changes)


def _contradictions(t: Truck) -> list[str]:
    """Contradictions between parameters that are admissible individually."""
    problems = []
    if t.A_B > t.A_A:
        problems.append(
            f"A_B = {t.A_B:g} m² must not exceed A_A = {t.A_A:g} m²: the rod reduces the area of chamber B."
        )
    if not t.r_d < t.r_1 < t.R_1 < t.R_d:
        problems.append(
            f"r_d, r_1, R_1, R_d = {t.r_d:g}, {t.r_1:g}, {t.R_1:g}, {t.R_d:g} m: the radii must increase in this order."
        )
    if t.wear > t.w_max:
        problems.append(
            f"wear = {t.wear * 1e3:g} mm exceeds the facing of this truck, which can wear by {t.w_max * 1e3:g} mm;"
            " the clutch would need a new disc."
        )
    elif t.wear >= t.l_0:
        problems.append(f"wear = {t.wear * 1e3:g} mm fully unloads the diaphragm; l_0 is {t.l_0 * 1e3:g} mm.")
    if 1.1 * t.A_A * t.i_w * t.wear >= t.V_0A:
        problems.append(f"wear = {t.wear * 1e3:g} mm with i_w = {t.i_w:g} moves the rest beyond the end of chamber A.")
    if t.e_in > t.e_out:
        problems.append(f"e_in = {t.e_in:g} m must not exceed e_out = {t.e_out:g} m.")
    return problems
