"""Section ``[actuator]`` of a parameter file: chambers, valves, and a constant load by gravity."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from clutchid.errors import ParameterError
from clutchid.model.equipment import Equipment
from clutchid.names import unknown_name
from clutchid.parameters import Parameters, is_number

_EQUIPMENT = ("name", "description", "chamber_b", "valves")
_GRAVITY = "gravity_load"


def equipment_in(document: Mapping[str, Any]) -> tuple[Equipment, list[str]]:
    """Chambers and valves in a parameter file, and problems with them.

    Parameters
    ----------
    document
        The file; ``[actuator]`` and ``[parameters]``, if present, are sections.

    Returns
    -------
    equipment, problems
    """
    if "actuator" not in document:
        return Equipment(), []
    section, values = document["actuator"], document.get("parameters", {})
    known = (*_EQUIPMENT, _GRAVITY)
    problems = [unknown_name(name, known, "entry of [actuator]") for name in section if name not in known]
    try:
        equipment = Equipment(**{name: section[name] for name in _EQUIPMENT if name in section})
    except ParameterError as error:
        return Equipment(), [*problems, *str(error).splitlines()]
    drawn = [name for name, row in Parameters.rows().items() if row.drawing and not equipment.missing(name)]
    if lacking := [name for name in drawn if name not in values]:
        problems.append(
            f"[parameters] {', '.join(lacking)}: missing; a file with [actuator] needs the values of its drawing, "
            "because the defaults are those of another actuator."
        )
    problems += [sentence for name in values if (sentence := equipment.missing(name))]
    return equipment, problems


def with_gravity(document: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any], list[str]]:
    """``[model]`` and ``[parameters]`` with a constant load for `gravity_load`, and problems with it.

    Examples
    --------
    A mass of 1.5 kg on a vertical rod of 0.1 m stroke:

    >>> model, values, _ = with_gravity({"actuator": {"gravity_load": 14.7}, "parameters": {"y_max": 0.1}})
    >>> model["knots"], [name for name in values if values[name] == 14.7]
    ([0.0, 0.1], ['theta_1', 'theta_2', 'theta_3', 'theta_4'])
    """
    model, values = dict(document.get("model", {})), dict(document.get("parameters", {}))
    load = document.get("actuator", {}).get(_GRAVITY)
    if load is None:
        return model, values, []
    where = f"[actuator] {_GRAVITY} = {load!r}"
    if not is_number(load) or not math.isfinite(load):
        return (
            model,
            values,
            [f"{where}: a finite force in N against positive motion is needed, M g for a lifted mass."],
        )
    weights = [name for name in values if name.startswith("theta_")]
    if weights or model.get("load_basis", "b-spline") != "b-spline":
        other = weights[0] if weights else f"load_basis = '{model['load_basis']}'"
        return model, values, [f"{where}: it defines the whole load, and so does {other}; leave one of them out."]
    knots = model.setdefault("knots", [0.0, values.get("y_max", 0.0)])
    count = len(knots) + 2 if isinstance(knots, list) else 0
    constant = {f"theta_{i + 1}": float(load) for i in range(count)}
    return {**model, "load_basis": "b-spline"}, {**values, **constant}, []


def section_of(equipment: Equipment) -> dict[str, dict[str, Any]]:
    """Entries of `equipment` in a parameter file; none for that of the paper."""
    if equipment == Equipment():
        return {}
    return {"actuator": {name: value for name, value in asdict(equipment).items() if value != ""}}
