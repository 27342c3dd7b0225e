"""Clutch with a cubic diaphragm and a linear cushion, or a tabulated hump, both behind a gap."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchid.codegen.system import Expr
from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.truck.parts.clutch import SHARED
from clutchid.truck.parts.part import GUESS, Clutch, Numbers
from clutchid.truck.rows import choice, number

#: Number of strokes that scales the settling of the springs.
_SETTLING = 2e4
#: Fraction of the peak force at the touch point of the tabulated clutch.
_TOUCH = 0.85
#: Tabulated hump: fractions of the peak's travel, and of its force, up to the peak.
_RISE = ((0.0, 0.3, 0.55, 0.8, 1.0), (0.0, 0.24, 0.58, 0.92, 1.0))


@dataclass(frozen=True, kw_only=True)
class HumpRows:
    """A hump at the fingers, its cushion and gap."""

    gap: float = number(1.5e-4, "m", "gap between release bearing and fingers", 0, 2e-3, GUESS)
    F_k: float = number(5200.0, "N", "peak force at the fingers", 100, 2e4)
    F_v: float = number(3900.0, "N", "cubic: force in the valley; tabulated: at 30 mm", 100, 2e4)
    x_0: float = number(0.011, "m", "cubic: deflection of the new clutch beyond the peak", -0.02, 0.05, GUESS)
    x_v: float = number(0.038, "m", "cubic: distance from peak to valley", 0.005, 0.2, GUESS)
    i_x: float = number(6.0, "1", "cubic: shift of the deflection per wear", 0, 20)
    s_c: float = number(3.2e-3, "m", "cubic: travel of the fingers that frees the cushion", 1e-4, 0.02, GUESS)
    a_c: float = number(40.0, "1/m", "cubic: decrease of that travel with wear", 0, 200, GUESS)
    K_s: float = number(2.2e6, "N/m", "cubic: stiffness of the fingers", 1e5, 1e9, "60 kN/mm at the rim")
    s_k: float = number(9e-3, "m", "tabulated: travel at the peak", 2e-3, 0.025, GUESS)
    a_k: float = number(25.0, "1/m", "tabulated: increase of the force with wear", 0, 500, GUESS)
    a_s: float = number(0.3, "1", "tabulated: shift of the peak per wear", 0, 2, GUESS)
    load: str = choice("cubic", ("cubic", "tabulated"))


def cubic_hump(x: Expr, F_p: Expr, F_v: Expr, x_v: Expr) -> Expr:
    r"""Force of a diaphragm at its fingers, a cubic between its maximum at x = 0 and its minimum at x_v.

    .. math:: F = F_p - (F_p - F_v) \left(3 \xi^2 - 2 \xi^3\right), \quad \xi = x / x_v

    Parameters
    ----------
    x : m
        Deflection beyond that of the maximum.
    F_p, F_v : N
        Maximum and minimum, above 0.
    x_v : m
        Distance from the maximum to the minimum, above 0.

    Returns
    -------
    F : N

    References
    ----------
    A cubic is the form of every shallow disc spring; its numbers are taken directly at the fingers.

    Examples
    --------
    >>> [round(cubic_hump(x, 5000, 4000, 0.04)) for x in (0.0, 0.02, 0.04)]
    [5000, 4500, 4000]
    """
    share = x / x_v
    return F_p - (F_p - F_v) * share**2 * (3 - 2 * share)


def _worn(truck: Any) -> Numbers:
    r"""Parameters that the age of the clutch changes, and the position of the engaged rest.

    .. math:: F_p, F_v, F_r \propto 1 - a_H \log_{10} (1 + cycles / (2 \cdot 10^4)), \quad s_c (1 - a_c \, wear)

    Returns
    -------
    parameters
        ``F_r`` [N], ``relaxed`` [1], the travel of the cushion ``s_c`` [m], and the rest ``y_r`` [m].

    References
    ----------
    Assumptions, other ones than those of the diaphragm: steel settles.

    Examples
    --------
    >>> from clutchid.truck import TruckB
    >>> f"{_worn(TruckB(cycles=2e5))['relaxed']:.4f}"
    '0.9917'
    """
    relaxed = 1 - truck.a_H * math.log10(1 + truck.cycles / _SETTLING)
    return {
        "F_r": truck.F_r * relaxed, "relaxed": relaxed, "s_c": truck.s_c * (1 - truck.a_c * truck.wear),
        "y_r": -truck.i_w * truck.wear,
    }  # fmt: skip


def hump_force(truck: Any, travel: FloatArray, age: Numbers) -> tuple[FloatArray, float]:
    r"""Force of the clutch at the actuator in N over its travel in m, and the travel at the touch point.

    .. math:: y = y_r + \delta + s + F / K_s, \quad F = G(x_0 - i_x w + s) - \max(0, G(x_0 - i_x w) (1 - s / s_c))

    Behind the gap delta, the fingers lift by s against the diaphragm G while the linear cushion unloads over s_c; they
    bend by F / K_s. The tabulated clutch has a hump over y - y_r - delta instead; wear raises and shifts it.

    Raises
    ------
    ParameterError
        If the diaphragm snaps through.

    Examples
    --------
    >>> from clutchid.truck import TruckB, load_curve
    >>> curve = load_curve(TruckB())
    >>> f"{curve.force(np.array([9e-3]))[0]:.0f} N, touch point at {curve.touch * 1e3:.1f} mm"
    '4667 N, touch point at 5.5 mm'
    """
    force, touch = (_cubic if truck.load == "cubic" else _tabulated)(truck, np.maximum(travel - truck.gap, 0.0), age)
    return force, truck.gap + touch


def _cubic(t: Any, travel: FloatArray, age: dict[str, float]) -> tuple[FloatArray, float]:
    """Force over the travel behind the gap, and the travel at the touch point, where the cushion is free."""
    peak, valley = t.F_k * age["relaxed"], t.F_v * age["relaxed"]
    x_w = t.x_0 - t.i_x * t.wear
    clamp = cubic_hump(x_w, peak, valley, t.x_v)

    def fingers(s: FloatArray) -> FloatArray:
        force: FloatArray = cubic_hump(x_w + s, peak, valley, t.x_v) - clamp * np.maximum(1 - s / age["s_c"], 0.0)
        return force

    s = np.linspace(0.0, travel[-1], 20 * travel.size)
    moved = s + fingers(s) / t.K_s
    if np.any(np.diff(moved) <= 0):
        raise ParameterError(f"K_s = {t.K_s:g} N/m: the diaphragm snaps through with fingers this soft; increase K_s.")
    touch = age["s_c"] + float(fingers(np.array([age["s_c"]]))[0]) / t.K_s
    return fingers(np.interp(travel, moved, s)), touch


def _tabulated(t: Any, travel: FloatArray, age: dict[str, float]) -> tuple[FloatArray, float]:
    """Force over the travel behind the gap, and the travel at the touch point."""
    from scipy.interpolate import PchipInterpolator

    top = t.s_k - t.a_s * t.wear
    peak, end = (force * age["relaxed"] * (1 + t.a_k * t.wear) for force in (t.F_k, t.F_v))
    far = 0.03
    x = np.concatenate([top * np.array(_RISE[0]), [0.5 * (top + far), far]])
    force = np.concatenate([peak * np.array(_RISE[1]), [0.45 * peak + 0.55 * end, end]])
    hump = PchipInterpolator(x, force, extrapolate=True)
    fine = np.linspace(0.0, top, 1001)
    return hump(travel), float(np.interp(_TOUCH * peak, hump(fine), fine))


def _contradictions(t: Any) -> Iterator[str]:
    if t.F_v >= t.F_k:
        yield f"F_v = {t.F_v:g} N: the valley must lie below the peak, F_k = {t.F_k:g} N."
    if t.a_c * t.wear > 0.5:
        yield f"wear = {t.wear * 1e3:g} mm leaves less than half of the cushion's travel; a_c is {t.a_c:g}/m."


HUMP = Clutch(
    name="hump behind a gap", rows=HumpRows, shared=SHARED, numbers=_worn, contradictions=_contradictions,
    force=hump_force,
)  # fmt: skip
