"""Air supply: the governor of the compressor and the reservoir before the supply valve; beyond the paper."""

from __future__ import annotations

from clutchid.codegen.system import Expr


def governor_rate(p_G: Expr, P_S: Expr, tau_G: Expr) -> Expr:
    r"""Rate of the pressure that the compressor's governor keeps.

    .. math:: \dot p_G = \frac{P_S - p_G}{\tau_G}

    Parameters
    ----------
    p_G, P_S : Pa
        Pressure at the governor, and its mean.
    tau_G : s
        Time in which a swing of the governor is forgotten, above 0.

    Returns
    -------
    p_G_dot : Pa/s

    Notes
    -----
    Not in the paper, whose supply is constant. A governor lets the compressor work between two pressures, some tenths
    of a bar apart; that is noise to the model, remembered over tau_G. A simulation that starts at P_S stays there.

    Examples
    --------
    >>> governor_rate(9.2e5, 9e5, 10.0)
    -2000.0
    """
    return (P_S - p_G) / tau_G


def reservoir_rate(p_S: Expr, p_G: Expr, tau_S: Expr, w_vs: Expr, V_S: Expr, R: Expr, T_0: Expr) -> Expr:
    r"""Rate of the pressure in the reservoir before the supply valve.

    .. math:: \dot p_S = \frac{p_G - p_S}{\tau_S} - \frac{R T_0}{V_S} w_{vs}

    Parameters
    ----------
    p_S, p_G : Pa
        Pressure in the reservoir, and the pressure at the governor that it recovers to.
    tau_S : s
        Time of recovery, above 0.
    w_vs : kg/s
        Mass flow through the supply valve.
    V_S : m³
        Volume, above 0.
    R, T_0 : J/(kg·K), K
        Gas constant and temperature.

    Returns
    -------
    p_S_dot : Pa/s

    Notes
    -----
    Not in the paper, whose supply never sags. A full stroke takes 3 g of air: 0.2 bar of a reservoir of 10 l.

    Examples
    --------
    >>> f"{reservoir_rate(9e5, 9e5, 0.6, 0.02, 10e-3, 288, 293) / 1e5:.1f} bar/s"
    '-1.7 bar/s'
    """
    return (p_G - p_S) / tau_S - R * T_0 / V_S * w_vs
