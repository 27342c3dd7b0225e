"""Run the compiled loop: parameters of a truck in the order of the loop, and the state of a truck at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.errors import ParameterError, SolveError
from clutchid.log import FloatArray
from clutchid.truck.ageing import worn_parameters
from clutchid.truck.compiled import loop
from clutchid.truck.law import SAMPLE, TICK
from clutchid.truck.load import LoadCurve, load_curve
from clutchid.truck.order import LEDGER, PARAMETERS, SETTINGS, STATES
from clutchid.truck.parameters import Truck

#: Controller output at which the bang-bang drive opens a valve.
BANG = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Inputs of a run at every millisecond.

    Set point [m] relative to the sensor's zero, prescribed duty cycles (NaN: from the controller), noise of the
    position sensor [m], and the first and last sample for which the sensor is stuck.
    """

    wanted: FloatArray
    forced: FloatArray
    noise: FloatArray
    stuck: tuple[int, int] = (-1, -1)


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Outputs of a run at every millisecond.

    States of the plant, measured position [m] relative to the sensor's zero, chamber pressure after the lag of its
    sensor [Pa], both duty cycles, and the mechanical position [m] of the sensor's zero.
    """

    states: FloatArray
    measured: FloatArray
    pressure: FloatArray
    duties: FloatArray
    zero: float

    @property
    def time(self) -> FloatArray:
        """Time of the samples in s."""
        return np.arange(len(self.measured)) / round(1 / SAMPLE)


def run(
    truck: Truck,
    course: Course,
    *,
    curve: LoadCurve | None = None,
    start: FloatArray | None = None,
    working: bool = True,
    substeps: int = 1,
    ledger: bool = False,
) -> Run:
    """Simulate `truck` with the inputs `course`, from the engaged rest or from `start`.

    Parameters
    ----------
    curve : LoadCurve, optional
        Load instead of that of the truck.
    start : states, optional
        In the order of `clutchid.truck.order.STATES`.
    working : bool
        Whether the compressor runs at the start.
    substeps : int
        Integration steps per tick of 0.1 ms.
    ledger : bool
        Add `clutchid.truck.order.LEDGER` as further states.

    Raises
    ------
    SolveError
        If the simulation produces values that are not finite; the text gives the time.
    """
    curve = load_curve(truck) if curve is None else curve
    x0 = at_rest(truck, curve) if start is None else np.array(start, dtype=np.float64)
    zero = rest_position(truck, curve) - truck.e_y
    if ledger:
        x0 = np.concatenate([x0, np.zeros(len(LEDGER))])
    n = course.wanted.size
    states, measured, pressure, duties = np.empty((n, x0.size)), np.empty(n), np.empty(n), np.empty((n, 2))
    failed = loop(ledger).drive(
        x0, _plant_parameters(truck), _settings(truck, zero, working), curve.breakpoints, curve.coefficients,
        course.wanted, course.forced, course.noise, np.array(course.stuck, dtype=np.int64), substeps,
        states, measured, pressure, duties,
    )  # fmt: skip
    if failed >= 0:
        raise SolveError(
            f"the simulation of the truck is not finite from {failed * SAMPLE:.3f} s on; its parameters are too "
            "extreme."
        )
    return Run(states, measured, pressure, duties, zero)


def at_rest(truck: Truck, curve: LoadCurve, p_G: float | None = None) -> FloatArray:
    """States of a vented truck whose piston rests at the engaged end; `p_G` is the governor's pressure, default P_S."""
    t, y = truck, rest_position(truck, curve)
    supply = t.P_S if p_G is None else p_G
    V_A, V_B = t.V_0A + t.A_A * y, t.V_0B + t.A_B * (t.y_max - y)
    air = [value for V in (V_A, V_B) for value in _air(t, t.P_0, V, t.T_0 + t.dT_w)]
    return np.array([y, 0.0, *air, *_air(t, supply, t.V_S, t.T_0), 0.0, 0.0, 0.0, 0.0, supply])


def _air(t: Truck, p: float, V: float, T: float) -> tuple[float, float]:
    """Mass and internal energy of the air in a volume."""
    return p * V / (t.R * T), p * V / (t.gamma - 1)


def rest_position(truck: Truck, curve: LoadCurve) -> float:
    """Mechanical position in m of the vented piston, pressed into the stop by the return spring."""
    depth = 0.0
    for _ in range(8):  # contracts by k_r / (stiffness of the stop), 1 in 1000
        force = float(curve.force(np.array([curve.rest - depth]))[0])
        depth = (max(force, 0.0) / truck.K_stop) ** (2 / 3)
    return curve.rest - depth


def _plant_parameters(truck: Truck) -> FloatArray:
    known = {name: getattr(truck, name) for name in PARAMETERS if hasattr(truck, name)}
    known |= worn_parameters(truck) | {"T_w": truck.T_0 + truck.dT_w}
    return np.array([known[name] for name in PARAMETERS])


def _settings(truck: Truck, zero: float, working: bool) -> FloatArray:
    period = round(truck.T_pwm / TICK)
    if period % round(SAMPLE / TICK):
        raise ParameterError(f"T_pwm = {truck.T_pwm:g} s: must be a multiple of the controller's {SAMPLE:g} s.")
    known = {name: float(getattr(truck, name)) for name in SETTINGS if hasattr(truck, name)}
    bang_bang = truck.drive == "bang-bang"
    known |= {"period": period, "timer": 1.0 / period, "bang_bang": bang_bang, "working": working, "zero": zero}
    known |= {f"dead_{valve}": BANG if bang_bang else known[f"t_1{valve}"] / truck.T_pwm for valve in "se"}
    known |= {"quantum": truck.q_y, "band": truck.L_p, "lead": truck.t_lead}
    return np.array([known[name] for name in SETTINGS], dtype=np.float64)


def column(states: FloatArray, name: str) -> FloatArray:
    """A state by its name in `clutchid.truck.order.STATES` or `LEDGER`."""
    result: FloatArray = states[:, (*STATES, *LEDGER).index(name)]
    return result
