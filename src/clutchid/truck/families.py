"""The families of trucks, by name and by truck."""

from __future__ import annotations

from collections.abc import Mapping

from clutchid.errors import ParameterError
from clutchid.names import unknown_name
from clutchid.truck.family import Family
from clutchid.truck.first import FIRST
from clutchid.truck.second import SECOND
from clutchid.truck.vehicle import Vehicle

#: The families by name.
FAMILIES: Mapping[str, Family] = {"A": FIRST, "B": SECOND}


def family(name: str) -> Family:
    """The family `name`.

    Raises
    ------
    ParameterError
        If there is none of that name.
    """
    if name not in FAMILIES:
        raise ParameterError(f"family {name!r}: must be {' or '.join(FAMILIES)}.")
    return FAMILIES[name]


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
    unknown = [unknown_name(name, tuple(known), "change") for name in changes if name not in known]
    if unknown:
        raise ParameterError("\n".join(unknown))
    for name in changes:
        truck = known[name](truck)
    return truck
