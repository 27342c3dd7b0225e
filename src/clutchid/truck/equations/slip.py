"""Friction: Maxwell slip or elasto-plastic bristles, grease, and play in release bearing and fingers."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr
from clutchid.truck.equations.flow import T_N as T_REF
from clutchid.truck.equations.motion import Definitions

#: Time in s within which an element that slips gives up deflection beyond its limit; passive up to limit / time.
SLIP_TIME = 2e-4
#: Maxwell slip: share of the stiffness and of the friction of each element; the stiffest slips first.
STIFFNESS, LIMIT = (0.4, 0.3, 0.2, 0.1), (0.16, 0.24, 0.3, 0.3)
#: Stiction of the plastic bristles: velocity in m/s at which their damping has decayed.
V_D = 0.02


def lip_force(p_A: Expr, p_B: Expr, F_C: Expr, F_p: Expr, p_F: Expr) -> Expr:
    r"""Coulomb friction of a lip seal that the pressure flattens: it saturates.

    .. math:: F = F_C + F_p \, \frac{|p_A - p_B|}{|p_A - p_B| + p_F}

    Parameters
    ----------
    p_A, p_B : Pa
        Pressures on both sides of the piston.
    F_C, F_p : N
        Friction without pressure, above 0, and its largest increase, at least 0.
    p_F : Pa
        Pressure at which half of the increase is reached, above 0.

    Returns
    -------
    F : N

    References
    ----------
    Assumption.

    Examples
    --------
    >>> lip_force(4e5, 1e5, 100.0, 80.0, 3e5)
    140.000000000000
    """
    dp = sp.Abs(p_A - p_B)
    return F_C + F_p * dp / (dp + p_F)


def breakaway_force(v: Expr, F: Expr, R_S: Expr, v_S: Expr) -> Expr:
    r"""Friction while sliding at the velocity v, from static to Coulomb friction.

    .. math:: g = F \left(1 + (R_S - 1) e^{-|v| / v_S}\right)

    Parameters
    ----------
    v : m/s
        Velocity.
    F : N
        Coulomb friction, above 0.
    R_S, v_S : 1, m/s
        Ratio of static to Coulomb friction, at least 1, and Stribeck velocity, above 0.

    Returns
    -------
    g : N

    References
    ----------
    Bo and Pavelescu's exponential form of the Stribeck curve, with exponent 1 (recalled, not verified).

    Examples
    --------
    >>> round(breakaway_force(0.0, 200, 1.4, 0.01)), round(breakaway_force(0.1, 200, 1.4, 0.01))
    (280, 200)
    """
    return F * (1 + (R_S - 1) * sp.exp(-sp.Abs(v) / v_S))


def slip_rate(v: Expr, z: Expr, K: Expr, W: Expr) -> Expr:
    r"""Rate of the deflection of an element that sticks, elastically, up to the force W and then slips.

    .. math:: \dot z = v - \frac{\max(0, |z| - W / K)}{\tau} \operatorname{sign} z

    Parameters
    ----------
    v : m/s
        Velocity.
    z : m
        Deflection.
    K, W : N/m, N
        Stiffness and limit of the force, above 0.

    Returns
    -------
    z_dot : m/s

    Notes
    -----
    The rate-independent element has no relaxation (tau = 0); with tau = 0.2 ms the deflection exceeds the limit by
    v tau, which changes the force nowhere but within tau of a reversal.

    References
    ----------
    Iwan (1966); Maxwell slip after Al-Bender, Lampaert and Swevers (2005). y - z is the play operator of y.

    Examples
    --------
    >>> f"{slip_rate(0.1, 1e-4, 1e6, 200.0):.2f} {abs(slip_rate(0.1, 2.2e-4, 1e6, 200.0)):.2f}"
    '0.10 0.00'
    """
    over = sp.Abs(z) - W / K
    return v - sp.Piecewise((over * sp.Piecewise((1, z > 0), (-1, True)) / SLIP_TIME, over > 0), (0, True))


def slip_force(z: Expr, K: Expr, W: Expr) -> Expr:
    r"""Force of an element of `slip_rate`.

    .. math:: f = \min(W, \max(-W, K z))

    Parameters
    ----------
    z : m
        Deflection.
    K, W : N/m, N
        Stiffness and limit of the force, above 0.

    Returns
    -------
    f : N
        Against positive motion.

    References
    ----------
    As `slip_rate`.

    Examples
    --------
    >>> slip_force(1e-4, 1e6, 200.0), slip_force(-3e-4, 1e6, 200.0)
    (100.000000000000, -200.000000000000)
    """
    return sp.Piecewise((K * z, sp.Abs(z) * K < W), (W, z > 0), (-W, True))


def bristle_rate(v: Expr, z: Expr, K: Expr, g: Expr, x_b: Expr) -> Expr:
    r"""Rate of the deflection of elasto-plastic bristles: elastic up to x_b of the steady deflection, plastic beyond.

    .. math:: \dot z = v \left(1 - \alpha \frac{|z| K}{g}\right), \quad
              \alpha = \begin{cases} 0, & \zeta \le x_b \text{ or } z v < 0 \\
              \sin^2\left(\frac{\pi}{2} \frac{\zeta - x_b}{1 - x_b}\right), & x_b < \zeta < 1 \\ 1, & \zeta \ge 1
              \end{cases}, \quad \zeta = |z| K / g

    Parameters
    ----------
    v : m/s
        Velocity.
    z : m
        Deflection.
    K, g : N/m, N
        Stiffness, and friction while sliding, above 0.
    x_b : 1
        Fraction of the steady deflection without plastic motion, in (0, 1).

    Returns
    -------
    z_dot : m/s

    References
    ----------
    Dupont, Hayward, Armstrong and Altpeter, IEEE Trans. Automatic Control 47 (2002): no drift below x_b.

    Examples
    --------
    >>> bristle_rate(0.1, 1e-4, 1e6, 200.0, 0.6), bristle_rate(0.1, 2e-4, 1e6, 200.0, 0.6)
    (0.100000000000000, 0)
    """
    share = sp.Abs(z) * K / g
    rising = sp.sin(sp.pi / 2 * (share - x_b) / (1 - x_b)) ** 2
    plastic = sp.Piecewise((0, (share <= x_b) | (z * v < 0)), (rising, share < 1), (1, True))
    return v * (1 - plastic * share)


def bristle_force(z: Expr, z_dot: Expr, v: Expr, K: Expr, D: Expr, v_D: Expr) -> Expr:
    r"""Force of elasto-plastic bristles, whose damping vanishes while sliding fast.

    .. math:: f = K z + D e^{-(v / v_D)^2} \dot z

    Parameters
    ----------
    z, z_dot : m, m/s
        Deflection and its rate.
    v : m/s
        Velocity.
    K, D : N/m, N·s/m
        Stiffness, above 0, and damping at rest, at least 0.
    v_D : m/s
        Velocity at which the damping has fallen to 37 %, above 0.

    Returns
    -------
    f : N
        Against positive motion.

    References
    ----------
    As `bristle_rate`; the decay of the damping keeps sliding dissipative.

    Examples
    --------
    >>> bristle_force(2e-4, 0.0, 0.1, 1e6, 500.0, 0.02)
    200.000000000000
    """
    return K * z + D * sp.exp(-((v / v_D) ** 2)) * z_dot


def grease_viscosity(T: Expr, T_N: Expr, T_V: Expr, B: Expr) -> Expr:
    r"""Viscosity of the grease relative to that at the reference temperature.

    .. math:: \eta = \exp\left(\frac{B}{T - T_V} - \frac{B}{T_N - T_V}\right)

    Parameters
    ----------
    T, T_N : K
        Temperature, and that of reference, above T_V.
    T_V, B : K
        Constants of the grease.

    Returns
    -------
    eta : 1

    References
    ----------
    Vogel's law; constants so that it is about twice at -30 °C and half at 80 °C (truck specification).

    Examples
    --------
    >>> f"{grease_viscosity(263.15, 293.15, 120.0, 300.0):.2f}"
    '1.44'
    """
    return sp.exp(B / (T - T_V) - B / (T_N - T_V))


def grease_force(v: Expr, D: Expr, v_g: Expr) -> Expr:
    r"""Viscous friction of a grease that thins under shear.

    .. math:: f = \frac{D v}{1 + |v| / v_g}

    Parameters
    ----------
    v : m/s
        Velocity.
    D : N·s/m
        Viscous friction at low speed, at least 0.
    v_g : m/s
        Velocity at which it has fallen to half, above 0.

    Returns
    -------
    f : N

    References
    ----------
    Assumption; greases thin under shear.

    Examples
    --------
    >>> grease_force(0.2, 4000.0, 0.8)
    640.000000000000
    """
    return D * v / (1 + sp.Abs(v) / v_g)


def forces(b: Definitions) -> tuple[Expr, Expr]:
    """Friction of the seals, and hysteresis of the load, against positive motion."""
    b["F_t"] = lip_force(b.p_A, b.p_B, b.F_C, b.F_p, b.p_F)
    b["g"] = breakaway_force(b.v, b.F_t, b.R_S, b.v_S)
    elements = list(zip((b.z_1, b.z_2, b.z_3, b.z_4), STIFFNESS, LIMIT, strict=True))
    b["plastic_rate"] = bristle_rate(b.v, b.z_1, b.K_z, b.g, b.x_b)
    b["f_z"] = sp.Piecewise(
        (bristle_force(b.z_1, b.plastic_rate, b.v, b.K_z, b.D_z, V_D), b.plastic > 0),
        (sum(slip_force(z, k * b.K_z, w * b.g) for z, k, w in elements), True),
    )
    b["z_1_rate"] = sp.Piecewise(
        (b.plastic_rate, b.plastic > 0), (slip_rate(b.v, b.z_1, STIFFNESS[0] * b.K_z, LIMIT[0] * b.g), True)
    )
    b["D_T"] = b.D_v * grease_viscosity(b.T_w, T_REF, b.T_V, b.B_V)
    b["f_g"] = grease_force(b.v, b.D_T, b.v_g)
    b["f_m"] = sp.Piecewise((b.f_l, b.f_l > 0), (0, True))
    b["W_b"] = b.F_b + b.mu_b * b.f_m
    b["W_f"] = b.F_b + b.mu_f * b.f_m
    b["f_h"] = slip_force(b.z_b, b.K_b, b.W_b) + slip_force(b.z_f, b.K_f, b.W_f)
    return b.f_z + b.f_g, b.f_h


def rates(b: Definitions) -> tuple[Expr, ...]:
    """Rates of the deflections of seals, release bearing and fingers."""
    slips = zip((b.z_2, b.z_3, b.z_4), STIFFNESS[1:], LIMIT[1:], strict=True)
    return (
        b.z_1_rate, *(slip_rate(b.v, z, k * b.K_z, w * b.g) for z, k, w in slips),
        slip_rate(b.v, b.z_b, b.K_b, b.W_b), slip_rate(b.v, b.z_f, b.K_f, b.W_f),
    )  # fmt: skip
