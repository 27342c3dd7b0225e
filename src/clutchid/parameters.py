"""`Parameters`: the Appendix of the paper as code, one row per parameter.

Each row holds value, unit, meaning, admissible range and source, what is known of the parameter before a recording is
read, and what calibrations and observers do with it; documentation tables, parameter files, exports, priors and
methods read the same rows. The load weights theta are part of a `clutchid.model.Load`, because a weight is meaningless
without its basis.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from operator import attrgetter
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.arguments import is_number
from clutchid.errors import ParameterError
from clutchid.messages import shortened
from clutchid.names import check_names

_APPENDIX = "Appendix A"
_ERRATA = "not in the paper, docs/deviations.md"
_BALANCE = "energy balance, docs/models.md"
_SENSORS = "sensors, docs/methods.md"
_STRIBECK = "Stribeck friction, docs/models.md"
_PRIORS = "docs/derivations.md, Priors"

#: Groups whose parameters may change together, and by much, between two recordings of an actuator, with the logarithm
#: of the prior odds of a change. Provenance: docs/derivations.md.
GROUPS: Mapping[str, float] = MappingProxyType(
    {"supply pressure": -1.0, "temperature and grease": -2.0, "valves": -2.0, "leak": -3.0}
)


class Spread(NamedTuple):
    """Standard deviation of the prior of a parameter in a new actuator, and where it is from.

    `share`: it is one of the value, and so are the drift and the changes of the parameter; else it is in its unit.
    """

    std: float
    share: bool
    source: str


class GroupChange(NamedTuple):
    """A change of a parameter with its group: its standard deviation, as a share of the value or in its unit.

    Changes `along` the same direction, any word, are of parameters that change together, with the sign of `std`; one
    without a direction is independent of all others.
    """

    group: str
    std: float
    along: str = ""


class Drift(NamedTuple):
    """Standard deviation of the drift between two recordings, as a share of the value or in its unit.

    `considered`: the drift is part of the uncertainty, but is not estimated from position alone.
    """

    std: float
    order: float = math.inf
    considered: bool = False


class Freed(NamedTuple):
    """Mark of a parameter that a calibration frees, if it acts."""

    order: float = math.inf


class Adapting(NamedTuple):
    """Mark of a parameter that adapts on line, if it acts; `std` of its change within hours, else that of its drift."""

    order: float = math.inf
    std: float | None = None


@dataclass(frozen=True, slots=True)
class Row:
    """Unit, meaning, admissible range and source of one parameter, its prior, its changes, and what is done with it.

    Parameters
    ----------
    magnitude
        Whether actuators differ in it by orders of magnitude, see `_magnitude`.
    spread
        Default prior; None without one.
    log_normal
        Whether the prior is log-normal, if the mean is above 0; else it is normal.
    drift, changes
        How it changes between two recordings of an actuator; None where it stays.
    freed, adapts
        What a calibration and an observer do with it; None where it is fixed.
    valves
        ``'switched'`` or ``'averaged'`` if it acts with valves of that kind only: with or without a carrier.
    off_at_0
        Whether it has no effect, and no derivative, at a value of 0; one with a spread as a share never has.
    part
        ``'chamber B'``, ``'supply valve'`` with the reservoir before it, or ``'exhaust valve'``; there are actuators
        without these.
    drawing
        Whether a file of an actuator must have it, because it is known from the drawing.
    """

    unit: str
    meaning: str
    low: float
    high: float
    low_included: bool
    source: str
    magnitude: bool = False
    spread: Spread | None = None
    log_normal: bool = False
    drift: Drift | None = None
    changes: tuple[GroupChange, ...] = ()
    freed: Freed | None = None
    adapts: Adapting | None = None
    valves: str = ""
    off_at_0: bool = False
    part: str = ""
    drawing: bool = False

    def admits(self, value: float) -> bool:
        """Whether `value` lies in the admissible range."""
        above = value >= self.low if self.low_included else value > self.low
        return math.isfinite(value) and above and value <= self.high

    @property
    def width(self) -> float:
        """The admissible range from end to end."""
        return self.high - self.low

    @property
    def limits(self) -> tuple[float, float]:
        """Range of a search with a prior: a magnitude is limited by its prior, and by 0."""
        return (0, math.inf) if self.magnitude else (self.low, self.high)

    @property
    def allowed(self) -> str:
        """The admissible range in words."""
        lower = f"{'at least' if self.low_included else 'above'} {self.low:g}" if math.isfinite(self.low) else ""
        upper = f"at most {self.high:g}" if math.isfinite(self.high) else ""
        return " and ".join(part for part in (lower, upper) if part) or "a finite number"

    @property
    def in_shares(self) -> bool:
        """Whether standard deviations of the row are shares of the value."""
        return self.spread is not None and self.spread.share

    def size(self, value: float) -> float:
        """Size of a unit of the row's standard deviation at a value: the value for shares, else 1."""
        return abs(value) if self.in_shares else 1.0


def in_order(rows: Mapping[str, Row], entry: Callable[[Row], Drift | Freed | Adapting | None]) -> tuple[str, ...]:
    """Names of the parameters whose row has an entry, in the order of it; at the same one in that of the Appendix.

    Files and rounding depend on the order. A parameter without a place comes last.

    Examples
    --------
    What adapts on line:

    >>> in_order(Parameters.rows(), lambda row: row.adapts)
    ('F_C', 'V_0A', 'y_max', 'D_v', 'tau_y', 'C_A0', 's_pwm')
    """
    entries = {name: at.order for name, row in rows.items() if (at := entry(row)) is not None}
    return tuple(sorted(entries, key=entries.__getitem__))


def known_ambient(P_0: float) -> float | None:
    """The ambient pressure in Pa by P_0; None for that of Appendix A, which was not measured."""
    return None if P_0 == DEFAULTS.P_0 else P_0


def _row(
    value: float, unit: str, meaning: str, low: float, high: float, *, above: bool = False, source: str = _APPENDIX,
    share: float | None = None, width: float | None = None, **facts: Any,
) -> Any:  # fmt: skip
    """A parameter that its definition limits, such as a fraction or a flow shape.

    `above`: `low` itself is excluded. The prior is log-normal with a standard deviation of a `share` of the value, for
    a positive parameter, or normal with a `width` in its unit, where it may be 0 or change its sign.
    """
    spread = None if share is None and width is None else Spread(share or width or 0.0, share is not None, _PRIORS)
    row = Row(unit, meaning, low, high, not above, source, spread=spread, log_normal=share is not None, **facts)
    return field(default=value, metadata={"row": row})


def _magnitude(*args: Any, **facts: Any) -> Any:
    """A parameter that differs between actuators by orders of magnitude.

    Its range reaches from at least ten times below a miniature pneumatic cylinder (bore 2.5 mm, moving parts of a gram)
    to at least ten times above the clutch actuator of a heavy truck, and further where a tiny or huge value switches an
    effect off; 0 belongs to it where the model is valid without the effect. Temperatures and the gas constant cover
    what stays a gas. A range is so wide because only slips shall be refused: a wrong power of ten, a wrong unit. What
    keeps a search near its start are its bounds and priors.
    """
    return _row(*args, magnitude=True, **facts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """Parameters of the actuator in SI; the defaults are the paper's Appendix A.

    Raises
    ------
    ParameterError
        If values are outside their admissible ranges; the text lists all of them.

    Examples
    --------
    The supply pressure holds against 9.7 kN on the piston of chamber A:

    >>> p = Parameters()
    >>> f"{p.A_A * (p.P_S - p.P_0):.0f} N"
    '9723 N'
    """

    # fmt: off
    A_A: float = _magnitude(
        12.3e-3, "m²", "area of the piston in chamber A", 1e-8, 1,
        share=0.001, drift=Drift(3e-4, 11, considered=True), drawing=True,
    )
    A_B: float = _magnitude(
        11.848e-3, "m²", "area of the piston in chamber B", 1e-9, 1, share=0.001, part="chamber B", drawing=True,
    )
    V_0A: float = _magnitude(
        0.148e-3, "m³", "volume of chamber A at y = 0", 1e-9, 1,
        share=0.15, drift=Drift(0.05, 8), freed=Freed(3), adapts=Adapting(2), drawing=True,
    )
    V_0B: float = _magnitude(
        1.2e-4, "m³", "dead volume of chamber B at y = y_max", 1e-9, 1, share=0.15, part="chamber B", drawing=True,
    )
    P_0: float = _magnitude(
        1.095e5, "Pa", "ambient pressure", 1e3, 1e6,
        # weather, 1 kPa within a season, and altitude, 1.2 kPa for each 100 m; 2 kPa read as 0.2 to 0.4 % of the load
        # (truck 2 of family A; benchmarks/vented.py reads in other weather)
        share=0.003, drift=Drift(0.015, 11, considered=True), freed=Freed(4),
    )
    T_0: float = _magnitude(
        293.0, "K", "temperature", 50, 1000,
        share=0.02, drift=Drift(0.002, 2), changes=(GroupChange("temperature and grease", 0.085, "warmer"),),
    )
    R: float = _magnitude(288.0, "J/(kg·K)", "gas constant of air", 50, 5000, share=0.002)
    M: float = _magnitude(
        10.0, "kg", "mass of the piston", 1e-5, 1e5, share=0.15, freed=Freed(12), drawing=True,
    )
    P_S: float = _magnitude(
        9e5, "Pa", "supply pressure, absolute", 1e3, 1e8,
        share=0.05, drift=Drift(0.003, 1), freed=Freed(3), part="supply valve",
        changes=(GroupChange("supply pressure", 0.05),),
    )
    D_v: float = _magnitude(
        5000.0, "N·s/m", "viscous friction", 0, 1e7,
        share=0.4, drift=Drift(0.02, 1), freed=Freed(5), adapts=Adapting(3, 0.1),
        changes=(GroupChange("temperature and grease", -0.5, "warmer"), GroupChange("temperature and grease", 0.3)),
    )
    K_z: float = _magnitude(
        1e6, "N/m", "stiffness of the seal deflection", 10, 1e10, share=0.3, drift=Drift(0.15, 12), freed=Freed(5),
    )
    D_zdot: float = _magnitude(5000.0, "N·s/m", "damping of the seal deflection", 0, 1e7, share=0.3, freed=Freed(5))
    F_C: float = _magnitude(
        200.0, "N", "Coulomb friction", 1e-4, 1e6, share=0.4, drift=Drift(0.15, 7), freed=Freed(4), adapts=Adapting(1),
    )
    R_0vs: float = _row(
        0.07, "1", "duty cycle where the supply valve starts to open", 0, 1,
        width=0.03, drift=Drift(6e-4, 4), freed=Freed(2), part="supply valve", changes=(GroupChange("valves", 0.015),),
    )
    R_0ve: float = _row(
        0.07, "1", "duty cycle where the exhaust valve starts to open", 0, 1,
        width=0.03, drift=Drift(6e-4, 4), freed=Freed(2), part="exhaust valve",
        changes=(GroupChange("valves", 0.015),),
    )
    R_1vs: float = _row(
        0.93, "1", "duty cycle where the supply valve is fully open", 0, 2, above=True,
        width=0.05, drift=Drift(6e-4, 4), freed=Freed(2), part="supply valve", changes=(GroupChange("valves", 0.02),),
    )
    R_1ve: float = _row(
        0.93, "1", "duty cycle where the exhaust valve is fully open", 0, 2, above=True,
        width=0.05, drift=Drift(6e-4, 4), freed=Freed(2), part="exhaust valve", changes=(GroupChange("valves", 0.02),),
    )
    B_vs: float = _row(
        0.1, "1", "flow shape of the supply valve", -1, 1, width=0.8, freed=Freed(6), part="supply valve",
    )
    B_ve: float = _row(
        -0.7, "1", "flow shape of the exhaust valve", -1, 1, width=0.8, freed=Freed(6), part="exhaust valve",
    )
    C_vs: float = _magnitude(
        19e-9, "m³/(Pa·s)", "conductance of the supply valve", 0, 1e-5,
        share=0.15, drift=Drift(0.002, 3), freed=Freed(1), part="supply valve",
        changes=(
            GroupChange("temperature and grease", -0.0425, "warmer"),
            GroupChange("valves", 0.07, "flow"), GroupChange("valves", 0.02),
        ),
    )
    C_ve: float = _magnitude(
        21.4e-9, "m³/(Pa·s)", "conductance of the exhaust valve", 0, 1e-5,
        share=0.15, drift=Drift(0.002, 3), freed=Freed(1), part="exhaust valve",
        changes=(
            GroupChange("temperature and grease", -0.0425, "warmer"),
            GroupChange("valves", 0.07, "flow"), GroupChange("valves", 0.02),
        ),
    )
    C_r: float = _magnitude(
        5e-8, "m³/(Pa·s)", "conductance of the orifice of chamber B", 0, 1e-5,
        share=0.4, drift=Drift(0.002, 3), freed=Freed(5), part="chamber B",
        changes=(GroupChange("temperature and grease", -0.0425, "warmer"),),
    )
    B_0: float = _row(0.582, "1", "critical pressure ratio of air", 0, 0.99, above=True, share=0.1)
    B_in: float = _row(0.5, "1", "flow shape of the orifice of chamber B, inwards", -1, 1, width=0.3, part="chamber B")
    B_out: float = _row(
        0.5, "1", "flow shape of the orifice of chamber B, outwards", -1, 1, width=0.3, part="chamber B",
    )
    rho_0: float = _magnitude(
        1.185, "kg/m³", "reference density of air", 0.05, 50, source=f"ISO 6358; {_ERRATA}", share=0.02,
    )
    y_max: float = _magnitude(
        0.025, "m", "stroke of the piston", 1e-4, 10, source="Section 3.1, operation range [0, 25] mm",
        share=0.02, freed=Freed(5), adapts=Adapting(2), drawing=True,
    )
    r_lam: float = _row(
        0.999, "1", "pressure ratio above which the flow is laminar", 0.5, 0.99999, above=True, source=_ERRATA,
        width=0.001,
    )
    K_stop: float = _magnitude(
        3e7, "N/m", "stiffness of the end stops", 1e2, 1e11, source=_ERRATA, share=0.5,
    )
    D_stop: float = _magnitude(
        1e4, "N·s/m", "damping of the end stops", 0, 1e8, source=_ERRATA, share=0.5,
    )
    d_stop: float = _magnitude(
        1e-4, "m", "penetration over which the end stop force builds up", 1e-8, 1e-2, source=_ERRATA, share=0.5,
    )
    b_vs: float = _row(
        0.3, "1", "critical pressure ratio of the supply valve", 0, 0.9, source=_BALANCE,
        width=0.15, freed=Freed(7), part="supply valve",
    )
    m_vs: float = _row(
        0.5, "1", "subsonic index of the supply valve", 0, 3, above=True, source=_BALANCE,
        share=0.25, freed=Freed(7), part="supply valve",
    )
    b_ve: float = _row(
        0.3, "1", "critical pressure ratio of the exhaust valve", 0, 0.9, source=_BALANCE,
        width=0.15, freed=Freed(7), part="exhaust valve",
    )
    m_ve: float = _row(
        0.5, "1", "subsonic index of the exhaust valve", 0, 3, above=True, source=_BALANCE,
        share=0.25, drift=Drift(0.006, 11, considered=True), freed=Freed(7), part="exhaust valve",
    )
    gamma: float = _row(
        1.4, "1", "ratio of specific heats of air; in a calibration an apparent polytropic exponent", 1, 2,
        above=True, source=_BALANCE, width=0.1, freed=Freed(8),
    )
    T_w: float = _magnitude(
        293.0, "K", "temperature of the chamber walls", 50, 1000, source=_BALANCE,
        share=0.03, drift=Drift(0.002, 2), freed=Freed(7),
        changes=(GroupChange("temperature and grease", 0.085, "warmer"),),
    )
    h_A: float = _magnitude(
        50.0, "W/(m²·K)", "heat transfer to the wall of chamber A at 1 bar", 0, 1e5, source=_BALANCE,
        share=0.5, drift=Drift(0.03, 2), freed=Freed(7),
    )
    h_B: float = _magnitude(
        50.0, "W/(m²·K)", "heat transfer to the wall of chamber B at 1 bar", 0, 1e5, source=_BALANCE,
        share=0.5, part="chamber B",
    )
    C_A0: float = _magnitude(
        0.0, "m³/(Pa·s)", "leak of chamber A to ambient", 0, 1e-7, source=_BALANCE,
        width=1e-12, drift=Drift(5e-13, 10), adapts=Adapting(4, 5e-11), changes=(GroupChange("leak", 1e-10),),
    )
    V_S: float = _magnitude(
        10e-3, "m³", "volume of the supply reservoir", 1e-7, 1e4, source=_BALANCE,
        share=0.6, drift=Drift(0.06, 9), freed=Freed(7), part="supply valve",
    )
    tau_S: float = _magnitude(
        0.6, "s", "time in which the reservoir recovers", 1e-4, 1e5, source=_BALANCE,
        share=0.6, freed=Freed(7), part="supply valve",
    )
    tau_G: float = _magnitude(
        10.0, "s", "time in which the compressor's governor returns to P_S", 1e-4, 1e5, source=_BALANCE,
        share=0.5, part="supply valve",
    )
    F_h: float = _magnitude(25.0, "N", "release bearing: friction without load", 1e-6, 1e6, source=_BALANCE, share=0.5)
    mu_h: float = _row(
        0.03, "1", "half the hysteresis of the load, as a fraction of it", 0, 0.3, source=_BALANCE,
        width=0.02, drift=Drift(3e-4, 9), freed=Freed(6),
    )
    K_h: float = _magnitude(
        5e5, "N/m", "stiffness of bearing and fork before they slip", 1e-3, 1e10, source=_BALANCE,
        share=0.5, freed=Freed(6),
    )
    R_S: float = _row(
        1.3, "1", "ratio of static to Coulomb friction", 1, 5, source=_STRIBECK,
        width=0.3, drift=Drift(0.1, 12), freed=Freed(11),
    )
    v_S: float = _magnitude(
        0.01, "m/s", "Stribeck velocity, at which static friction decays", 1e-6, 10, source=_STRIBECK,
        share=0.7, drift=Drift(0.2, 12), freed=Freed(11),
    )
    c_F: float = _magnitude(
        1.5e-4, "m²", "Coulomb friction that pressure on the seal adds", 0, 1, source=_STRIBECK,
        share=0.7, drift=Drift(0.06, 7), freed=Freed(10),
    )
    T_pwm: float = _magnitude(0.0, "s", "period of the valves' carrier; 0: averaged valves", 0, 1, source=_BALANCE)
    s_pwm: float = _row(
        0.0, "1", "phase at which a period starts in a recording", -0.5, 0.5, source=_BALANCE,
        width=0.03, adapts=Adapting(4), valves="switched",
    )
    s_vs: float = _row(
        0.0, "1", "supply valve: phase of its opening in the period", -0.5, 0.5, source=_BALANCE,
        width=0.1, drift=Drift(0.001, 6), freed=Freed(8), valves="switched", part="supply valve",
        changes=(GroupChange("valves", 0.02),),
    )
    s_ve: float = _row(
        0.0, "1", "exhaust valve: phase of its opening in the period", -0.5, 0.5, source=_BALANCE,
        width=0.1, drift=Drift(0.001, 6), freed=Freed(8), valves="switched", part="exhaust valve",
        changes=(GroupChange("valves", 0.02),),
    )
    t_vs: float = _row(
        0.0, "1", "supply valve: travel of its armature, as a fraction of a period", 0, 1, source=_BALANCE,
        width=0.05, drift=Drift(0.001, 5), freed=Freed(9), valves="switched", off_at_0=True, part="supply valve",
        changes=(GroupChange("valves", 0.02),),
    )
    t_ve: float = _row(
        0.0, "1", "exhaust valve: travel of its armature, as a fraction of a period", 0, 1, source=_BALANCE,
        width=0.05, drift=Drift(0.001, 5), freed=Freed(9), valves="switched", off_at_0=True, part="exhaust valve",
        changes=(GroupChange("valves", 0.02),),
    )
    a_0vs: float = _row(
        0.0, "1", "supply valve: relative opening of its full pulses at R_0vs", 0, 0.9, source=_BALANCE,
        width=0.1, drift=Drift(0.001, 4), freed=Freed(8), valves="switched", part="supply valve",
        changes=(GroupChange("valves", 0.02),),
    )
    a_0ve: float = _row(
        0.0, "1", "exhaust valve: relative opening of its full pulses at R_0ve", 0, 0.9, source=_BALANCE,
        width=0.1, drift=Drift(0.001, 4), freed=Freed(8), valves="switched", part="exhaust valve",
        changes=(GroupChange("valves", 0.02),),
    )
    n_vs: float = _row(
        1.0, "1", "supply valve without a carrier: exponent of its opening", 0.2, 5, source=_BALANCE,
        share=0.2, drift=Drift(0.001, 6), freed=Freed(9), valves="averaged", part="supply valve",
    )
    n_ve: float = _row(
        1.0, "1", "exhaust valve without a carrier: exponent of its opening", 0.2, 5, source=_BALANCE,
        share=0.2, drift=Drift(0.001, 6), freed=Freed(9), valves="averaged", part="exhaust valve",
    )
    tau_vs: float = _row(
        2e-3, "s", "proportional supply valve: lag of its spool", 5e-4, 0.05, source=_BALANCE,
        share=0.5, drift=Drift(0.01, 6), freed=Freed(9), part="supply valve", changes=(GroupChange("valves", 0.2),),
    )
    tau_ve: float = _row(
        2e-3, "s", "proportional exhaust valve: lag of its spool", 5e-4, 0.05, source=_BALANCE,
        share=0.5, drift=Drift(0.01, 6), freed=Freed(9), part="exhaust valve", changes=(GroupChange("valves", 0.2),),
    )
    tau_y: float = _row(
        0.0, "s", "lag of the recorded position", 0, 0.05, source=_SENSORS,
        width=0.002, drift=Drift(3e-05, 8), freed=Freed(5), adapts=Adapting(3, 3e-4),
        changes=(GroupChange("valves", 3e-4),),
    )
    tau_p: float = _row(0.0, "s", "lag of the recorded pressure", 0, 0.05, source=_SENSORS, width=0.002, freed=Freed(5))
    e_y: float = _row(0.0, "m", "offset of the recorded position", -2e-3, 2e-3, source=_SENSORS, width=2e-05)
    e_p: float = _row(0.0, "Pa", "offset of the recorded pressure", -5e4, 5e4, source=_SENSORS, width=2000.0)
    # fmt: on

    def __post_init__(self) -> None:
        problems = []
        for name, row in self.rows().items():
            value = getattr(self, name)
            if type(value) is float and row.low < value < row.high:  # nearly all, of thousands that a search makes
                continue
            if not is_number(value):
                problems.append(f"{name} = {shortened(repr(value))}: a number in {row.unit} is needed.")
            elif not row.admits(float(value)):
                problems.append(f"{_shown(name, float(value), row)}: {_advice(name, row)}")
            else:
                object.__setattr__(self, name, float(value))
        if not problems:
            for valve, low, high in (("vs", self.R_0vs, self.R_1vs), ("ve", self.R_0ve, self.R_1ve)):
                if low >= high:
                    problems.append(
                        f"R_0{valve} = {low:g} must be below R_1{valve} = {high:g}: a valve opens with rising duty "
                        "cycle."
                    )
            if self.A_B > self.A_A:
                problems.append(
                    f"A_B = {self.A_B:g} m² must not exceed A_A = {self.A_A:g} m²: the rod reduces the area of chamber "
                    "B."
                )
        ParameterError.raise_for(problems)

    def __repr__(self) -> str:
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        changed = [f"{item.name}={values[item.name]!r}" for item in fields(self) if values[item.name] != item.default]
        return f"Parameters({', '.join(changed)})"

    @classmethod
    @cache
    def names(cls) -> tuple[str, ...]:
        """Names in the order of the paper's Appendix, which is also that of `array`."""
        return tuple(item.name for item in fields(cls))

    @classmethod
    @cache
    def rows(cls) -> Mapping[str, Row]:
        """All rows by name, in the order of `names`."""
        return MappingProxyType({item.name: item.metadata["row"] for item in fields(cls)})

    @classmethod
    def row(cls, name: str) -> Row:
        """The row of the parameter `name`.

        Raises
        ------
        ParameterError
            If there is no such parameter; the text names the nearest known one.
        """
        check_names([name], cls.rows())
        return cls.rows()[name]

    def array(self) -> NDArray[np.float64]:
        """Values in the order of `names`, shape (n_parameters,)."""
        return np.array(_values(self), dtype=np.float64)

    def replace(self, changes: Mapping[str, float] | None = None, /, **by_name: float) -> Parameters:
        """A copy with changed values, validated again: ``replace({"P_S": 7e5})`` or ``replace(P_S=7e5)``.

        Raises
        ------
        ParameterError
            For an unknown name or a value outside its range.
        """
        changes = {**(changes or {}), **by_name}
        check_names(changes, self.names())
        return replace(self, **changes) if changes else self


def _shown(name: str, value: float, row: Row) -> str:
    return f"{name} = {value:g}" + ("" if row.unit == "1" else f" {row.unit}")


def _advice(name: str, row: Row) -> str:
    noun = "a conductance" if name.startswith("C_") else "it"
    origin = _APPENDIX if row.source == _APPENDIX else "The default"
    return (
        f"{noun} must be {row.allowed}. {origin} {'has' if origin == _APPENDIX else 'is'} {getattr(DEFAULTS, name):g}."
    )


_values = attrgetter(*Parameters.names())

#: Appendix A, and where it has none the defaults.
DEFAULTS = Parameters()
