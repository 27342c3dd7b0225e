"""Section 2.2: LuGre friction between piston and cylinder."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr


def friction_force(v: Expr, z: Expr, z_dot: Expr, D_v: Expr, K_z: Expr, D_zdot: Expr) -> Expr:
    r"""Friction between piston and cylinder, Eq. (2).

    .. math:: f_f = D_v v + K_z z + D_{\dot z} \dot z

    Parameters
    ----------
    v : m/s
        Piston velocity.
    z : m
        Pre-sliding deflection of the seal.
    z_dot : m/s
        Its rate, see `deflection_rate`.
    D_v, D_zdot : N·s/m
        Viscous friction and damping of the deflection, at least 0.
    K_z : N/m
        Stiffness of the deflection, above 0.

    Returns
    -------
    f_f : N
        Against positive motion.

    Raises
    ------
    Nothing: numbers are checked where they enter.

    Examples
    --------
    At 0.25 m/s the viscous part alone is worth 1 bar on chamber A:

    >>> f"{friction_force(0.25, 2e-4, 0, 5000, 1e6, 5000):.0f} N"
    '1450 N'
    """
    return D_v * v + K_z * z + D_zdot * z_dot


def deflection_rate(v: Expr, z: Expr, K_z: Expr, F_C: Expr) -> Expr:
    r"""Rate of the pre-sliding deflection of the seal, Eq. (3).

    .. math:: \dot z = v - \frac{K_z}{F_C} |v| z

    Parameters
    ----------
    v : m/s
        Piston velocity.
    z : m
        Deflection.
    K_z : N/m
        Stiffness of the deflection, above 0.
    F_C : N
        Coulomb friction, above 0.

    Returns
    -------
    z_dot : m/s

    Raises
    ------
    Nothing: numbers are checked where they enter.

    Examples
    --------
    In steady sliding the seal is deflected by F_C / K_z = 0.2 mm:

    >>> abs(deflection_rate(0.1, 2e-4, 1e6, 200)) < 1e-15
    True
    """
    return v - K_z / F_C * sp.Abs(v) * z
