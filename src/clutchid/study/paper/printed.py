"""Values printed in the paper: Table 1, Table 2 and Eq. (21).

Keys of the tables are the paper's N; None is the ballistic row.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

#: Table 1, theta_1, theta_2, theta_3 in N/m; they belong to the basis with `PRINTED_SLOPE`.
TABLE_1: Mapping[int | None, tuple[float, float, float]] = MappingProxyType(
    {
        None: (9.3850e5, -0.5817e5, 0.3909e5),
        2: (8.4554e5, -0.1678e5, 0.0971e5),
        4: (8.5581e5, -0.2233e5, 0.0),
        8: (9.8251e5, -0.3468e5, 0.5386e5),
        16: (8.9178e5, -0.3527e5, 0.0),
        32: (8.8767e5, -0.5476e5, 0.0),
    }
)

#: Table 2, position error in m² and pressure error in Pa²; printed without a unit, as "average errors".
TABLE_2: Mapping[int | None, tuple[float, float]] = MappingProxyType(
    {
        None: (0.2678e-4, 2.7602e12),
        2: (8.8691e-4, 1.7203e12),
        4: (8.7327e-4, 1.7330e12),
        8: (3.3932e-4, 5.3149e12),
        16: (2.5684e-4, 2.1805e12),
        32: (4.1361e-3, 1.020e12),
    }
)

#: Slope of phi_2 at t_3 with which the printed xi_2 was computed; 1 by the stated conditions.
PRINTED_SLOPE = 0.001

#: Eq. (21), in the order of the page.
XI_1 = (-76.92308, 1.3077, -3.0769e-4)
XI_2 = (7.6923e-2, -3.0769e-7, -8.4968e-3)
XI_3 = (47.2372, -2.3327e3, -0.1610, 1.6900, 1.5163e-4, -6.9439e-3, -113.7192, 2.3327e3)

#: Order of the coefficients in the printed xi_3.
XI_3_ORDER = ("b_3", "a_3", "c_3", "g_3", "d_3", "h_3", "f_3", "e_3")
