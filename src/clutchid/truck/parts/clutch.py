"""Clutch with a diaphragm spring in series with cover and cushion, or a textbook's exponential load."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.truck.parts.part import Clutch, Numbers
from clutchid.truck.parts.springs import cushion_compression, cushion_force, diaphragm_force, kluever_force
from clutchid.truck.rows import choice, number

SHARED = ("F_r", "k_r", "i_w", "a_H")


@dataclass(frozen=True, kw_only=True)
class DiaphragmRows:
    """Diaphragm, cover and cushion; or the amplitude, steepness and decrease of an exponential load."""

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
    a_k_w: float = number(30.0, "1/m", "Kluever's load: increase with wear", 0, 500, "assumption, 3 % per mm")
    load: str = choice("diaphragm", ("diaphragm", "kluever"))


#: Travel in m that counts as the touch point of Kluever's load.
_KLUEVER_TOUCH = 6e-3
#: Fraction of the clamping force at the touch point.
_TOUCH = 0.15


#: Number of strokes that scales the relaxation of the springs.
_RELAXATION = 2e5


def _worn(truck: Any) -> Numbers:
    r"""Parameters that the age of the clutch changes, and the position of the engaged rest.

    .. math:: (H, F_r) \propto 1 - a_H (1 - e^{-cycles / (2 \cdot 10^5)}), \quad y_r = -i_w \, wear

    Returns
    -------
    parameters
        ``H`` [m], ``F_r`` [N] and the rest ``y_r`` [m], which is 0 for the new truck and negative for a worn one.

    References
    ----------
    Push-type clutch: the engaged rest moves towards the cylinder as the facing wears (truck specification). The law
    over strokes is an assumption: steel relaxes early.

    Examples
    --------
    >>> from clutchid.truck import Truck
    >>> f"{_worn(Truck(wear=2e-3, cycles=1e6))['y_r'] * 1e3:.1f} mm"
    '-0.6 mm'
    """
    relaxed = 1 - truck.a_H * (1 - math.exp(-truck.cycles / _RELAXATION))
    return {"H": truck.H * relaxed, "F_r": truck.F_r * relaxed, "y_r": -truck.i_w * truck.wear}


def clutch_force(truck: Any, travel: FloatArray, age: Numbers) -> tuple[FloatArray, float]:
    r"""Force of the clutch at the actuator in N over its travel in m, and the travel at the touch point.

    .. math:: y = y_r + i_l \left(s + \frac{F}{K_c}\right), \quad F = P_1(l_0 - w + s) - F_{cushion}(c_0 - s), \quad
              f_l = \frac{F}{i_l} + F_r + k_r y

    The pressure plate lifts by s; cover and fingers deflect by F / K_c in series; the cushion, compressed by c_0 in the
    engaged clutch, reduces the load until it is free. The return spring acts in parallel.

    Raises
    ------
    ParameterError
        If the diaphragm does not clamp, or snaps through.

    Examples
    --------
    >>> from clutchid.truck import Truck, load_curve
    >>> curve = load_curve(Truck())
    >>> f"{curve.force(np.array([8.1e-3]))[0] - 40 - 1500 * 8.1e-3:.0f} N, touch point at {curve.touch * 1e3:.1f} mm"
    '4771 N, touch point at 5.7 mm'
    """
    return (_diaphragm if truck.load == "diaphragm" else _kluever)(truck, travel, age)


def _diaphragm(t: Any, travel: FloatArray, age: Numbers) -> tuple[FloatArray, float]:
    steel = (t.E, t.nu, t.h, age["H"], t.R_d, t.r_d, t.R_1, t.r_1)
    l_w = t.l_0 - t.wear
    clamp = diaphragm_force(l_w, *steel)
    if clamp <= 0:
        raise ParameterError(f"springs: the diaphragm does not clamp at l = {l_w * 1e3:g} mm. Check H, h and l_0.")
    c_0 = cushion_compression(clamp, t.F_cu, t.c_cu, t.n_cu)

    def rim(s: FloatArray) -> FloatArray:
        cushion = cushion_force(np.maximum(c_0 - s, 0.0), t.F_cu, t.c_cu, t.n_cu)
        force: FloatArray = diaphragm_force(l_w + s, *steel) - cushion
        return force

    low, high = np.zeros_like(travel), travel / t.i_l + clamp / t.K_c
    for _ in range(60):  # bisection: the travel increases with s as long as the springs in series are stable
        middle = 0.5 * (low + high)
        below = t.i_l * (middle + rim(middle) / t.K_c) < travel
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    lift = 0.5 * (low + high)
    snaps = np.any(np.diff(lift) > 10 * np.diff(travel) / t.i_l)
    if snaps or np.abs(t.i_l * (lift + rim(lift) / t.K_c) - travel).max() > 1e-9:
        raise ParameterError(f"K_c = {t.K_c:g} N/m: the diaphragm snaps through with a cover this soft; increase K_c.")
    free = c_0 - cushion_compression(_TOUCH * clamp, t.F_cu, t.c_cu, t.n_cu)
    return rim(lift) / t.i_l, float(t.i_l * (free + rim(np.array([free]))[0] / t.K_c))


def _kluever(t: Any, travel: FloatArray, _: Numbers) -> tuple[FloatArray, float]:
    return (1 + t.a_k_w * t.wear) * kluever_force(travel, t.F_k, t.a_k, t.k_k), _KLUEVER_TOUCH


def _contradictions(t: Any) -> Iterator[str]:
    if not t.r_d < t.r_1 < t.R_1 < t.R_d:
        radii = f"{t.r_d:g}, {t.r_1:g}, {t.R_1:g}, {t.R_d:g} m"
        yield f"r_d, r_1, R_1, R_d = {radii}: the radii must increase in this order."
    if t.l_0 <= t.wear <= t.w_max:
        yield f"wear = {t.wear * 1e3:g} mm fully unloads the diaphragm; l_0 is {t.l_0 * 1e3:g} mm."


DIAPHRAGM = Clutch(
    name="diaphragm or exponential", rows=DiaphragmRows, shared=SHARED, numbers=_worn, contradictions=_contradictions,
    force=clutch_force,
)  # fmt: skip
