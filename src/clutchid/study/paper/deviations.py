"""Deviations of this study from the paper, and reasons; the list on the page."""

from __future__ import annotations

#: One HTML sentence each; the full derivation is in the docstring of each equation.
DEVIATIONS = (
    "<b>Eq. (5), chamber B.</b> V<sub>B</sub> = V<sub>0B</sub> + A<sub>B</sub>(y<sub>max</sub> − y) with "
    "V<sub>0B</sub> as the dead volume at full stroke, y<sub>max</sub> = 25 mm; read literally, the volume turns "
    "negative at 10.13 mm.",
    "<b>Eq. (4), chamber A.</b> V<sub>A</sub> = V<sub>0A</sub> + A<sub>A</sub> y; the paper does not define it.",
    "<b>Eq. (10), density.</b> ρ<sub>0</sub> = 1.185 kg/m³ (reference air of ISO 6358) is missing from the Appendix.",
    "<b>Exhaust valve.</b> It flows from p<sub>A</sub> to P<sub>0</sub>; the printed p<sub>h,ve</sub> = "
    "P<sub>B</sub> would never empty chamber A.",
    "<b>Eqs. (12), (13), orifice of chamber B.</b> Printed without the upstream pressure, and with the same ratio "
    "both ways, so that the net flow would always be zero; corrected.",
    "<b>Flow near equal pressures.</b> Linear to zero above r = 0.999, where the printed curve has a vertical tangent.",
    "<b>B<sub>0</sub> = 0.582</b> as printed; 0.528 is the physical value, the effect is at most 0.083 mm.",
    "<b>φ<sub>2</sub>, Eqs. (16), (20), (21).</b> Slope 1 at t<sub>3</sub> by the stated conditions; the printed "
    "ξ<sub>2</sub> needs 0.001. Estimates on this page belong to slope 1, the printed Table 1 is drawn with slope "
    "0.001.",
    "<b>Eqs. (19), (20).</b> A<sub>3</sub> has shifted columns and B<sub>3</sub> is printed as zeros; both follow "
    "from the eight stated conditions.",
    "<b>Meaning of N.</b> “Number of partitions” beside Table 1, “after each N<sup>th</sup> simulation step” in "
    "Section 3.1: these contradict each other, so both are given.",
    "<b>Reset.</b> The paper takes the measured position and keeps the pressures; that creates or destroys air, so "
    "carrying q = pV is included too.",
    "<b>Start.</b> Eq. (24) where a recording starts vented and at rest; else position and pressure at its start are "
    "estimated.",
    "<b>Bounds.</b> θ<sub>1</sub> ≥ 0 and θ<sub>3</sub> ≥ 0, which the exact zeros of Table 1 suggest; θ<sub>2</sub> "
    "is free.",
    "<b>Table 2.</b> The “average errors” are sums of squares in m² and Pa²: as averages they would mean 10 to 23 "
    "bar rms.",
    "<b>Eqs. (25), (26).</b> They neglect friction and chamber B; the full balance of Eq. (1) is given too.",
    "<b>End stops.</b> At 0 and 25 mm; the printed model has none, and its load falls beyond 8.5 mm.",
    "<b>Section 3.2.</b> “The proposed model do represent the system completely” reads as “does not”: the sentence "
    "explains deviations.",
    "<b>Solver.</b> Classical Runge-Kutta with fixed steps and inputs held between samples, exact sensitivities; the "
    "paper used ode45 and lsqnonlin.",
)
