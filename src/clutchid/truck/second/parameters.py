"""`TruckB`: parameters of a truck of family B, one row per parameter with unit, meaning, range and source."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from clutchid.truck.vehicle import Vehicle, choice, number

LOADS = ("cubic", "tabulated")
VALVES = ("spool", "solenoids")
SPOOLS = ("first-order", "second-order")
FRICTIONS = ("maxwell-slip", "elasto-plastic")
DUTIES = ("latched", "continuous")

_GUESS = "guess"
_BOOK = "textbook"


@dataclass(frozen=True, slots=True, kw_only=True)
class TruckB(Vehicle):
    """Actuator, air supply, clutch, sensors and controller of a truck of family B, in SI.

    Raises
    ------
    ParameterError
        If values are not admissible; the text lists all of them.

    Examples
    --------
    >>> TruckB().valve, TruckB().friction
    ('spool', 'maxwell-slip')
    """

    # air
    n_p: float = number(1.2, "1", "polytropic exponent of the air", 1, 1.4, _BOOK)
    tau_w: float = number(1.5, "s", "relaxation of the air to the temperature of the wall", 0.01, 1e9, _GUESS)
    V_D: float = number(4e-5, "m³", "dead volume between valves and tube", 2e-5, 1e-3, _GUESS)
    C_t: float = number(1.8e-7, "kg/(Pa·s)", "conductance of the tube to chamber A", 1e-9, 4e-7, _GUESS)
    dp_t: float = number(5e3, "Pa", "difference below which the tube's flow is laminar", 1e3, 1e5, "regularisation")
    # supply
    V_S: float = number(6e-3, "m³", "volume behind the pressure regulator", 1e-4, 1e9, _GUESS)
    dp_T: float = number(2e5, "Pa", "pressure before the regulator above the set one", 0, 1e6, _GUESS)
    A_R: float = number(20e-6, "m²", "area of the open regulator", 0, 1e-3, _GUESS)
    dp_R: float = number(0.8e5, "Pa", "droop of the regulator when fully open", 1e3, 5e5, _GUESS)
    tau_R: float = number(0.05, "s", "time constant of the regulator", 1e-3, 10, _GUESS)
    # valves
    A_s: float = number(11.5e-6, "m²", "area of the supply port", 0, 1e-3, "as Appendix A's conductance")
    A_e: float = number(10.6e-6, "m²", "area of the exhaust port", 0, 1e-3, "as Appendix A's conductance")
    A_r: float = number(30e-6, "m²", "area of the orifice of chamber B", 0, 1e-2, "as Appendix A's conductance")
    x_0s: float = number(0.08, "1", "spool: overlap towards supply", 0, 0.5, _GUESS)
    x_0e: float = number(0.08, "1", "spool: overlap towards exhaust", 0, 0.5, _GUESS)
    n_x: float = number(1.2, "1", "spool: exponent of the opening over its travel", 1, 3, _GUESS)
    tau_x: float = number(4e-3, "s", "spool of first order: time constant", 1e-4, 0.1, _GUESS)
    t_n: float = number(2.5e-3, "s", "spool of second order: inverse of the natural frequency", 1e-4, 0.1, _GUESS)
    zeta_x: float = number(0.8, "1", "spool of second order: damping", 0.05, 3, _GUESS)
    tau_is: float = number(0.8e-3, "s", "supply solenoid: time constant of the current", 1e-5, 0.02, _GUESS)
    t_xs: float = number(1.0e-3, "s", "supply solenoid: time to open without spring", 1e-4, 0.02, _GUESS)
    tau_ie: float = number(0.8e-3, "s", "exhaust solenoid: time constant of the current", 1e-5, 0.02, _GUESS)
    t_xe: float = number(1.0e-3, "s", "exhaust solenoid: time to open without spring", 1e-4, 0.02, _GUESS)
    f_x: float = number(0.35, "1", "solenoids: force of the closing spring over the largest force", 0.05, 0.6, _GUESS)
    # friction
    F_p: float = number(120.0, "N", "largest increase of seal friction by pressure", 0, 5e3, _GUESS)
    p_F: float = number(3e5, "Pa", "pressure for half of that increase", 1e3, 1e7, _GUESS)
    R_S: float = number(1.35, "1", "ratio of static to Coulomb friction", 1, 3)
    v_S: float = number(0.01, "m/s", "Stribeck velocity", 1e-4, 1)
    K_z: float = number(1e6, "N/m", "stiffness of the seals", 1e4, 1e7)
    D_z: float = number(800.0, "N·s/m", "elasto-plastic seals: damping at rest", 0, 1e4, _GUESS)
    x_b: float = number(0.6, "1", "elasto-plastic seals: elastic fraction of the steady deflection", 0.01, 0.99, _GUESS)
    v_g: float = number(1.0, "m/s", "velocity at which shear halves the viscous friction", 0.01, 1e9, _GUESS)
    T_V: float = number(120.0, "K", "grease: Vogel temperature", 0, 200, _GUESS)
    B_V: float = number(300.0, "K", "grease: Vogel constant", 0, 5e3, "twice at -30 °C, half at 80 °C")
    # clutch
    gap: float = number(1.5e-4, "m", "gap between release bearing and fingers", 0, 2e-3, _GUESS)
    F_k: float = number(5200.0, "N", "peak force at the fingers", 100, 2e4)
    F_v: float = number(3900.0, "N", "cubic: force in the valley; tabulated: at 30 mm", 100, 2e4)
    x_0: float = number(0.011, "m", "cubic: deflection of the new clutch beyond the peak", -0.02, 0.05, _GUESS)
    x_v: float = number(0.038, "m", "cubic: distance from peak to valley", 0.005, 0.2, _GUESS)
    i_x: float = number(6.0, "1", "cubic: shift of the deflection per wear", 0, 20)
    s_c: float = number(3.2e-3, "m", "cubic: travel of the fingers that frees the cushion", 1e-4, 0.02, _GUESS)
    a_c: float = number(40.0, "1/m", "cubic: decrease of that travel with wear", 0, 200, _GUESS)
    K_s: float = number(2.2e6, "N/m", "cubic: stiffness of the fingers", 1e5, 1e9, "60 kN/mm at the rim")
    s_k: float = number(9e-3, "m", "tabulated: travel at the peak", 2e-3, 0.025, _GUESS)
    a_k: float = number(25.0, "1/m", "tabulated: increase of the force with wear", 0, 500, _GUESS)
    a_s: float = number(0.3, "1", "tabulated: shift of the peak per wear", 0, 2, _GUESS)
    F_b: float = number(15.0, "N", "play of the release bearing: friction without load", 1e-2, 500, _GUESS)
    mu_b: float = number(0.02, "1", "play of the release bearing: half hysteresis over load", 0, 0.2)
    K_b: float = number(8e5, "N/m", "play of the release bearing: stiffness", 1, 1e7, _GUESS)
    mu_f: float = number(0.015, "1", "play of the fingers: half hysteresis over load", 0, 0.2)
    K_f: float = number(2e5, "N/m", "play of the fingers: stiffness", 1, 1e7, _GUESS)
    # sensors
    e_lin: float = number(0.007, "1", "position: variation of the gain over the stroke", -0.05, 0.05, _GUESS)
    s_c_y: float = number(1.5e-5, "m", "position: coloured noise, rms", 0, 1e-3, _GUESS)
    tau_c: float = number(4e-3, "s", "position and pressure: correlation time of the coloured noise", 1e-5, 1, _GUESS)
    e_gain: float = number(0.0, "1", "pressure: error of the gain", -0.1, 0.1, _GUESS)
    load: str = choice("cubic", LOADS)
    valve: str = choice("spool", VALVES)
    spool: str = choice("second-order", SPOOLS)
    friction: str = choice("maxwell-slip", FRICTIONS)
    duty: str = choice("latched", DUTIES)

    def contradictions(self) -> Iterator[str]:
        """Contradictions between parameters that are admissible individually."""
        yield from Vehicle.contradictions(self)
        if self.n_p > self.gamma:
            yield f"n_p = {self.n_p:g}: air is at most adiabatic, so n_p must not exceed gamma = {self.gamma:g}."
        if self.F_v >= self.F_k:
            yield f"F_v = {self.F_v:g} N: the valley must lie below the peak, F_k = {self.F_k:g} N."
        if self.a_c * self.wear > 0.5:
            yield f"wear = {self.wear * 1e3:g} mm leaves less than half of the cushion's travel; a_c is {self.a_c:g}/m."


#: States of the plant, see `clutchid.truck.second.plant`.
STATES = (
    "y", "v", "m_A", "p_A", "m_D", "p_D", "m_B", "p_B", "p_S", "x_R", "z_1", "z_2", "z_3", "z_4", "z_b", "z_f", "x_s",
    "x_e",
)  # fmt: skip
#: Inputs, constant over a tick: rates of both openings.
INPUTS = ("r_s", "r_e")

#: Parameters of a truck in the equations; y_r follows from its age.
PARAMETERS = (
    "A_A", "A_B", "V_0A", "V_D", "V_0B", "y_max", "y_r", "M", "R", "gamma", "n_p", "tau_w", "P_0", "T_0", "T_w", "A_s",
    "A_e", "A_r", "C_t", "dp_t", "r_lam", "C_AB", "C_A0", "V_S", "p_T", "A_R", "dp_R", "tau_R", "P_S", "F_C", "F_p",
    "p_F", "R_S", "v_S", "K_z", "D_z", "x_b", "plastic", "D_v", "v_g", "T_V", "B_V", "F_b", "mu_b", "K_b", "mu_f",
    "K_f", "K_stop", "chi",
)  # fmt: skip

#: Further parameters of the loop, in the order of its array.
SETTINGS = (
    "period", "timer", "bang_bang", "continuous", "spool", "second_order", "tau_x", "t_n", "zeta_x", "x_0s", "x_0e",
    "n_x", "tau_is", "t_xs", "tau_ie", "t_xe", "f_x", "dead_s", "dead_e", "zero", "quantum", "rest", "stroke", "e_lin",
    "tau_y", "tau_p", "band", "lead", "e_in", "e_out",
)  # fmt: skip
