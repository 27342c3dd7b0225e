"""The request of a fit: free parameters with their bounds, priors, and the search that it continues."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from clutchid.arguments import check_fields
from clutchid.errors import ParameterError
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log.states import MEASURED
from clutchid.model.actuator import Actuator
from clutchid.names import EVERY_RECORDING, ParameterName, base_of, listed_names, unknown_name
from clutchid.simulation.partition import Partition
from clutchid.strokes.vented_rest import VentedRest, Zero

#: Default bounds of a magnitude and of an own parameter: this factor below and above the start value. The others have
#: their whole range; where its lower end does not belong to it, the distance to that end may shrink by this factor.
_DEFAULT_RANGE = 3.0


@dataclass(frozen=True, slots=True)
class SearchStart:
    """Start of a search that continues an earlier one.

    Attributes
    ----------
    values, scales : SI
        Of its parameters, and of the noise of its columns.
    """

    values: Mapping[str, float]
    scales: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class FreeParameters:
    """Free parameters of a search.

    Attributes
    ----------
    names
        NAME or NAME@STEM.
    measure
        Measured columns in use.
    bounds, priors : SI
        Those that were requested or follow from a calibration, by name.
    start
        Of the search; by default it is at the means of the priors.
    conditions : SI
        Values of T_0 and P_S that the user knows.
    partition
        Of a simulation; ballistic by default.
    """

    names: tuple[str, ...]
    measure: tuple[str, ...]
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    priors: Mapping[str, Prior] = field(default_factory=dict)
    start: SearchStart | None = None
    conditions: Mapping[str, Prior] = field(default_factory=dict)
    partition: Partition | None = None

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
    names = [[ParameterName(n.base, stem) for stem in stems] if n.recording == EVERY_RECORDING else [n] for n in parsed]
    return tuple(dict.fromkeys(str(name) for group in names for name in group))


def bounds_of(
    names: Sequence[str], actuator: Actuator, stated: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Bounds of all free `names` in SI: those `stated`, else the default.

    Raises
    ------
    ParameterError
        If bounds cross, are not admissible, or belong to a fixed parameter.
    """
    foreign = [
        f"bounds for {name}, which is not free; free are {', '.join(names) or 'none'}."
        for name in stated
        if name not in names
    ]
    crossed = [
        f"{name}: lower bound {low:g} is not below upper bound {high:g}."
        for name, (low, high) in stated.items()
        if not low < high
    ]
    outside = [
        f"{name}: bound {bound:g} is not admissible, it must be {row.allowed} {row.unit}."
        for name, limits in stated.items()
        if base_of(name) in actuator.parameter_names
        for row in [actuator.row(base_of(name))]
        for bound in limits
        if np.isfinite(bound) and not row.admits(bound)
    ]
    if foreign or crossed or outside:
        raise ParameterError("\n".join(foreign + crossed + outside))
    return {name: stated.get(name, _default_bounds(name, actuator)) for name in names}


def _default_bounds(name: str, actuator: Actuator) -> tuple[float, float]:
    if name in actuator.load.names:
        signed = name == "theta_2" or actuator.load.basis == "b-spline"
        return (-np.inf, np.inf) if signed else (0.0, np.inf)
    base = base_of(name)
    row, value = actuator.row(base), actuator.value(base)
    if value <= 0.0:
        return row.low, row.high
    if row.magnitude or actuator.own_row(base) is not None:
        return max(row.low, value / _DEFAULT_RANGE), min(row.high, value * _DEFAULT_RANGE)
    low = row.low if row.low_included else row.low + (value - row.low) / _DEFAULT_RANGE
    return low, row.high


_SearchStatus = Literal["converged", "stalled", "limit"]


@dataclass(frozen=True, slots=True)
class SearchState:
    """End of a search with priors.

    Attributes
    ----------
    status
        'converged', 'stalled' or 'limit'.
    evaluations
        Of the model.
    free
        Parameters that were requested free.
    priors : SI
        Of all free ones: more than `free` if the method freed parameters of its own, such as the phase of the carrier.
    """

    status: _SearchStatus
    evaluations: int
    free: tuple[str, ...]
    priors: Mapping[str, Prior]


@dataclass(frozen=True, slots=True)
class Continuation:
    """An earlier search that may be continued.

    Attributes
    ----------
    state
        Where it ended.
    values, scales : SI
        Of its parameters, and of the noise of its columns.
    data
        Hashes of its recordings, by name.
    """

    state: SearchState
    values: Mapping[str, float]
    scales: Mapping[str, float]
    data: Mapping[str, str]

    def applies(self, free: Iterable[str], measure: Iterable[str], data: Mapping[str, str]) -> bool:
        """Whether the same parameters are free, and the same columns of the same recordings are compared.

        A recording without a known hash, such as a log that was made in memory, is never the same.
        """
        same = set(free) == set(self.state.free) and set(measure) == set(self.scales)
        return same and bool(data) and "unknown" not in data.values() and dict(data) == dict(self.data)


def ended(status: _SearchStatus, evaluations: int) -> str:
    """End of a search, for messages.

    Examples
    --------
    >>> ended("converged", 34)
    'converged after 34 evaluations'
    """
    words = {
        "converged": "converged after {} evaluations",
        "stalled": "stalled after {} evaluations, not converged: no shorter step lowers the cost",
        "limit": "stopped after {} evaluations, not converged: the allowed number of evaluations is used up",
    }
    return words[status].format(evaluations)


#: Fewest draws of a bootstrap for a standard deviation.
_FEWEST_DRAWS = 10


#: Measured columns and free parameters of a request that names none: those of the verb.
_OF_THE_VERB = ("default",)


@dataclass(frozen=True, slots=True)
class FitRequest:
    """All options of a fit, except how its recordings are read.

    Attributes
    ----------
    measure : 'position', 'pressure_a'
        Measured columns to compare with. These and other names may be one text with commas.
    free : names
        Free parameters; 'load' means all load weights, NAME@EACH a parameter of its own for every recording, 'auto' all
        parameters that a recording with pressure can determine. Empty: only unknown start values are estimated.
    bounds : {name: (low, high)}
        In SI. By default theta_1 and theta_3 are at least 0, theta_2 is free (it changes sign on a worn clutch), every
        other magnitude stays within a factor of three of its start, and fractions and shapes within their range.
    partition : Partition, optional
        Partitioned ballistic simulation; ballistic by default.
    method : 'simulation', 'shooting' or 'prediction-error', optional
        By default that of the calibration, or 'prediction-error' if duty cycles change between the samples; without a
        calibration 'shooting' if 'auto', priors or parameters of single recordings need it, else 'simulation'.
    priors : {name: Prior}
        Priors in SI; defaults in `clutchid.inference.uncertainty.coordinates`.
    calibration : Calibration, optional
        ``fit.calibration`` of a fit with pressure, by the same method, for this actuator.
    profile : names
        Free parameters with intervals by profile likelihood; 'shooting' only, seconds each.
    bootstrap : int
        Draws of a bootstrap over strokes, which checks the intervals of the load; 'shooting' only, 0 for none.
    continues
        Search of the start file, continued if it is of the same recordings and free parameters.
    zero : 'subtract' or 'keep'
        Whether the position counts from the vented rest where that has moved since the calibration, as after an
        exchange of the sensor or with wear; or as it was recorded.
    rest
        Vented rest of the calibration of the start file, from which the position counts.

    Raises
    ------
    ParameterError
        If a measured column is unknown or none is given, or the bootstrap has too few draws.

    Examples
    --------
    Columns and parameters that a request does not name are those of the verb:

    >>> request = FitRequest(bounds={"theta_1": (0.0, 2e6)})
    >>> request.completed(("position", "pressure_a"), ("auto",)).free
    ('auto',)
    """

    measure: tuple[str, ...] = _OF_THE_VERB
    free: tuple[str, ...] = _OF_THE_VERB
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    partition: Partition | None = None
    method: str | None = None
    priors: Mapping[str, Prior] = field(default_factory=dict)
    calibration: Calibration | None = None
    profile: tuple[str, ...] = ()
    bootstrap: int = 0
    continues: Continuation | None = None
    zero: Zero = "subtract"
    rest: VentedRest | None = None

    def __post_init__(self) -> None:
        for name in ("measure", "free", "profile"):
            object.__setattr__(self, name, listed_names(getattr(self, name)))
        check_fields(self)
        unknown = [
            unknown_name(name, MEASURED, "measured column")
            for name in self.measure
            if name not in MEASURED and self.measure != _OF_THE_VERB
        ]
        if unknown or not self.measure:
            raise ParameterError(
                "\n".join(unknown) or "measure: nothing to compare with; give position, pressure_a or both."
            )
        if self.bootstrap < 0 or 0 < self.bootstrap < _FEWEST_DRAWS:
            raise ParameterError(
                f"bootstrap = {self.bootstrap}: 0 for none, or at least {_FEWEST_DRAWS} draws; 200 are usual."
            )

    def completed(self, measure: tuple[str, ...] = ("position",), free: tuple[str, ...] = ("load",)) -> FitRequest:
        """The request with `measure` and `free` where it names none; by default those of `clutchid.fit`."""
        measured, names = (
            usual if own == _OF_THE_VERB else own for own, usual in ((self.measure, measure), (self.free, free))
        )
        return self if (measured, names) == (self.measure, self.free) else replace(self, measure=measured, free=names)

    @property
    def counted_from(self) -> VentedRest | None:
        """The vented rest that the position counts from, where it is known."""
        return self.rest or (self.calibration.rest if self.calibration else None)

    @property
    def automatic(self) -> bool:
        """Whether all parameters are free that a recording with pressure may determine."""
        return "auto" in self.free

    @property
    def checks(self) -> bool:
        """Whether profile likelihood or a bootstrap is requested."""
        return bool(self.profile or self.bootstrap)

    def alone(self, recording: str) -> FitRequest:
        """The request for one of several recordings alone: without parameters of the others, profiles and bootstrap."""

        def applies(name: str) -> bool:
            return ParameterName.parse(name).applies_to(recording) or name.endswith(f"@{EVERY_RECORDING}")

        free = tuple(filter(applies, self.free))
        bounds = {name: limits for name, limits in self.bounds.items() if applies(name)}
        priors = {name: prior for name, prior in self.priors.items() if applies(name)}
        return replace(self, free=free, bounds=bounds, priors=priors, profile=(), bootstrap=0)

    @property
    def has_priors(self) -> bool:
        """Whether the request needs a method with priors."""
        own = any(ParameterName.parse(name).recording for name in self.free)
        return bool(self.automatic or own or self.checks or self.calibration or self.priors)
