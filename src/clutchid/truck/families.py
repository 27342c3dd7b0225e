"""Truck types of each family: a number seeds a draw from the ranges in the family's ``ranges.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.names import check_names
from clutchid.truck.family import Family
from clutchid.truck.first import FIRST
from clutchid.truck.second import SECOND
from clutchid.truck.vehicle import Vehicle

#: The families by name.
FAMILIES: Mapping[str, Family] = {"A": FIRST, "B": SECOND}


def family_of(truck: Vehicle) -> Family:
    """The family that `truck` belongs to."""
    return next(one for one in FAMILIES.values() if isinstance(truck, one.kind))


def changed(truck: Vehicle, *changes: str) -> Vehicle:
    """`truck` after changes between its calibration and its use, each by its name in `CHANGES`, one after the other.

    Raises
    ------
    ParameterError
        If a change is unknown, the text names the nearest one; or if the truck does not admit it.

    Examples
    --------
    >>> from clutchid.truck import Truck
    >>> f"{changed(Truck(), 'supply', 'seals').F_C:.0f} N"
    '196 N'
    """
    known = family_of(truck).changes
    check_names(changes, known, "change")
    for name in changes:
        truck = known[name](truck)
    return truck


#: The versioned file with the ranges of family A.
RANGES = FIRST.ranges


def truck(number: int, family: str = "A") -> Vehicle:
    """Truck type `number` of a family, new; the same number is always the same truck.

    Parameters
    ----------
    number : int
        At least 0.
    family : 'A' or 'B'
        A has on/off valves, an energy balance of the air, LuGre friction and a diaphragm spring; B is another plant,
        see `clutchid.truck.second`.

    Raises
    ------
    ParameterError
        If `number` is not an integer of at least 0, or there is no such family.

    Examples
    --------
    >>> truck(7) == truck(7), truck(7) == truck(8), truck(7) == truck(7, family="B")
    (True, False, False)
    """
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or number < 0:
        raise ParameterError(f"truck {number}: truck types are numbered 0, 1, 2, ...")
    if family not in FAMILIES:
        raise ParameterError(f"family {family!r}: must be {' or '.join(FAMILIES)}.")
    own = FAMILIES[family]
    table = ranges(own.ranges)
    rng = np.random.default_rng([table["version"], int(number), *table.get("salt", ())])
    drawn: dict[str, Any] = {name: values[rng.integers(len(values))] for name, values in table["choice"].items()}
    drawn |= {name: float(rng.uniform(low, high)) for name, (low, high) in table["uniform"].items()}
    drawn = own.prepared(drawn)
    for name, (base, low, high) in table["share"].items():
        drawn[name] = drawn[base] * float(rng.uniform(low, high))
    return own.kind(**own.finished(drawn))


@cache
def ranges(path: Path = RANGES) -> dict[str, Any]:
    """Content of a file with ranges."""
    return tomllib.loads(path.read_text(encoding="utf-8"))
