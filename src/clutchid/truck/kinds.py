"""Types of trucks: their parameters are those of all trucks and those of their parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, make_dataclass
from functools import cache
from typing import Any

from clutchid.truck.parts import PARTS, parts_of
from clutchid.truck.vehicle import Vehicle


@cache
def truck_type(letters: str) -> type[Vehicle]:
    """Type of the trucks with the parts of these families, in the order of the slots of `clutchid.truck.parts.Parts`.

    Examples
    --------
    >>> truck_type("A" * 9)().A_A, len(truck_type("BAAAAAAAA").names()) - len(truck_type("A" * 9).names())
    (0.0123, 3)
    """
    parts = parts_of(letters)
    words = ", ".join(part.name for part in parts)
    doc = f"A truck with {words}; all parameters in SI."
    namespace = {"parts": parts, "__doc__": doc, "__module__": __name__, "__reduce__": _taken_apart}
    name = {"A" * len(parts): "Truck", "B" * len(parts): "TruckB"}.get(letters, f"Hybrid{letters}")
    bases = (*(part.rows for part in reversed(parts)), Vehicle)
    return make_dataclass(name, (), bases=bases, namespace=namespace, frozen=True, kw_only=True)


def _taken_apart(truck: Vehicle) -> tuple[Any, ...]:
    """Constructor and arguments of a pickled truck, whose type has no name in a module."""
    return remade, (truck.parts.letters, {item.name: getattr(truck, item.name) for item in fields(truck)})


def remade(letters: str, values: Mapping[str, Any]) -> Vehicle:
    """A truck from its parts and parameters, as it is unpickled."""
    return truck_type(letters)(**values)


#: A truck of family A, by default close to the paper's plant, and one of family B.
Truck, TruckB = (truck_type(PARTS[family].letters) for family in "AB")
