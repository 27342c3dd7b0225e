"""Load on the piston of a truck of family A, computed once from its springs."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.truck.ageing import worn_parameters
from clutchid.truck.load_table import LoadCurve, load_table, travels
from clutchid.truck.parameters import Truck
from clutchid.truck.springs import cushion_compression, cushion_force, diaphragm_force, kluever_force

#: Travel in m that counts as the touch point of Kluever's load.
KLUEVER_TOUCH = 6e-3
#: Fraction of the clamping force at the touch point.
TOUCH = 0.15


@lru_cache(maxsize=64)
def load_curve(truck: Truck) -> LoadCurve:
    r"""Load curve of `truck` at its age.

    .. math:: y = y_r + i_l \left(s + \frac{F}{K_c}\right), \quad F = P_1(l_0 - w + s) - F_{cushion}(c_0 - s), \quad
              f_l = \frac{F}{i_l} + F_r + k_r y

    The pressure plate lifts by s; cover and fingers deflect by F / K_c in series; the cushion, compressed by c_0 in the
    engaged clutch, reduces the load until it is free. The return spring acts in parallel.

    Raises
    ------
    ParameterError
        If the load is negative somewhere in the stroke, or the diaphragm snaps through.

    Examples
    --------
    >>> curve = load_curve(Truck())
    >>> f"{curve.force(np.array([8.1e-3]))[0] - 40 - 1500 * 8.1e-3:.0f} N, touch point at {curve.touch * 1e3:.1f} mm"
    '4771 N, touch point at 5.7 mm'
    """
    worn = worn_parameters(truck)
    travel = travels(truck, worn["y_r"])
    force, touch = _diaphragm(truck, travel) if truck.load == "diaphragm" else _kluever(truck, travel)
    return load_table(truck, worn["y_r"], force, touch, worn["F_r"])


def _diaphragm(t: Truck, travel: FloatArray) -> tuple[FloatArray, float]:
    """Force at the actuator over its travel, and the travel at the touch point."""
    steel = (t.E, t.nu, t.h, worn_parameters(t)["H"], t.R_d, t.r_d, t.R_1, t.r_1)
    l_w = t.l_0 - t.wear
    clamp = diaphragm_force(l_w, *steel)
    if clamp <= 0:
        raise ParameterError(f"springs: the diaphragm does not clamp at l = {l_w * 1e3:g} mm. Check H, h and l_0.")
    c_0 = cushion_compression(clamp, t.F_cu, t.c_cu, t.n_cu)

    def cushion(s: FloatArray) -> FloatArray:
        force: FloatArray = cushion_force(np.maximum(c_0 - s, 0.0), t.F_cu, t.c_cu, t.n_cu)
        return force

    def rim(s: FloatArray) -> FloatArray:
        force: FloatArray = diaphragm_force(l_w + s, *steel) - cushion(s)
        return force

    low, high = np.zeros_like(travel), travel / t.i_l + clamp / t.K_c
    for _ in range(60):  # bisection: the travel increases with s as long as the springs in series are stable
        middle = 0.5 * (low + high)
        below = t.i_l * (middle + rim(middle) / t.K_c) < travel
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    lift = 0.5 * (low + high)
    if np.abs(t.i_l * (lift + rim(lift) / t.K_c) - travel).max() > 1e-9 or np.any(
        np.diff(lift) > 10 * np.diff(travel) / t.i_l
    ):
        raise ParameterError(f"K_c = {t.K_c:g} N/m: the diaphragm snaps through with a cover this soft; increase K_c.")
    free = c_0 - cushion_compression(TOUCH * clamp, t.F_cu, t.c_cu, t.n_cu)
    return rim(lift) / t.i_l, float(t.i_l * (free + rim(np.array([free]))[0] / t.K_c))


def _kluever(t: Truck, travel: FloatArray) -> tuple[FloatArray, float]:
    force: FloatArray = (1 + t.a_k_w * t.wear) * kluever_force(travel, t.F_k, t.a_k, t.k_k)
    return force, KLUEVER_TOUCH
