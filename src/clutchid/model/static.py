"""Section 3.2: load and pressure at rest."""

from __future__ import annotations

from clutchid.codegen.system import Expr


def static_load(p_A: Expr, P_0: Expr, A_A: Expr) -> Expr:
    r"""Clutch load at rest from the pressure in chamber A, Eq. (25).

    .. math:: f_l = A_A (p_A - P_0)

    Parameters
    ----------
    p_A, P_0 : Pa
        Absolute pressure in chamber A and of the ambient.
    A_A : m²
        Piston area, above 0.

    Returns
    -------
    f_l : N

    Notes
    -----
    Drops friction, which is F_C = 200 N at rest and 1250 N more at 0.25 m/s; see `balanced_pressure`.

    Examples
    --------
    >>> f"{static_load(5e5, 1.095e5, 12.3e-3):.0f} N"
    '4803 N'
    """
    return A_A * (p_A - P_0)


def static_pressure(f_l: Expr, P_0: Expr, A_A: Expr) -> Expr:
    r"""Pressure in chamber A at rest from the clutch load, Eq. (26).

    .. math:: p_A = \frac{1}{A_A} (f_l + A_A P_0)

    Parameters
    ----------
    f_l : N
        Clutch load.
    P_0 : Pa
        Ambient pressure.
    A_A : m²
        Piston area, above 0.

    Returns
    -------
    p_A : Pa

    Examples
    --------
    >>> f"{static_pressure(4803.15, 1.095e5, 12.3e-3) / 1e5:.2f} bar"
    '5.00 bar'
    """
    return (f_l + A_A * P_0) / A_A


def balanced_pressure(
    a: Expr, p_B: Expr, f_l: Expr, f_f: Expr, f_s: Expr, A_A: Expr, A_B: Expr, P_0: Expr, M: Expr
) -> Expr:
    r"""Pressure in chamber A from the full balance of forces, Eq. (1) solved for p_A.

    .. math:: p_A = \frac{1}{A_A} (M a + A_B p_B + A_0 P_0 + f_l + f_f + f_s), \quad A_0 = A_A - A_B

    Parameters
    ----------
    a : m/s²
        Acceleration of the piston.
    p_B, f_l, f_f, f_s, A_A, A_B, P_0, M
        As in `clutchid.model.motion.acceleration`.

    Returns
    -------
    p_A : Pa

    Notes
    -----
    Eq. (26) with what it drops: in a stroke at full speed (26) is wrong by up to 1.3 bar.

    Examples
    --------
    >>> f"{balanced_pressure(0, 1.095e5, 4803.15, 200, 0, 12.3e-3, 11.848e-3, 1.095e5, 10) / 1e5:.2f} bar"
    '5.16 bar'
    """
    return (M * a + A_B * p_B + (A_A - A_B) * P_0 + f_l + f_f + f_s) / A_A
