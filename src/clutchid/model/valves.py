"""Section 2.4: flow through valves and orifice."""

from __future__ import annotations

import sympy as sp

from clutchid.codegen.system import Expr
from clutchid.model.chambers import P_N


def psi(r: Expr, B: Expr, B_0: Expr, r_lam: Expr) -> Expr:
    r"""Flow function of an orifice, Eqs. (6)-(9), laminar near r = 1.

    .. math:: \psi(r, B) = \Omega_0(r) + B \, \Omega_1(r, \mathrm{sgn} B)

    Parameters
    ----------
    r : 1
        Pressure behind over pressure before the orifice, at least 0.
    B : 1
        Flow shape in [-1, 1]: 1 is choked below `B_0` (ISO 6358), 0 the half ellipse, -1 the straight line 1 - r.
    B_0 : 1
        Critical pressure ratio, in (0, 1).
    r_lam : 1
        Pressure ratio above which psi is a straight line to 0 at r = 1.

    Returns
    -------
    psi : 1
        In [0, 1]; 0 where r >= 1.

    Notes
    -----
    For every B but -1 the printed curve reaches r = 1 with a vertical tangent, which no solver survives.

    Examples
    --------
    >>> f"{psi(0.3, 1, 0.528, 0.999):.2f}, {psi(0.6, 0, 0.528, 0.999):.2f}, {psi(0.6, -1, 0.528, 0.999):.2f}"
    '1.00, 0.80, 0.40'
    """
    laminar = (1 - r) / (1 - r_lam) * _printed_psi(r_lam, B, B_0)
    return sp.Piecewise((_printed_psi(r, B, B_0), r <= r_lam), (laminar, r <= 1), (0, True))


def _printed_psi(r: Expr, B: Expr, B_0: Expr) -> Expr:
    Omega_0 = sp.sqrt(1 - r**2)
    choked = sp.Piecewise((1, r <= B_0), (sp.sqrt(1 - ((r - B_0) / (1 - B_0)) ** 2), True))
    return sp.Piecewise(
        (Omega_0 + B * (choked - Omega_0), B > 0),
        (Omega_0 + B * (Omega_0 - (1 - r)), True),
    )


def orifice_flow(p_h: Expr, p_l: Expr, C: Expr, B: Expr, rho_0: Expr, B_0: Expr, r_lam: Expr = 0.999) -> Expr:
    r"""Air mass flow through an orifice, Eq. (10).

    .. math:: g = \rho_0 \, C \, \psi(p_l / p_h, B) \, p_h

    Parameters
    ----------
    p_h, p_l : Pa
        Absolute pressure before and behind the orifice, above 0.
    C : m³/(Pa·s)
        Conductance, at least 0.
    B : 1
        Flow shape in [-1, 1], see `psi`.
    rho_0 : kg/m³
        Reference density of air.
    B_0 : 1
        Critical pressure ratio, in (0, 1).
    r_lam : 1
        Pressure ratio above which the flow is laminar.

    Returns
    -------
    w : kg/s
        From `p_h` to `p_l`, never negative; 0 where p_l >= p_h.

    Notes
    -----
    rho_0 is missing in the Appendix: 1.185 kg/m³, the reference air of ISO 6358. The paper prints P_B before the
    exhaust valve; the air leaves chamber A, so it is p_A.

    Examples
    --------
    The open supply valve passes 20 g/s into an empty chamber:

    >>> f"{orifice_flow(9e5, 1.095e5, 19e-9, 0.1, 1.185, 0.582):.5f} kg/s"
    '0.02013 kg/s'
    """
    return rho_0 * C * psi(p_l / p_h, B, B_0, r_lam) * p_h


def iso_psi(r: Expr, b: Expr, m: Expr, r_lam: Expr) -> Expr:
    r"""Flow function of a pneumatic component by ISO 6358-1, laminar near r = 1.

    .. math:: \psi(r) = \left(1 - \left(\frac{\max(0, r - b)}{1 - b}\right)^2\right)^m, \quad r \le r_{lam}

    Parameters
    ----------
    r : 1
        Pressure behind over pressure before the orifice, at least 0.
    b : 1
        Critical pressure ratio, in [0, 1): below, the flow is choked.
    m : 1
        Subsonic index, above 0; 0.5 is the quarter ellipse of the older standard.
    r_lam : 1
        Pressure ratio above which psi is a straight line to 0 at r = 1.

    Returns
    -------
    psi : 1
        In [0, 1]; 0 where r >= 1.

    Notes
    -----
    Not in the paper. Its `psi` with one shape B misses an index of 0.7 by 6 % rms of the flow, and the load by as much.

    References
    ----------
    ISO 6358-1:2013, sonic conductance C, critical back-pressure ratio b, subsonic index m.

    Examples
    --------
    >>> [f"{iso_psi(r, 0.3, m, 0.999):.2f}" for r, m in ((0.2, 0.5), (0.65, 0.5), (0.65, 0.8))]
    ['1.00', '0.87', '0.79']
    """

    def turbulent(at: Expr) -> Expr:
        beyond = sp.Piecewise(((at - b) / (1 - b), at > b), (0, True))
        return (1 - beyond**2) ** m

    laminar = (1 - r) / (1 - r_lam) * turbulent(r_lam)
    return sp.Piecewise((turbulent(r), r <= r_lam), (laminar, r <= 1), (0, True))


def iso_flow(p_h: Expr, p_l: Expr, C: Expr, b: Expr, m: Expr, rho_0: Expr, r_lam: Expr = 0.999) -> Expr:
    r"""Air mass flow through a pneumatic component by ISO 6358-1, at the temperature of its reference.

    .. math:: g = \rho_0 \, C \, \psi(p_l / p_h, b, m) \, p_h

    Parameters
    ----------
    p_h, p_l : Pa
        Absolute pressure before and behind, above 0.
    C : m³/(Pa·s)
        Sonic conductance, at least 0.
    b, m : 1
        Critical pressure ratio and subsonic index, see `iso_psi`.
    rho_0 : kg/m³
        Reference density of air.
    r_lam : 1
        Pressure ratio above which the flow is laminar.

    Returns
    -------
    w : kg/s
        From `p_h` to `p_l`, never negative; 0 where p_l >= p_h.

    References
    ----------
    ISO 6358-1:2013.

    Examples
    --------
    >>> f"{iso_flow(9e5, 1.095e5, 19e-9, 0.3, 0.5, 1.185):.5f} kg/s"
    '0.02026 kg/s'
    """
    return rho_0 * C * iso_psi(p_l / p_h, b, m, r_lam) * p_h


def breathing_flow(
    p_B: Expr, P_0: Expr, C_r: Expr, B_in: Expr, B_out: Expr, rho_0: Expr, B_0: Expr, r_lam: Expr = 0.999
) -> Expr:
    r"""Air mass flow into chamber B through its fixed orifice, Eqs. (12) and (13).

    .. math:: w_r = w_{in} - w_{out} = \begin{cases} \rho_0 C_r \psi(p_B / P_0, B_{in}) P_0, & p_B < P_0 \\
              -\rho_0 C_r \psi(P_0 / p_B, B_{out}) p_B, & p_B \ge P_0 \end{cases}

    Parameters
    ----------
    p_B, P_0 : Pa
        Absolute pressure in chamber B and of the ambient, above 0.
    C_r : m³/(Pa·s)
        Conductance, at least 0.
    B_in, B_out : 1
        Flow shapes in [-1, 1].
    rho_0, B_0, r_lam
        As in `orifice_flow`.

    Returns
    -------
    w_r : kg/s
        Into chamber B.

    Notes
    -----
    As printed, (12) and (13) lack the upstream pressure and cancel each other; chamber B would be sealed.

    Examples
    --------
    >>> f"{breathing_flow(1.2e5, 1.095e5, 5e-8, 0.5, 0.5, 1.185, 0.582):.5f} kg/s"
    '-0.00363 kg/s'
    """
    w_in = orifice_flow(P_0, p_B, C_r, B_in, rho_0, B_0, r_lam)
    w_out = orifice_flow(p_B, P_0, C_r, B_out, rho_0, B_0, r_lam)
    return sp.Piecewise((w_in, p_B < P_0), (-w_out, True))


def thermal_factor(T_0: Expr, T: Expr) -> Expr:
    r"""Factor on the mass flow of an orifice where the air before it is not at T_0.

    .. math:: \sqrt{T_0 / T}

    Parameters
    ----------
    T_0 : K
        Temperature at which the conductance holds, above 0.
    T : K
        Temperature before the orifice, above 0.

    Returns
    -------
    factor : 1

    Notes
    -----
    Not in the paper, where all air is at T_0.

    References
    ----------
    ISO 6358-1:2013.

    Examples
    --------
    >>> f"{float(thermal_factor(293, 240)):.2f}"
    '1.10'
    """
    return sp.sqrt(T_0 / T)


def leak_flow(p: Expr, P_0: Expr, C: Expr, rho_0: Expr) -> Expr:
    r"""Leakage from a chamber through a narrow slit, such as past a worn seal.

    .. math:: w = \rho_0 \, C \, \frac{p^2 - P_0^2}{p_N}

    Parameters
    ----------
    p, P_0 : Pa
        Pressure in the chamber and ambient pressure, absolute.
    C : m³/(Pa·s)
        Conductance of the leak, at least 0.
    rho_0 : kg/m³
        Reference density.

    Returns
    -------
    w : kg/s
        Above 0 out of the chamber.

    Notes
    -----
    Not in the paper. p_N = 1 bar; the slit warms the air to the temperature at which the conductance holds.

    References
    ----------
    Isothermal viscous flow of an ideal gas through a slit grows with the difference of the squared pressures.

    Examples
    --------
    At 5 bar a leak of a thousandth of the supply valve's conductance loses a twentieth of a gram a second:

    >>> f"{leak_flow(5e5, 1e5, 19e-12, 1.185) * 1e3:.2f} g/s"
    '0.05 g/s'
    """
    return rho_0 * C * (p - P_0) * (p + P_0) / P_N
