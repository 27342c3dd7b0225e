"""Springs of the clutch: the diaphragm spring after Almen and Laszlo, the cushion of the facing, a textbook curve."""

from __future__ import annotations

import numpy as np

from clutchid.codegen.system import Expr


def diaphragm_force(
    l: Expr, E: Expr, nu: Expr, h: Expr, H: Expr, R_d: Expr, r_d: Expr, R_1: Expr, r_1: Expr,  # noqa: E741
) -> Expr:  # fmt: skip
    r"""Clamping force of a diaphragm spring at the deflection l, after Almen and Laszlo in clutch form.

    .. math:: P_1 = \frac{\pi E h l \ln(R/r)}{6 (1 - \nu^2) (R_1 - r_1)^2}
              \left((H - l k)\left(H - \frac{l k}{2}\right) + h^2\right), \quad k = \frac{R - r}{R_1 - r_1}

    Parameters
    ----------
    l : m
        Deflection at the rim, at least 0.
    E : Pa
        Young's modulus, above 0.
    nu : 1
        Poisson's ratio.
    h, H : m
        Thickness, and height of the cone when free.
    R_d, r_d : m
        Outer and inner radius of the cone.
    R_1, r_1 : m
        Radii on which pressure plate and cover bear.

    Returns
    -------
    P_1 : N

    References
    ----------
    Almen and Laszlo, Trans. ASME 58 (1936), in the form used for clutches; dimensions from the truck specification.

    Examples
    --------
    The force has a maximum and then a minimum:

    >>> steel = (206e9, 0.3, 5.6e-3, 9.9e-3, 0.204, 0.160, 0.202, 0.163)
    >>> " ".join(f"{diaphragm_force(l * 1e-3, *steel) / 1e3:.1f}" for l in (3, 5.73, 7.5, 11.8))
    '27.0 33.0 31.4 25.4'
    """
    k = (R_d - r_d) / (R_1 - r_1)
    plate = np.pi * E * h * l * np.log(R_d / r_d) / (6 * (1 - nu**2) * (R_1 - r_1) ** 2)
    return plate * ((H - l * k) * (H - l * k / 2) + h**2)


def cushion_force(c: Expr, F_cu: Expr, c_cu: Expr, n_cu: Expr) -> Expr:
    r"""Force of the cushion springs between the facings, compressed by c.

    .. math:: F = F_{cu} \, (c / c_{cu})^{n_{cu}}

    Parameters
    ----------
    c : m
        Compression, at least 0.
    F_cu, c_cu : N, m
        Reference force and the compression at that force, above 0.
    n_cu : 1
        Exponent, at least 1.

    Returns
    -------
    F : N

    References
    ----------
    30 kN (c / 0.8 mm)^2.2 from the truck specification.

    Examples
    --------
    >>> round(cushion_force(0.4e-3, 30e3, 0.8e-3, 2.2))
    6529
    """
    return F_cu * (c / c_cu) ** n_cu


def cushion_compression(F: Expr, F_cu: Expr, c_cu: Expr, n_cu: Expr) -> Expr:
    r"""Compression of the cushion under the force F, the inverse of `cushion_force`.

    .. math:: c = c_{cu} \, (F / F_{cu})^{1 / n_{cu}}

    Parameters
    ----------
    F : N
        Force, at least 0.
    F_cu, c_cu, n_cu
        As in `cushion_force`.

    Returns
    -------
    c : m

    References
    ----------
    As `cushion_force`.

    Examples
    --------
    >>> f"{cushion_compression(31.4e3, 30e3, 0.8e-3, 2.2) * 1e3:.2f} mm"
    '0.82 mm'
    """
    return c_cu * (F / F_cu) ** (1 / n_cu)


def kluever_force(s: Expr, F_k: Expr, a_k: Expr, k_k: Expr) -> Expr:
    r"""Load of a clutch actuator in a textbook of dynamics.

    .. math:: f = F_k (1 - \exp(-a_k s)) - k_k s

    Parameters
    ----------
    s : m
        Travel from the engaged clutch, at least 0.
    F_k : N
        Amplitude, above 0.
    a_k : 1/m
        Steepness, above 0.
    k_k : N/m
        Decrease with travel, at least 0.

    Returns
    -------
    f : N

    References
    ----------
    Kluever, Dynamic Systems, problem 6.28: 4000 (1 - exp(-500 x)) - 20000 x.

    Examples
    --------
    >>> round(kluever_force(0.006, 4000, 500, 20000))
    3681
    """
    return F_k * (1 - np.exp(-a_k * s)) - k_k * s
