"""Age: what wear of the facing and the number of strokes do to a truck."""

from __future__ import annotations

import math

from clutchid.truck.parameters import Truck

#: Strokes over which rubber and seats wear, and over which the springs settle.
LIFE, SETTLING = 1e6, 2e5


def aged(truck: Truck, wear: float = 0.0, cycles: float = 0.0) -> Truck:
    """`truck` after more wear and strokes.

    Wear moves the working point of the diaphragm, the point where the clutch takes hold and the engaged rest of the
    piston; strokes raise seal friction and leaks and let the springs settle. The numbers of the new truck stay as they
    are, `wear` and `cycles` add up.

    Parameters
    ----------
    wear : m
        Further wear of the facing.
    cycles : 1
        Further strokes.

    Raises
    ------
    ParameterError
        If less than nothing wears, or more than the facing has.

    Examples
    --------
    >>> old = aged(aged(Truck(), wear=1e-3, cycles=2e5), wear=1e-3)
    >>> old.wear, old.cycles
    (0.002, 200000.0)
    """
    return truck.replace({"wear": truck.wear + wear, "cycles": truck.cycles + cycles})


def worn_numbers(truck: Truck) -> dict[str, float]:
    r"""Numbers of a truck at its age: those that strokes change, and the place of the engaged rest.

    .. math:: F = F_C (1 + a_F n), \quad C = C_0 (1 + a_C n), \quad n = cycles / 10^6, \qquad
              (H, F_r) \propto 1 - a_H (1 - e^{-cycles / (2 \cdot 10^5)}), \quad y_r = -i_w \, wear

    Returns
    -------
    numbers
        ``F_C`` [N], ``C_AB`` and ``C_A0`` [m³/(Pa·s)], ``H`` [m], ``F_r`` [N] and the rest ``y_r`` [m], which is 0 for
        the new truck and below it for a worn one.

    References
    ----------
    Push-type clutch: the engaged rest moves towards the cylinder as the facing wears (facts of the project). The laws
    over strokes are guesses of the usual form: rubber and seats wear steadily, steel settles early.

    Examples
    --------
    >>> round(worn_numbers(Truck(wear=2e-3, cycles=1e6))["F_C"])
    175
    """
    n = truck.cycles / LIFE
    settled = 1 - truck.a_H * (1 - math.exp(-truck.cycles / SETTLING))
    return {
        "F_C": truck.F_C * (1 + truck.a_F * n),
        "C_AB": truck.C_AB * (1 + truck.a_C * n),
        "C_A0": truck.C_A0 * (1 + truck.a_C * n),
        "H": truck.H * settled,
        "F_r": truck.F_r * settled,
        "y_r": -truck.i_w * truck.wear,
    }
