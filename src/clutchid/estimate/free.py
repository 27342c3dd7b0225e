"""Which numbers of a fit are free, and within which bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from clutchid.errors import ParameterError
from clutchid.model.actuator import Actuator
from clutchid.parameters import Parameters, unknown_name

#: A parameter without own bounds stays within this factor of its start value.
DEFAULT_RANGE = 3.0

#: NAME@EACH stands for an own number of every recording.
EACH = "EACH"


def free_names(free: Sequence[str], actuator: Actuator, stems: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the free parameters, with 'load' replaced by all load weights, NAME@EACH by NAME@STEM for all `stems`.

    Raises
    ------
    ParameterError
        For an unknown name, with the nearest known one, and for a part of a chamber or valve that does not exist.
    """
    expanded = [name for item in free for name in (actuator.load.names if item == "load" else (item,))]
    problems = []
    for name in expanded:
        base, _, stem = name.partition("@")
        if base not in actuator.names:
            problems.append(unknown_name(base, ("load", *actuator.names)))
        elif sentence := actuator.equipment.missing(base):
            problems.append(sentence)
        elif "@" in name and base in actuator.load.names:
            problems.append(f"{name}: the load belongs to all recordings; fit them one by one for a load of each.")
        elif "@" in name and stem not in (EACH, *stems):
            problems.append(unknown_name(stem, (EACH, *stems), "recording"))
    if problems:
        raise ParameterError("\n".join(problems))
    each = [[f"{n.removesuffix(EACH)}{stem}" for stem in stems] if n.endswith("@" + EACH) else [n] for n in expanded]
    return tuple(dict.fromkeys(name for group in each for name in group))


def bounds_of(
    names: Sequence[str], actuator: Actuator, given: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Bounds of all free `names` in SI: those `given`, else by default.

    Raises
    ------
    ParameterError
        If bounds cross, are not admissible, or belong to what is not free.
    """
    foreign = [
        f"bounds for {name}, which is not free; free are {', '.join(names) or 'none'}."
        for name in given
        if name not in names
    ]
    crossed = [
        f"{name}: lower bound {low:g} is not below upper bound {high:g}."
        for name, (low, high) in given.items()
        if not low < high
    ]
    outside = [
        f"{name}: bound {bound:g} is not admissible, it is {row.allowed} {row.unit}."
        for name, limits in given.items()
        if name.partition("@")[0] in Parameters.names()
        for row in [Parameters.row(name.partition("@")[0])]
        for bound in limits
        if np.isfinite(bound) and not row.admits(bound)
    ]
    if foreign or crossed or outside:
        raise ParameterError("\n".join(foreign + crossed + outside))
    return {name: given.get(name, _default_bounds(name, actuator)) for name in names}


def _default_bounds(name: str, actuator: Actuator) -> tuple[float, float]:
    if name in actuator.load.names:
        signed = name == "theta_2" or actuator.load.basis == "b-spline"
        return (-np.inf, np.inf) if signed else (0.0, np.inf)
    base = name.partition("@")[0]
    row, value = Parameters.row(base), actuator.value(base)
    if value <= 0.0:
        return row.low, row.high
    if not np.isfinite(row.high):
        return value / DEFAULT_RANGE, value * DEFAULT_RANGE
    return row.low if row.low_included else value / DEFAULT_RANGE, row.high
