"""`OwnModel`: physics of one's own on top of a model variant, with its parameters, states and equations."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any

from clutchid.codegen.system import Expr
from clutchid.model.own.rows import OwnParameter, OwnState

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
        from clutchid.model.own.checks import check_own_model

        check_own_model(self)
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
    later = {item.name: item.default for item in fields(row) if item.name in _LATER}
    entries = {key: value for key, value in entries.items() if key not in later or value != later[key]}
    if isinstance(row, OwnParameter):
        entries["range"] = list(map(float, row.range or ()))
    return {key: float(value) if isinstance(value, (int, float)) else value for key, value in entries.items()}
