"""Flow through valves and orifices: conductances after ISO 6358, or areas of a nozzle; and leaks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from clutchid.truck.parts.part import LIFE_STROKES, Flow, Numbers
from clutchid.truck.rows import PAPER, number

#: Area in m² of a nozzle that passes choked what an orifice of 1 m³/(Pa·s) passes: the reference density times the
#: root of the reference temperature, over the flow of a nozzle with a discharge coefficient of 0.836, that of 9 bar
#: against 1.
AREA = 1.185 * 293.15**0.5 / (0.836 * (1.4 / 287.05) ** 0.5 * (2 / 2.4) ** 3)


@dataclass(frozen=True, kw_only=True)
class IsoRows:
    """Orifices after ISO 6358."""

    C_s: float = number(19e-9, "m³/(Pa·s)", "sonic conductance of the supply valve", 0, 1e-6, PAPER)
    b_s: float = number(0.25, "1", "its critical pressure ratio", 0, 0.9, "ISO 6358")
    m_s: float = number(0.55, "1", "its subsonic index", 0.3, 3, "ISO 6358")
    C_e: float = number(17.5e-9, "m³/(Pa·s)", "sonic conductance of exhaust valve and silencer", 0, 1e-6, PAPER)
    b_e: float = number(0.1, "1", "their critical pressure ratio", 0, 0.9, "ISO 6358")
    m_e: float = number(0.8, "1", "their subsonic index", 0.3, 3, "ISO 6358")
    C_r: float = number(5e-8, "m³/(Pa·s)", "sonic conductance of the orifice of chamber B", 0, 1e-5, PAPER)
    b_r: float = number(0.35, "1", "its critical pressure ratio", 0, 0.9, "ISO 6358")
    m_r: float = number(0.5, "1", "its subsonic index", 0.3, 3, "ISO 6358")


@dataclass(frozen=True, kw_only=True)
class NozzleRows:
    """Orifices as nozzles."""

    A_s: float = number(11.5e-6, "m²", "area of the supply port", 0, 1e-3, "as Appendix A's conductance")
    A_e: float = number(10.6e-6, "m²", "area of the exhaust port", 0, 1e-3, "as Appendix A's conductance")
    A_r: float = number(30e-6, "m²", "area of the orifice of chamber B", 0, 1e-2, "as Appendix A's conductance")


def _leaks(t: Any, factor: float) -> Numbers:
    """Leaks of a truck, which grow with the number of strokes."""
    return {"C_AB": t.C_AB * factor, "C_A0": t.C_A0 * factor}


ISO = Flow(
    name="ISO 6358", rows=IsoRows, shared=("C_AB", "C_A0", "a_C"),
    numbers=lambda t: {"nozzle": 0.0, **_leaks(t, 1 + t.a_C * (t.cycles / LIFE_STROKES))},
    factors={"valves": {"C_s": 0.93, "C_e": 0.93}}, module="iso",
)  # fmt: skip
NOZZLE = Flow(
    name="nozzle", rows=NozzleRows, shared=("C_AB", "C_A0", "a_C"),
    numbers=lambda t: {"nozzle": 1.0, **_leaks(t, 1 + t.a_C * (t.cycles / LIFE_STROKES) ** 2)},
    factors={"valves": {"A_s": 0.93, "A_e": 0.93}}, module="nozzle",
    converted=lambda drawn: {f"A_{hole}": AREA * drawn[f"C_{hole}"] for hole in ("s", "e", "r")},
)  # fmt: skip
