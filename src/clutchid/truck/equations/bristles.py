"""Friction: LuGre with Stribeck effect, pressure and temperature at the seals; Dahl in release bearing and springs."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr
from clutchid.truck.equations.flow import T_N as T_REF
from clutchid.truck.equations.motion import Definitions


def coulomb_force(p_A: Expr, p_B: Expr, F_C: Expr, c_F: Expr) -> Expr:
    r"""Coulomb friction of the seals, which increases with the pressure on the lips.

    .. math:: F = F_C + c_F \, |p_A - p_B|

    Parameters
    ----------
    p_A, p_B : Pa
        Pressure in the chambers.
    F_C : N
        Friction without pressure, above 0.
    c_F : m²
        Increase with the pressure over the piston seal, at least 0.

    Returns
    -------
    F : N

    References
    ----------
    Magnitude from the truck specification, F_C(p).

    Examples
    --------
    >>> coulomb_force(5e5, 1e5, 150.0, 2e-4)
    230.000000000000
    """
    return F_C + c_F * sp.Abs(p_A - p_B)


def stribeck_force(v: Expr, F: Expr, R_S: Expr, v_S: Expr) -> Expr:
    r"""Steady friction at low speed: from stiction to Coulomb friction.

    .. math:: g = F \left(1 + \frac{R_S - 1}{1 + (v / v_S)^2}\right)

    Parameters
    ----------
    v : m/s
        Velocity.
    F : N
        Coulomb friction, above 0.
    R_S : 1
        Ratio of static to Coulomb friction, at least 1.
    v_S : m/s
        Stribeck velocity, above 0.

    Returns
    -------
    g : N

    References
    ----------
    Hess and Soom, Trans. ASME J. Tribology 112 (1990) (not verified); ratio 1.2 to 1.6 from the truck specification.

    Examples
    --------
    >>> stribeck_force(0.0, 200, 1.4, 0.01), stribeck_force(0.1, 200, 1.4, 0.01) < 201
    (280.0, True)
    """
    return F * (1 + (R_S - 1) / (1 + (v / v_S) ** 2))


def deflection_rate(v: Expr, z: Expr, K: Expr, g: Expr) -> Expr:
    r"""Rate of the elastic deflection of a sliding contact, LuGre and Dahl.

    .. math:: \dot z = v - \frac{K |v|}{g} z

    Parameters
    ----------
    v : m/s
        Velocity.
    z : m
        Deflection.
    K : N/m
        Stiffness, above 0.
    g : N
        Steady friction, above 0.

    Returns
    -------
    z_dot : m/s

    References
    ----------
    Canudas de Wit, Olsson, Aström and Lischinsky, IEEE Trans. Automatic Control 40 (1995).

    Examples
    --------
    >>> abs(deflection_rate(0.1, 2e-4, 1e6, 200.0)) < 1e-15
    True
    """
    return v - K / g * sp.Abs(v) * z


def seal_force(v: Expr, z: Expr, z_dot: Expr, K_z: Expr, D_z: Expr, v_z: Expr, D_v: Expr) -> Expr:
    r"""Friction of the seals; the damping of the deflection decays with speed, so that sliding is dissipative.

    .. math:: f = K_z z + \frac{D_z}{1 + (v / v_z)^2} \dot z + D_v v

    Parameters
    ----------
    v : m/s
        Velocity.
    z, z_dot : m, m/s
        Deflection and its rate.
    K_z : N/m
        Stiffness, above 0.
    D_z : N·s/m
        Damping at rest, at least 0.
    v_z : m/s
        Velocity at which the damping is halved, above 0.
    D_v : N·s/m
        Viscous friction, at least 0, see `viscous_friction`.

    Returns
    -------
    f : N
        Against positive motion.

    References
    ----------
    As `deflection_rate`; velocity-dependent damping: Olsson, thesis, Lund 1996 (not verified).

    Examples
    --------
    >>> round(seal_force(0.2, 2e-4, 0.0, 1e6, 5000, 0.05, 3000))
    800
    """
    return K_z * z + D_z / (1 + (v / v_z) ** 2) * z_dot + D_v * v


def viscous_friction(D_v: Expr, beta: Expr, T: Expr, T_N: Expr) -> Expr:
    r"""Viscous friction of the grease, which increases at low temperature.

    .. math:: D = D_v \exp(-\beta (T - T_N))

    Parameters
    ----------
    D_v : N·s/m
        At the reference temperature, at least 0.
    beta : 1/K
        Temperature coefficient, at least 0.
    T, T_N : K
        Temperature of the wall, and of reference.

    Returns
    -------
    D : N·s/m

    References
    ----------
    Reynolds' viscosity law; twice at -30 °C and half at 80 °C from the truck specification.

    Examples
    --------
    >>> f"{viscous_friction(4000, 0.0125, 243.15, 293.15):.0f} {viscous_friction(4000, 0.0125, 353.15, 293.15):.0f}"
    '7473 1889'
    """
    return D_v * sp.exp(-beta * (T - T_N))


def bearing_force(f_l: Expr, F_h: Expr, mu_h: Expr) -> Expr:
    r"""Steady friction of release bearing, fork and spring rims, half the width of the load's hysteresis.

    .. math:: g = F_h + \mu_h \max(0, f_l)

    Parameters
    ----------
    f_l : N
        Load.
    F_h : N
        Friction without load, above 0.
    mu_h : 1
        Fraction of the load, at least 0.

    Returns
    -------
    g : N

    References
    ----------
    Hysteresis of 5 to 10 % of the load from the truck specification, that is mu_h of 0.025 to 0.05.

    Examples
    --------
    >>> bearing_force(4000.0, 10, 0.04)
    170.000000000000
    """
    return F_h + mu_h * sp.Piecewise((f_l, f_l > 0), (0, True))


def forces(b: Definitions) -> tuple[Expr, Expr]:
    """Friction of the seals, and hysteresis of the load, against positive motion."""
    b["F_t"] = coulomb_force(b.p_A, b.p_B, b.F_C, b.c_F)
    b["z_dot"] = deflection_rate(b.v, b.z, b.K_z, stribeck_force(b.v, b.F_t, b.R_S, b.v_S))
    b["D_T"] = viscous_friction(b.D_v, b.beta, b.T_w, T_REF)
    b["f_f"] = seal_force(b.v, b.z, b.z_dot, b.K_z, b.D_z, b.v_z, b.D_T)
    b["f_h"] = b.K_h * b.z_h
    return b.f_f, b.f_h


def rates(b: Definitions) -> tuple[Expr, ...]:
    """Rates of the deflections of seals and release bearing."""
    return b.z_dot, deflection_rate(b.v, b.z_h, b.K_h, bearing_force(b.f_l, b.F_h, b.mu_h))
