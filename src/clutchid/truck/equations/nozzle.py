"""Air flow through a sharp-edged orifice as through a nozzle, with a measured discharge coefficient."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr


def discharge(r: Expr) -> Expr:
    r"""Discharge coefficient of a sharp-edged orifice over the pressure ratio.

    .. math:: C_d = 0.8414 - 0.1002 r + 0.8415 r^2 - 3.9 r^3 + 4.6001 r^4 - 1.6827 r^5

    References
    ----------
    Perry's measurements as a polynomial, usual in pneumatic servo systems (recalled, not verified).

    Examples
    --------
    >>> f"{discharge(0.0):.2f} {discharge(1.0):.2f}"
    '0.84 0.60'
    """
    return 0.8414 + r * (-0.1002 + r * (0.8415 + r * (-3.9 + r * (4.6001 - r * 1.6827))))


def nozzle_function(r: Expr, gamma: Expr, r_lam: Expr) -> Expr:
    r"""Isentropic flow through a nozzle, 1 when choked; linear near r = 1.

    .. math:: \psi = \sqrt{\frac{r^{2/\gamma} - r^{(\gamma+1)/\gamma}}{r_c^{2/\gamma} - r_c^{(\gamma+1)/\gamma}}},
              \quad r_c = \left(\frac{2}{\gamma + 1}\right)^{\gamma / (\gamma - 1)}

    Parameters
    ----------
    r : 1
        Ratio of downstream to upstream pressure, at least 0.
    gamma : 1
        Ratio of specific heats, above 1.
    r_lam : 1
        Ratio above which the flow is laminar, between the critical one and 1.

    Returns
    -------
    psi : 1
        In [0, 1].

    References
    ----------
    Textbook, de Saint-Venant and Wantzel; the linear part is added.

    Examples
    --------
    >>> f"{nozzle_function(0.3, 1.4, 0.995):.2f} {nozzle_function(0.9, 1.4, 0.995):.2f}"
    '1.00 0.62'
    """
    critical = (2 / (gamma + 1)) ** (gamma / (gamma - 1))

    def flow(ratio: Expr) -> Expr:
        return sp.sqrt(ratio ** (2 / gamma) - ratio ** ((gamma + 1) / gamma))

    line = flow(r_lam) / flow(critical) * (1 - r) / (1 - r_lam)
    return sp.Piecewise((1, r <= critical), (flow(r) / flow(critical), r <= r_lam), (line, r < 1), (0, True))


def nozzle_flow(p_h: Expr, p_l: Expr, T_h: Expr, A: Expr, R: Expr, gamma: Expr, r_lam: Expr) -> Expr:
    r"""Mass flow through a sharp-edged orifice.

    .. math:: w = C_d A p_h \sqrt{\frac{\gamma}{R T_h}} \left(\frac{2}{\gamma + 1}\right)^{\frac{\gamma + 1}
              {2 (\gamma - 1)}} \psi(p_l / p_h)

    Parameters
    ----------
    p_h, p_l : Pa
        Upstream and downstream pressure, above 0.
    T_h : K
        Upstream temperature, above 0.
    A : m²
        Area, at least 0.
    R, gamma, r_lam
        See `pressure_rate` and `nozzle_function`.

    Returns
    -------
    w : kg/s
        Never negative; 0 where p_l >= p_h.

    References
    ----------
    As `nozzle_function` and `discharge`.

    Examples
    --------
    >>> f"{nozzle_flow(9e5, 1e5, 293.15, 11.5e-6, 287.05, 1.4, 0.995) * 1e3:.0f} g/s"
    '20 g/s'
    """
    choked = sp.sqrt(gamma / (R * T_h)) * (2 / (gamma + 1)) ** ((gamma + 1) / (2 * (gamma - 1)))
    ratio = p_l / p_h
    return discharge(ratio) * A * p_h * choked * nozzle_function(ratio, gamma, r_lam)
