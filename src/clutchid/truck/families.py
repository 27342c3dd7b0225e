"""Truck types: a number seeds a draw from the ranges of a family, or of both for a hybrid."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.truck.kinds import truck_type
from clutchid.truck.parts import PARTS, STATEFUL, Parts, parts_of
from clutchid.truck.vehicle import ZEROS, Vehicle

#: The files with the ranges of the families; that of family A is versioned alone.
RANGE_FILES = {family: Path(__file__).parent / name for family, name in (("A", "ranges.toml"), ("B", "ranges_b.toml"))}
RANGES = RANGE_FILES["A"]

#: Start of the name of a hybrid's family, before its seed.
_HYBRID = "h:"

#: Makes the draws of hybrids independent of those of the families.
_SALT = 104

#: So many hybrids with consecutive seeds have each part of a slot equally often.
_BLOCK = 16


def truck(number: int, family: str = "A") -> Vehicle:
    """Truck type `number` of a family, new; the same number is always the same truck.

    Parameters
    ----------
    number : int
        At least 0.
    family : 'A', 'B' or 'h:SEED'
        A has on/off valves, an energy balance of the air, LuGre friction and a diaphragm spring; B is another plant in
        every part; a hybrid has parts of both, which its seed draws, and `number` draws its parameters.

    Raises
    ------
    ParameterError
        If `number` is not an integer of at least 0, or there is no such family.

    Examples
    --------
    >>> truck(7) == truck(7), truck(7) == truck(8), truck(7) == truck(7, family="B")
    (True, False, False)
    >>> truck(0, "h:3").parts.letters, truck(1, "h:3").parts.letters
    ('BAAABBAAA', 'BAAABBAAA')
    """
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or number < 0:
        raise ParameterError(f"truck {number}: truck types are numbered 0, 1, 2, ...")
    if family in RANGE_FILES:
        table = family_ranges(RANGE_FILES[family])
        rng = np.random.default_rng([table["version"], int(number), *table.get("salt", ())])
        return _built(PARTS[family], _basic(table, rng), table["share"], rng)
    parts = parts_of(hybrid_letters(family))
    tables = {name: family_ranges(path) for name, path in RANGE_FILES.items()}
    rng = np.random.default_rng([*(table["version"] for table in tables.values()), _SALT, _seed(family), int(number)])
    drawn = _chosen(parts, {name: _basic(table, rng) for name, table in tables.items()})
    drawn["zero"] = _one_of(ZEROS, family, len(parts))
    return _built(parts, drawn, tables["A"]["share"] | tables["B"]["share"], rng)


def vehicle_of_type(number: int, family: str, other: int, share: float) -> Vehicle:
    """A vehicle that differs from its type: its numbers lie a `share` of the way to those of another type.

    Its variants and its controller are those of its type.
    """
    new, tables = truck(number, family), map(family_ranges, RANGE_FILES.values())
    drawn = {name for table in tables for part in ("uniform", "share") for name in table[part]}
    towards = truck(other, family)
    own = {name: getattr(new, name) for name in new.names() if name in drawn}
    return new.replace({name: value + share * (getattr(towards, name) - value) for name, value in own.items()})


def family_label(family: str) -> str:
    """A family in the names of files: that of a hybrid without its colon, and apart from a number that follows."""
    return f"{family.replace(':', '')}_" if family.startswith(_HYBRID) else family


def hybrid_letters(family: str) -> str:
    """Families of the parts of the hybrid ``h:SEED``; each `_BLOCK` of seeds has each part of a slot equally often.

    But where all parts with states are of one family, the flow is as well.

    Raises
    ------
    ParameterError
        If there is no such family.
    """
    drawn = [_one_of("AB", family, slot) for slot in range(len(PARTS["A"]))]
    if len(set(drawn[STATEFUL])) == 1:
        drawn[Parts._fields.index("flow")] = drawn[STATEFUL][0]
    return "".join(drawn)


def _one_of(two: Sequence[str], family: str, column: int) -> str:
    """One of two for a hybrid; each as often as the other in a block of seeds."""
    block, place = divmod(_seed(family), _BLOCK)
    return str(np.random.default_rng([_SALT, block, column]).permutation(np.repeat(list(two), _BLOCK // 2))[place])


def _seed(family: str) -> int:
    digits = family.removeprefix(_HYBRID)
    if not (family.startswith(_HYBRID) and digits.isascii() and digits.isdigit()):
        raise ParameterError(f"family {family!r}: must be A or B, or a hybrid h:SEED, such as h:7.")
    return int(digits)


def _basic(table: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Choices and uniform numbers of a file with ranges."""
    drawn: dict[str, Any] = {name: values[rng.integers(len(values))] for name, values in table["choice"].items()}
    return drawn | {name: float(rng.uniform(low, high)) for name, (low, high) in table["uniform"].items()}


def _chosen(parts: Parts, drawn: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Of numbers drawn for both families, for each part those of its own; what belongs to no part as for family B.

    Orifices are drawn as conductances and converted. A spool is not driven bang-bang.
    """
    chosen = dict(drawn["B"])
    for part, letter in zip(parts, parts.letters, strict=True):
        names = (*part.shared, *(item.name for item in fields(part.rows)))
        chosen |= {name: drawn[letter][name] for name in names if name in drawn[letter]}
    chosen |= parts.flow.converted(drawn["A"])
    return chosen | ({"drive": "pwm"} if parts.valves is PARTS["B"].valves and chosen["valve"] == "spool" else {})


def _built(parts: Parts, drawn: dict[str, Any], shares: Mapping[str, Any], rng: np.random.Generator) -> Vehicle:
    """A truck from drawn numbers, with those that are shares of others, and those of the controller."""
    for part in parts:
        drawn = part.prepared(drawn)
    for name, (base, low, high) in shares.items():
        drawn[name] = drawn[base] * float(rng.uniform(low, high))
    drawn |= parts.driving.tuned(drawn, *parts.valves.lead(drawn), parts.tube.delay)
    kind = truck_type(parts.letters)
    names = {item.name for item in fields(kind)}
    return kind(**{name: value for name, value in drawn.items() if name in names})


@cache
def family_ranges(path: Path = RANGES) -> dict[str, Any]:
    """Content of a file with ranges."""
    return tomllib.loads(path.read_text(encoding="utf-8"))
