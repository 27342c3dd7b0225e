"""Warnings of a LuGre fit: parameters at a bound, a stiffness hidden by noise, a poor fit."""

from __future__ import annotations

from collections.abc import Mapping

from clutchid.parameters import Parameters

#: A fit in free run below this, in %, is called poor: the rigs of docs/friction.md have 83 to 93 %.
POOR_FIT = 70.0

#: Parameters that may be 0, the physical bound of a damping.
DAMPINGS = ("D_v", "D_zdot")


def unit_of(name: str) -> str:
    """Unit of a parameter of a fit, the zero of the force among them."""
    return "N" if name == "force_zero" else Parameters.row(name).unit


def at_bound(name: str, values: Mapping[str, float]) -> str:
    """Warning about a parameter at a bound of the search beyond which the cost decreases."""
    where = (
        f"{name} lies at a bound of the search, {values[name]:.3g} {unit_of(name)}, and the cost decreases beyond it"
    )
    if name in DAMPINGS:
        return (
            f"{where}: this recording does not determine it, and the intervals of the others treat it as fixed there."
        )
    advice = "this recording does not determine it, and the intervals of the others treat it as unknown"
    if name == "K_z":
        advice += (
            f" (F_C / K_z = {values['F_C'] / values['K_z'] * 1e3:.3g} mm); fix it at a known value (--fix K_z=VALUE)"
        )
    return f"{where}: {advice}."


def softened(noise: float, values: Mapping[str, float]) -> str:
    """Warning about a stiffness that is estimated too low because the noise of the position (m) moves the bristle."""
    return (
        f"the noise of the position, {noise * 1e3:.2g} mm, hides the stiffness: F_C / K_z = "
        f"{values['F_C'] / values['K_z'] * 1e3:.2g} mm. The true K_z is above {values['K_z']:.3g} N/m; it and "
        "D_zdot have no interval; fix it at a known value (--fix K_z=VALUE), or measure the position more finely."
    )


def poor(fit: float) -> list[str]:
    """Warning about a law that explains little of the force."""
    if fit >= POOR_FIT:
        return []
    return [
        f"the fit is poor, {fit:.1f} % in free run (a rig that this law describes has {POOR_FIT:g} % and more), and "
        "the intervals do not contain such errors: check the units, a pressure that changes, the inertia of moving "
        "parts (--inertia), and noise."
    ]
