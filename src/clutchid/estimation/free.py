"""Free parameters of a fit, and their bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from clutchid.errors import ParameterError
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.model.actuator import Actuator
from clutchid.names import EVERY_RECORDING, ParameterName, base_of, unknown_name

#: Default bounds of a magnitude and of an own parameter: this factor below and above the start value. The others have
#: their whole range; where its lower end does not belong to it, the distance to that end may shrink by this factor.
DEFAULT_RANGE = 3.0


@dataclass(frozen=True, slots=True)
class SearchStart:
    """Start of a search that continues an earlier one: values of parameters and noise scales of columns, in SI."""

    values: Mapping[str, float]
    scales: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class FreeParameters:
    """Free parameters (NAME or NAME@STEM), measured columns in use, bounds and priors in SI, and start of the search.

    By default a search starts at the means of the priors. `conditions` are values of T_0 and P_S that the user knows.
    """

    names: tuple[str, ...]
    measure: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    priors: Mapping[str, Prior] = field(default_factory=dict)
    start: SearchStart | None = None
    conditions: Mapping[str, Prior] = field(default_factory=dict)

    def reads_load(self, actuator: Actuator) -> bool:
        """Whether a load is estimated from position alone."""
        return "pressure_a" not in self.measure and bool(set(self.names) & set(actuator.load.names))


def free_names(free: Sequence[str], actuator: Actuator, stems: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the free parameters; 'load' is expanded to all load weights, NAME@EACH to NAME@STEM for all `stems`.

    Raises
    ------
    ParameterError
        For an unknown name, with the nearest known one, and for a parameter of a missing chamber or valve.
    """
    expanded = actuator.expanded(free)
    problems = []
    for name in expanded:
        base, stem = ParameterName.parse(name)
        if base not in actuator.names:
            problems.append(unknown_name(base, ("load", *actuator.names)))
        elif sentence := actuator.equipment.missing(base):
            problems.append(sentence)
        elif stem is not None and base in actuator.load.names:
            problems.append(f"{name}: the load is shared by all recordings; fit them one by one for a load of each.")
        elif stem is not None and stem not in (EVERY_RECORDING, *stems):
            problems.append(unknown_name(stem, (EVERY_RECORDING, *stems), "recording"))
    if problems:
        raise ParameterError("\n".join(problems))
    parsed = map(ParameterName.parse, expanded)
    each = [[ParameterName(n.base, stem) for stem in stems] if n.recording == EVERY_RECORDING else [n] for n in parsed]
    return tuple(dict.fromkeys(str(name) for group in each for name in group))


def bounds_of(
    names: Sequence[str], actuator: Actuator, given: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Bounds of all free `names` in SI: those `given`, else the default.

    Raises
    ------
    ParameterError
        If bounds cross, are not admissible, or belong to a fixed parameter.
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
        if base_of(name) in actuator.parameter_names
        for row in [actuator.row(base_of(name))]
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
    base = base_of(name)
    row, value = actuator.row(base), actuator.value(base)
    if value <= 0.0:
        return row.low, row.high
    if row.magnitude or actuator.own_row(base) is not None:
        return max(row.low, value / DEFAULT_RANGE), min(row.high, value * DEFAULT_RANGE)
    low = row.low if row.low_included else row.low + (value - row.low) / DEFAULT_RANGE
    return low, row.high
