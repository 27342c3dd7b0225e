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

    Examples
    --------
    In steady sliding the seal is deflected by F_C / K_z = 0.2 mm:

    >>> abs(deflection_rate(0.1, 2e-4, 1e6, 200)) < 1e-15
    True
    """
    return v - K_z / F_C * abs(v) * z


def coulomb_force(p_A: Expr, p_B: Expr, F_C: Expr, c_F: Expr) -> Expr:
    r"""Coulomb friction of seals that the pressure over the piston presses on.

    .. math:: F = F_C + c_F \, |p_A - p_B|

    Parameters
    ----------
    p_A, p_B : Pa
        Absolute pressure in chambers A and B.
    F_C : N
        Coulomb friction without pressure, above 0.
    c_F : m²
        Rise with the pressure difference, at least 0.

    Returns
    -------
    F : N

    Notes
    -----
    Not in the paper, whose friction does not know the pressure. Lip seals seal by being pressed on; measured pneumatic
    cylinders show friction in proportion to the pressure difference.

    Examples
    --------
    4 bar over the piston add 60 N:

    >>> f"{coulomb_force(5.1e5, 1.1e5, 200, 1.5e-4):.0f} N"
    '260 N'
    """
    return F_C + c_F * sp.Abs(p_A - p_B)


def stribeck_force(v: Expr, F_C: Expr, R_S: Expr, v_S: Expr) -> Expr:
    r"""Steady friction between static friction at rest and Coulomb friction at speed; g in the LuGre model.

    .. math:: g = F_C \left(1 + (R_S - 1) \, e^{-(v / v_S)^2}\right)

    Parameters
    ----------
    v : m/s
        Piston velocity.
    F_C : N
        Coulomb friction, above 0.
    R_S : 1
        Static over Coulomb friction, at least 1; with 1 this is the paper's friction.
    v_S : m/s
        Stribeck velocity, above 0.

    Returns
    -------
    g : N

    Notes
    -----
    The paper leaves the Stribeck effect out.

    References
    ----------
    Canudas de Wit, Olsson, Åström and Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425.

    Examples
    --------
    >>> f"{stribeck_force(0.0, 200, 1.3, 0.01):.0f} N at rest, {float(stribeck_force(0.1, 200, 1.3, 0.01)):.0f} N"
    '260 N at rest, 200 N'
    """
    return F_C * (1 + (R_S - 1) * sp.exp(-((v / v_S) ** 2)))


def bearing_force(f_l: Expr, F_h: Expr, mu_h: Expr) -> Expr:
    r"""Force at which the release bearing, the fork and the fingers of the diaphragm spring slip.

    .. math:: g = F_h + \mu_h \, \max(0, f_l)

    Parameters
    ----------
    f_l : N
        Load.
    F_h : N
        Friction without load, above 0.
    mu_h : 1
        Half the hysteresis of the load, as a share of it, at least 0.

    Returns
    -------
    g : N

    Notes
    -----
    Not in the paper. A clutch is released against more force than it engages with, by 5 to 10 % of the load. A model
    without that finds the load 0.5 % too low with a pressure sensor and 2 % without.

    Examples
    --------
    >>> bearing_force(4000.0, 10, 0.04)
    170.000000000000
    """
    return F_h + mu_h * sp.Piecewise((f_l, f_l > 0), (0, True))
