"""`Truck`: parameters of a truck of family A, one row per parameter with unit, meaning, range and source."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from clutchid.truck.vehicle import PAPER, Vehicle, choice, number

LOADS = ("diaphragm", "kluever")
DRIVES = ("pwm", "bang-bang")


@dataclass(frozen=True, slots=True, kw_only=True)
class Truck(Vehicle):
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

    # air
    h_A: float = number(60.0, "W/(m²·K)", "heat transfer in chamber A at 1 bar and 293.15 K", 0, 1e7)
    h_B: float = number(30.0, "W/(m²·K)", "heat transfer in chamber B at 1 bar and 293.15 K", 0, 1e7)
    # supply
    dP_G: float = number(0.2e5, "Pa", "half the range of the governor", 0, 2e5)
    r_up: float = number(0.1e5, "Pa/s", "pressure rise while the compressor runs", 1, 1e5, "assumption")
    r_down: float = number(0.03e5, "Pa/s", "pressure fall while it is off", 1, 1e5, "assumption")
    V_S: float = number(
        9e-3, "m³", "reservoir of the clutch circuit", 1e-4, 1e9, "assumption, for a pressure drop of 0.1 to 0.4 bar"
    )
    G_S: float = number(
        2e-7, "kg/(Pa·s)", "line from the governor to the reservoir", 0, 1e-3, "assumption, for that pressure drop"
    )
    UA_S: float = number(5.0, "W/K", "heat transfer of the reservoir", 0, 1e9, "assumption")
    # valves
    C_s: float = number(19e-9, "m³/(Pa·s)", "sonic conductance of the supply valve", 0, 1e-6, PAPER)
    b_s: float = number(0.25, "1", "its critical pressure ratio", 0, 0.9, "ISO 6358")
    m_s: float = number(0.55, "1", "its subsonic index", 0.3, 3, "ISO 6358")
    C_e: float = number(17.5e-9, "m³/(Pa·s)", "sonic conductance of exhaust valve and silencer", 0, 1e-6, PAPER)
    b_e: float = number(0.1, "1", "their critical pressure ratio", 0, 0.9, "ISO 6358")
    m_e: float = number(0.8, "1", "their subsonic index", 0.3, 3, "ISO 6358")
    C_r: float = number(5e-8, "m³/(Pa·s)", "sonic conductance of the orifice of chamber B", 0, 1e-5, PAPER)
    b_r: float = number(0.35, "1", "its critical pressure ratio", 0, 0.9, "ISO 6358")
    m_r: float = number(0.5, "1", "its subsonic index", 0.3, 3, "ISO 6358")
    t_1s: float = number(0.7e-3, "s", "supply valve: current until the armature moves", 0, 0.02)
    t_2s: float = number(1.0e-3, "s", "supply valve: opening ramp", 1e-4, 0.02)
    t_3s: float = number(0.8e-3, "s", "supply valve: decay until the armature moves back", 0, 0.02)
    t_4s: float = number(1.2e-3, "s", "supply valve: closing ramp", 1e-4, 0.02)
    t_1e: float = number(0.7e-3, "s", "exhaust valve: current until the armature moves", 0, 0.02)
    t_2e: float = number(1.0e-3, "s", "exhaust valve: opening ramp", 1e-4, 0.02)
    t_3e: float = number(0.8e-3, "s", "exhaust valve: decay until the armature moves back", 0, 0.02)
    t_4e: float = number(1.2e-3, "s", "exhaust valve: closing ramp", 1e-4, 0.02)
    # friction
    c_F: float = number(1.5e-4, "m²", "its increase with the pressure over the piston", 0, 1e-2)
    R_S: float = number(1.35, "1", "ratio of static to Coulomb friction", 1, 3)
    v_S: float = number(0.01, "m/s", "Stribeck velocity", 1e-4, 1)
    K_z: float = number(1e6, "N/m", "stiffness of the seals", 1e4, 1e7, PAPER)
    D_z: float = number(4000.0, "N·s/m", "damping of their deflection at rest", 0, 1e4)
    v_z: float = number(0.05, "m/s", "velocity at which this damping is halved", 1e-4, 1e3, "assumption")
    beta: float = number(0.0125, "1/K", "temperature coefficient of the grease viscosity", 0, 0.05)
    # clutch
    E: float = number(206e9, "Pa", "diaphragm: Young's modulus", 1e9, 1e12)
    nu: float = number(0.3, "1", "diaphragm: Poisson's ratio", 0, 0.49)
    h: float = number(5.6e-3, "m", "diaphragm: thickness", 1e-3, 0.02)
    H: float = number(9.9e-3, "m", "diaphragm: height of the free cone", 1e-3, 0.05)
    R_d: float = number(0.204, "m", "diaphragm: outer radius", 0.05, 0.5)
    r_d: float = number(0.160, "m", "diaphragm: inner radius of the cone", 0.02, 0.5)
    R_1: float = number(0.202, "m", "diaphragm: radius on the pressure plate", 0.05, 0.5)
    r_1: float = number(0.163, "m", "diaphragm: radius on the cover", 0.02, 0.5)
    l_0: float = number(7.5e-3, "m", "diaphragm: deflection with the new clutch", 1e-3, 0.03)
    K_c: float = number(60e6, "N/m", "stiffness of cover and fingers, at the rim", 1e6, 1e10)
    F_cu: float = number(30e3, "N", "cushion: force", 1e3, 1e5)
    c_cu: float = number(0.8e-3, "m", "cushion: its compression", 1e-4, 3e-3)
    n_cu: float = number(2.2, "1", "cushion: exponent", 1, 4)
    i_l: float = number(6.3, "1", "lever from actuator to rim", 1, 20)
    F_k: float = number(4000.0, "N", "Kluever's load: amplitude", 100, 1e4, "Kluever 6.28")
    a_k: float = number(500.0, "1/m", "Kluever's load: steepness", 10, 5e3, "Kluever 6.28")
    k_k: float = number(20000.0, "N/m", "Kluever's load: decrease with travel", 0, 1e5, "Kluever 6.28")
    F_h: float = number(25.0, "N", "release bearing: friction without load", 1e-4, 500, "assumption")
    mu_h: float = number(0.035, "1", "release bearing: half hysteresis over load", 0, 0.2, "5 to 10 % of load")
    K_h: float = number(5e5, "N/m", "release bearing: stiffness before it slips", 1, 1e7, "assumption")
    # age
    a_k_w: float = number(30.0, "1/m", "Kluever's load: increase with wear", 0, 500, "assumption, 3 % per mm")
    # sensors
    a_vib: float = number(3e-5, "m", "position: engine-order vibration, amplitude", 0, 1e-3)
    order: float = number(3.0, "1", "position: engine order of the vibration", 0.5, 12, "six cylinders")
    load: str = choice("diaphragm", LOADS)
    drive: str = choice("pwm", DRIVES)

    def contradictions(self) -> Iterator[str]:
        """Contradictions between parameters that are admissible individually."""
        yield from Vehicle.contradictions(self)
        if not self.r_d < self.r_1 < self.R_1 < self.R_d:
            radii = f"{self.r_d:g}, {self.r_1:g}, {self.R_1:g}, {self.R_d:g} m"
            yield f"r_d, r_1, R_1, R_d = {radii}: the radii must increase in this order."
        if self.l_0 <= self.wear <= self.w_max:
            yield f"wear = {self.wear * 1e3:g} mm fully unloads the diaphragm; l_0 is {self.l_0 * 1e3:g} mm."


#: States of the plant, see `clutchid.truck.plant`.
STATES = ("y", "v", "m_A", "U_A", "m_B", "U_B", "m_S", "U_S", "z", "z_h", "x_s", "x_e", "p_G")
#: Inputs, constant over a tick: rates of both lifts and of the governor's pressure.
INPUTS = ("r_s", "r_e", "r_G")
#: Further states with `ledger`: mass and energy that have entered across the boundary of the plant.
LEDGER = ("m_in", "E_in")

#: Parameters of a truck in the equations; y_r follows from its age.
PARAMETERS = (
    "A_A", "A_B", "V_0A", "V_0B", "y_max", "y_r", "M", "R", "gamma", "P_0", "T_0", "T_w", "h_A", "h_B", "V_S", "G_S",
    "UA_S", "C_s", "b_s", "m_s", "C_e", "b_e", "m_e", "C_r", "b_r", "m_r", "r_lam", "C_AB", "C_A0", "F_C", "c_F", "R_S",
    "v_S", "K_z", "D_z", "v_z", "D_v", "beta", "F_h", "mu_h", "K_h", "K_stop", "chi",
)  # fmt: skip

#: Further parameters of the loop, in the order of its array.
SETTINGS = (
    "period", "timer", "bang_bang", "working", "P_S", "dP_G", "r_up", "r_down", "t_1s", "t_2s", "t_3s", "t_4s", "t_1e",
    "t_2e", "t_3e", "t_4e", "dead_s", "dead_e", "zero", "quantum", "tau_y", "tau_p", "band", "lead", "e_in", "e_out",
)  # fmt: skip
