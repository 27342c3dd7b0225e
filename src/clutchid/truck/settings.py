"""Time steps of a virtual truck, and the numbers of its valves, governor, sensors and controller."""

from __future__ import annotations

from typing import NamedTuple

from clutchid.log import FloatArray

#: Time step of valves and integration, and sampling time of sensor, controller and recording, in s.
TICK, SAMPLE = 1e-4, 1e-3
#: Ticks per sample, and steps of spool and armature in a tick.
TICKS, TICK_PARTS = 10, 4

#: Drives of the valves: magnets with dead times and ramps, a spool, or solenoids with current and armature.
MAGNETS, SPOOL, SOLENOIDS = 0, 1, 2

#: Time constants of the controller's filters for position and velocity, in s.
FILTER_Y, FILTER_V = 0.002, 0.005


class Plant(NamedTuple):
    """The plant as the loop moves it.

    States, which are moved; parameters in their order; room to work in; breakpoints and coefficients of the load;
    whether the state of the air is its energy; place of the supply valve's lift in the states (that of the exhaust
    valve is next), and of the governor's pressure, -1 without a governor; integration steps per tick.
    """

    x: FloatArray
    p: FloatArray
    work: FloatArray
    breakpoints: FloatArray
    load: FloatArray
    energy: bool
    x_s: int
    p_G: int
    substeps: int


class Course(NamedTuple):
    """Inputs of a run at every millisecond.

    Set point [m] relative to the sensor's zero, prescribed duty cycles (NaN: from the controller), noise of the
    position sensor [m], the first and last sample for which the sensor is stuck, and by how much in m the sensor reads
    more than the travel from the vented rest.
    """

    wanted: FloatArray
    forced: FloatArray
    noise: FloatArray
    stuck: tuple[int, int] = (-1, -1)
    shift: float = 0.0


class RunOutputs(NamedTuple):
    """Outputs of a run at every millisecond.

    States of the plant, measured position [m] relative to the sensor's zero, chamber pressure after the lag of its
    sensor [Pa], and both duty cycles.
    """

    states: FloatArray
    measured: FloatArray
    pressure: FloatArray
    duties: FloatArray


class Settings(NamedTuple):
    """Numbers of the loop around the plant; those of parts that a truck does not have are NaN.

    `working` is whether the compressor runs at the start, `valve` what moves the valves. Of the air the loop needs
    `gamma`, `V_0A` and `A_A`, for the pressure of a chamber whose state is its energy.
    """

    period: float
    timer: float
    bang_bang: float
    continuous: float
    working: float
    P_S: float
    dP_G: float
    r_up: float
    r_down: float
    valve: float
    t_1s: float
    t_2s: float
    t_3s: float
    t_4s: float
    t_1e: float
    t_2e: float
    t_3e: float
    t_4e: float
    second_order: float
    tau_x: float
    t_n: float
    zeta_x: float
    x_0s: float
    x_0e: float
    n_x: float
    tau_is: float
    t_xs: float
    tau_ie: float
    t_xe: float
    f_x: float
    dead_s: float
    dead_e: float
    zero: float
    q_y: float
    rest: float
    y_max: float
    e_lin: float
    tau_y: float
    tau_p: float
    L_p: float
    t_lead: float
    e_in: float
    e_out: float
    gamma: float
    V_0A: float
    A_A: float
