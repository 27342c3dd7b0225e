"""Ageing: effect of facing wear and number of strokes on a truck."""

from __future__ import annotations

import math
from typing import TypeVar

from clutchid.truck.parameters import Truck
from clutchid.truck.vehicle import Vehicle

Kind = TypeVar("Kind", bound=Vehicle)

#: Numbers of strokes that scale the wear of rubber and seats, and the relaxation of the springs.
LIFE, RELAXATION = 1e6, 2e5


def aged(truck: Kind, wear: float = 0.0, cycles: float = 0.0) -> Kind:
    """`truck` after additional wear and strokes.

    Wear moves the working point of the diaphragm, the touch point of the clutch and the engaged rest of the piston;
    strokes increase seal friction and leakage and relax the springs. The parameters of the new truck are kept; `wear`
    and `cycles` accumulate.

    Parameters
    ----------
    wear : m
        Additional wear of the facing.
    cycles : 1
        Additional strokes.

    Raises
    ------
    ParameterError
        If the wear is negative or more than the facing allows.

    Examples
    --------
    >>> old = aged(aged(Truck(), wear=1e-3, cycles=2e5), wear=1e-3)
    >>> old.wear, old.cycles
    (0.002, 200000.0)
    """
    return truck.replace({"wear": truck.wear + wear, "cycles": truck.cycles + cycles})


def worn_parameters(truck: Truck) -> dict[str, float]:
    r"""Parameters of a truck at its age: those that strokes change, and the position of the engaged rest.

    .. math:: F = F_C (1 + a_F n), \quad C = C_0 (1 + a_C n), \quad n = cycles / 10^6, \qquad
              (H, F_r) \propto 1 - a_H (1 - e^{-cycles / (2 \cdot 10^5)}), \quad y_r = -i_w \, wear

    Returns
    -------
    parameters
        ``F_C`` [N], ``C_AB`` and ``C_A0`` [m³/(Pa·s)], ``H`` [m], ``F_r`` [N] and the rest ``y_r`` [m], which is 0 for
        the new truck and negative for a worn one.

    References
    ----------
    Push-type clutch: the engaged rest moves towards the cylinder as the facing wears (truck specification). The laws
    over strokes are assumptions: rubber and seats wear at a constant rate, steel relaxes early.

    Examples
    --------
    >>> round(worn_parameters(Truck(wear=2e-3, cycles=1e6))["F_C"])
    175
    """
    n = truck.cycles / LIFE
    relaxed = 1 - truck.a_H * (1 - math.exp(-truck.cycles / RELAXATION))
    return {
        "F_C": truck.F_C * (1 + truck.a_F * n),
        "C_AB": truck.C_AB * (1 + truck.a_C * n),
        "C_A0": truck.C_A0 * (1 + truck.a_C * n),
        "H": truck.H * relaxed,
        "F_r": truck.F_r * relaxed,
        "y_r": -truck.i_w * truck.wear,
    }
