"""`OwnModel`: physics of one's own on a model variant: terms, equations, rows of parameters and states."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any, Protocol

from clutchid.codegen.system import Expr
from clutchid.log.states import STATES, State
from clutchid.parameters import Adapting, Drift, Freed, GroupChange, Row, Spread

#: Defaults of a new state relative to its scale: process noise over 0.1 s, standard deviation at a vented start and at
#: any other, and a large rate in 1/s. They are those of the deflection z of the seals.
_LIKE = STATES["z"]
NOISE, START, UNKNOWN_START, FAST = (
    value / _LIKE.scale for value in (_LIKE.noise, _LIKE.start, _LIKE.unknown_start, _LIKE.fast)
)

#: Source of what a row of an own model says.
OWN = "own model"


@dataclass(frozen=True, slots=True)
class OwnParameter:
    """A parameter of an `OwnModel`, in SI.

    Parameters
    ----------
    default, unit, meaning
        Value without another one, SI unit such as ``N·s/m`` (or ``N*s/m``), and a noun phrase.
    range
        Smallest and largest admissible value; -inf and inf are open. Required.
    std
        Standard deviation of its prior, in its unit, above 0. The prior is log-normal where the range has no negative
        value and the default is above 0, else normal.
    drift
        Standard deviation of its change between two recordings of one actuator, in its unit, at least 0.
    changes
        What a hypothesis about the groups of `clutchid.parameters.GROUPS` changes in it beyond, in its unit.
    freed
        Whether ``--free auto`` frees it; by default if it has `std`.
    considered
        Whether its drift is only part of the uncertainty, and not estimated from position alone.
    adapts
        Standard deviation of its change within hours, in its unit, above 0; with it, the parameter adapts in the
        observer's method 'joint'. By default it stays as calibrated.
    """

    default: float
    unit: str
    meaning: str
    range: tuple[float, float] | None = None
    std: float | None = None
    drift: float = 0.0
    changes: tuple[GroupChange, ...] = ()
    freed: bool | None = None
    considered: bool = False
    adapts: float | None = None

    @property
    def row(self) -> Row:
        """The row that parameters of the package have."""
        low, high = self.range or (float("nan"), float("nan"))
        freed = self.std is not None if self.freed is None else self.freed
        return Row(
            self.unit,
            self.meaning,
            low,
            high,
            True,
            OWN,
            spread=None if self.std is None else Spread(self.std, False, OWN),
            log_normal=low >= 0.0 and self.default > 0.0,
            drift=Drift(self.drift, considered=self.considered) if self.drift else None,
            changes=self.changes,
            freed=Freed() if freed else None,
            adapts=None if self.adapts is None else Adapting(std=self.adapts),
        )


@dataclass(frozen=True, slots=True)
class OwnState:
    """A state of an `OwnModel`, in SI.

    Parameters
    ----------
    unit, meaning
        SI unit and a noun phrase.
    scale
        Size that it reaches, above 0; it makes searches dimensionless.
    start
        Name of the parameter that is its initial value; 0 without one.
    noise
        Standard deviation of the process noise over 0.1 s, above 0; 5 % of the scale without one.
    """

    unit: str
    meaning: str
    scale: float
    start: str | None = None
    noise: float | None = None

    def row(self, name: str) -> State:
        """The row that states of the package have."""
        return State(
            unit=self.unit,
            meaning=self.meaning,
            column=f"{name} [{self.unit}]",
            scale=self.scale,
            noise=NOISE * self.scale if self.noise is None else self.noise,
            start=START * self.scale,
            unknown_start=UNKNOWN_START * self.scale,
            starts_at=self.start,
            fast=FAST * self.scale,
        )


class Physics(Protocol):
    """The fields of an `OwnModel`, whether they fit or not."""

    @property
    def name(self) -> str:
        """An identifier."""

    @property
    def base(self) -> str:
        """Model variant to start from."""

    @property
    def parameters(self) -> Mapping[str, OwnParameter]:
        """New parameters by name."""

    @property
    def states(self) -> Mapping[str, OwnState]:
        """New states by name."""

    @property
    def terms(self) -> Mapping[str, Expr]:
        """Expressions by name."""

    @property
    def rates(self) -> Mapping[str, Expr]:
        """Rates of change by state."""

    @property
    def without(self) -> tuple[str, ...]:
        """States of the variant to leave out."""


#: Entries of a parameter that count in the hash of a model where they are given, so that older hashes stay.
_LATER = ("changes", "freed", "considered", "adapts")


@dataclass(frozen=True, eq=False)
class OwnModel:
    r"""A model variant with physics of one's own.

    .. math:: \dot x = f(x, u; p) \text{ of the variant, with some terms and rates replaced, and more states}

    Symbols of the expressions are known by their names: states, duty cycles, parameters and terms of the variant
    (docs/equations.md), and those of this record.

    Parameters
    ----------
    base
        Model variant to start from, for example 'isothermal'.
    parameters, states
        New ones by name.
    terms
        Expressions by name. The name of a term of the variant replaces that term; within its own expression the name
        stands for what it was before. Any other name is a new term.
    rates
        Rate of change of each new state, and of others that are to change in another way.
    without
        States of the variant to leave out; y, v, p_A and p_B remain.
    name, file
        An identifier, and the name of the file that has the model; `own_model` sets both.

    Raises
    ------
    ParameterError
        If names, units or equations do not fit; the text lists all problems.

    Examples
    --------
    A return spring that pulls with 100 N at the engaged position:

    >>> from sympy import symbols
    >>> y, f_s, c, F_0 = symbols("y f_s c F_0")
    >>> spring = OwnModel(
    ...     "isothermal",
    ...     parameters={
    ...         "c": OwnParameter(2e3, "N/m", "stiffness of the return spring", range=(0, 1e5), std=1e3),
    ...         "F_0": OwnParameter(100, "N", "force of the return spring at y = 0", range=(0, 1e3)),
    ...     },
    ...     terms={"f_s": f_s + F_0 + c * y},
    ...     name="spring",
    ... )
    >>> spring
    OwnModel('spring', on isothermal)
    """

    base: str
    parameters: Mapping[str, OwnParameter] = field(default_factory=dict)
    states: Mapping[str, OwnState] = field(default_factory=dict)
    terms: Mapping[str, Expr] = field(default_factory=dict)
    rates: Mapping[str, Expr] = field(default_factory=dict)
    without: tuple[str, ...] = ()
    name: str = "own"
    file: str = ""

    def __post_init__(self) -> None:
        from clutchid.model.own.checks import check

        check(self)
        for key in ("parameters", "states", "terms", "rates"):
            object.__setattr__(self, key, dict(getattr(self, key)))
        object.__setattr__(self, "without", tuple(self.without))

    def __repr__(self) -> str:
        return f"OwnModel('{self.name}', on {self.base})"

    def __str__(self) -> str:
        return f"{self.file}:{self.name}" if self.file else self.name

    def __eq__(self, other: object) -> bool:
        return isinstance(other, OwnModel) and (self.name, self.sha256) == (other.name, other.sha256)

    def __hash__(self) -> int:
        return hash(self.sha256)

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of equations and numbers; words for people, names of file and model and the layout do not matter."""
        from sympy import srepr

        from clutchid.model.own.system import canonical

        meaning: dict[str, Any] = {
            "base": self.base,
            "without": sorted(self.without),
            "parameters": [[name, _meaning(row)] for name, row in self.parameters.items()],
            "states": [[name, _meaning(row)] for name, row in self.states.items()],
            "terms": sorted([name, srepr(canonical(value))] for name, value in self.terms.items()),
            "rates": sorted([name, srepr(canonical(value))] for name, value in self.rates.items()),
        }
        return hashlib.sha256(json.dumps(meaning).encode()).hexdigest()


def _meaning(row: OwnParameter | OwnState) -> dict[str, Any]:
    """The entries of a row, numbers as floats, without the words for people."""
    entries = {key: value for key, value in asdict(row).items() if key != "meaning"}
    later = {one.name: one.default for one in fields(row) if one.name in _LATER}
    entries = {key: value for key, value in entries.items() if key not in later or value != later[key]}
    if isinstance(row, OwnParameter):
        entries["range"] = list(map(float, row.range or ()))
    return {key: float(value) if isinstance(value, (int, float)) else value for key, value in entries.items()}
