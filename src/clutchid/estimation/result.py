"""The result of a fit, and the parts of it that all methods share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from clutchid.errors import SolveError
from clutchid.estimation.request import FitRequest, SearchState
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import Assumption
from clutchid.inference.uncertainty.estimates import POINTS, Estimate, LoadCurve
from clutchid.inference.uncertainty.identifiability import Identifiability
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.names import made_anew
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.least_squares import Start
from clutchid.simulation.plan import Plan
from clutchid.simulation.simulation import simulated_log
from clutchid.strokes.vented_rest import RestShift

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Change:
    """A parameter that has changed, or may have changed, since the calibration, in one recording.

    Parameters
    ----------
    recording, name
        Stem of the recording, and the parameter.
    before, after, std : unit
        Calibrated value, estimate of the present one, and its standard deviation.
    unit
        SI unit of the parameter.
    probability : 1
        That its group has changed.
    group
        Parameters that change together, see `clutchid.inference.uncertainty.change_prior`.
    """

    recording: str
    name: str
    before: float
    after: float
    std: float
    unit: str
    probability: float
    group: str


class Moved(NamedTuple):
    """A parameter that has moved since the calibration.

    Attributes
    ----------
    name
        Of the parameter.
    before, after : SI
        Calibrated value, and that of the reading.
    """

    name: str
    before: float
    after: float


class Departure(NamedTuple):
    """Departure of recordings from a calibration.

    Attributes
    ----------
    distance : 1
        Squared Mahalanobis distance of what may change from its calibrated values, under the prior that all groups have
        changed. A leak does not count: it is a fault of this truck, whatever its size.
    expected : 1
        That of a truck drawn from this prior: the number of parameters that the data determine, at most all.
    misfit : 1
        Cost for each second in motion over that of the calibration recordings read from position alone; NaN if that is
        not known.
    moved
        The parameters that have moved farthest, in standard deviations of this prior.
    """

    distance: float
    expected: float
    misfit: float
    moved: tuple[Moved, ...] = ()


class InputFault(NamedTuple):
    """A fault of the inputs that was compared with a recording as it is, see `clutchid.estimation.causes`.

    Attributes
    ----------
    name
        Of the fault; "as recorded" without one.
    sentence, remedy
        Clauses: the fault with its size, and what to do about it.
    size : SI
        Of the fault.
    innovations : 1
        Mean NIS in motion with the fault undone, over that of the calibration recordings.
    log_likelihood : 1
        Of an innovation, with the fault undone.
    """

    name: str
    sentence: str
    remedy: str
    size: float
    innovations: float
    log_likelihood: float


class ProfileCurve(NamedTuple):
    """Profile likelihood of a parameter: the cost, minimised over all others, where it is fixed.

    Attributes
    ----------
    low, high : SI
        Ends of the 95 % interval.
    values : SI, (n,)
        Where it was fixed, rising.
    distances : 1, (n,)
        How far they are from the estimate by the growth of the cost, in standard deviations: 1.96 at an end of the
        interval. Infinite where nothing could be simulated.
    shape
        'bounded', 'open below' or 'open above' where the cost does not grow as far up to a bound, or within four half
        widths of the interval from the covariance; 'flat' where it does so on neither side.
    """

    low: float
    high: float
    values: FloatArray
    distances: FloatArray
    shape: Literal["bounded", "open below", "open above", "flat"]


_Status = Literal["ok", "warning", "failed"]

#: Recordings and parameters that the text of a fit names; there may be hundreds.
_NAMED, _SHOWN = 3, 6


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of a simulation against the measured samples; the paper's Table 2 lists sums of squares.

    Attributes
    ----------
    position_rms : m
        Root mean square of the position error.
    position_sse : m²
        Sum of its squares over all samples.
    pressure_a_rms : Pa
        Root mean square of the pressure error; None if pressure was not measured.
    pressure_a_sse : Pa²
        Sum of its squares; None if pressure was not measured.
    """

    position_rms: float = float("nan")
    position_sse: float = float("nan")
    pressure_a_rms: float | None = None
    pressure_a_sse: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One recording of a fit.

    Attributes
    ----------
    measured
        The recording, as it was fitted.
    simulated
        All states at the samples of `measured`, from the fitted actuator.
    errors : m, Pa
        Of the simulation against the measured samples.
    starts : m, Pa
        Position and pressure in chamber A at the start of each segment.
    rest : m
        How far the vented rest has moved since the calibration; None where that is not known.
    subtracted : m
        What was therefore subtracted from the recorded position.
    """

    measured: Log
    simulated: Log
    errors: Errors
    starts: tuple[tuple[float, float], ...]
    rest: RestShift | None = None
    subtracted: float = 0.0


@dataclass(frozen=True, eq=False)
class Fit:
    """The result of `clutchid.fit`; all values are in SI.

    Attributes
    ----------
    status
        'ok'; 'warning' where there are `warnings`; or 'failed', with no estimates.
    message
        How the search ended, or why there is no result: one sentence.
    actuator
        The fitted actuator; `clutchid.simulate` repeats the fit with it.
    parameters
        Free parameters by name with their 95 % intervals; NAME@STEM is a parameter of a single recording.
    covariance : SI, (k, k)
        Of the k free parameters, in the order of `parameters`; infinite where the data do not determine one.
    load_curve : N over m
        The load over the position with its pointwise 95 % interval.
    recordings
        Fitted recordings by name: measured, simulated, errors.
    errors : m, Pa
        Of the simulation against the measured samples of all fitted recordings.
    scales : m, Pa
        Noise scales by which residuals were divided, by measured column.
    bounds : SI
        Lower and upper bound of each free parameter.
    evaluations
        Number of evaluations of the model with its sensitivities.
    warnings
        What may be wrong with recordings and result, one sentence each.
    verification
        Recordings that were simulated with the result and not fitted, by name.
    method
        'simulation', 'shooting' or 'prediction-error'.
    notes
        Which parameters the data determine, and what requested checks found, one sentence each.
    calibration
        The calibration that this fit is, or that it started from; None without one.
    converged
        Whether the search ended within its limits.
    changes
        What has changed, or may have changed, since `baseline`.
    baseline
        The calibration that the fit started from; None without one.
    search
        How a search with priors ended, and what a later search needs to continue it; else None.
    departure
        How far a load from position alone departs from `baseline`; None where that is not known.
    assumed
        Conditions of the recordings that are not known and widen the interval of the load.
    load_per_supply : 1
        By how many % the load changes for 1 % of the supply pressure; None where that is fitted, and for another fit.
    readings
        Several recordings read one by one from the calibration, by name; else empty.
    starts
        All starts of the search, each with its final cost; `actuator` is the end of the one that costs least.
    causes
        Faults of the inputs that were compared because the calibration does not explain the recording, the most likely
        first.
    alternatives
        Readings without a suspected fault of the inputs, by its name.
    profiles
        Profile likelihood of the parameters for which it was requested, by name.
    draws : SI, (draws, k)
        Estimates of the free parameters by the bootstrap, in the order of `parameters`; None where not requested.
    gains : 1
        By what share the position error of each verified recording is below that of the start values; not for a load
        read from a calibration.
    identifiability
        Ranking, collinearity and near dependencies of the free parameters by the data alone; None without estimates.
    request, start
        The completed request, and the actuator that the search started from; None where it did not begin.

    Examples
    --------
    The bundled clutch needs about 4.2 kN; its load is known to 65 N at the peak, if the model holds:

    >>> import clutchid
    >>> fit = clutchid.fit(clutchid.bundled_recording().slice(0, 10_000))
    >>> fit.load_curve
    LoadCurve(101 points from 0 to 25 mm, greatest 4.15 kN at 8 mm)
    >>> peak = int(np.argmax(fit.load_curve.force))
    >>> half = (fit.load_curve.high[peak] - fit.load_curve.low[peak]) / 2
    >>> bool(50 < half < 80)
    True
    >>> fit.verdict.trust  # the model does not hold everywhere: fit.verdict.reasons
    'with care'
    """

    status: _Status
    message: str
    actuator: Actuator
    parameters: Mapping[str, Estimate]
    covariance: FloatArray
    load_curve: LoadCurve
    recordings: Mapping[str, Recording] = field(default_factory=dict)
    errors: Errors = Errors()
    scales: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    evaluations: int = 0
    warnings: tuple[str, ...] = ()
    verification: Mapping[str, Recording] = field(default_factory=dict)
    method: str = "simulation"
    notes: tuple[str, ...] = ()
    calibration: Calibration | None = None
    converged: bool = True
    changes: tuple[Change, ...] = ()
    baseline: Calibration | None = None
    search: SearchState | None = None
    departure: Departure | None = None
    assumed: tuple[Assumption, ...] = ()
    load_per_supply: float | None = None
    readings: Mapping[str, Fit] = field(default_factory=dict)
    starts: tuple[Start, ...] = ()
    causes: tuple[InputFault, ...] = ()
    alternatives: Mapping[str, Fit] = field(default_factory=dict)
    profiles: Mapping[str, ProfileCurve] = field(default_factory=dict)
    draws: FloatArray | None = None
    gains: Mapping[str, float] = field(default_factory=dict)
    identifiability: Identifiability | None = None
    request: FitRequest | None = None
    start: Actuator | None = None

    __reduce__ = made_anew

    def __post_init__(self) -> None:
        if self.status != "failed":
            object.__setattr__(self, "status", "warning" if self.warnings else "ok")

    if TYPE_CHECKING:  # attached by `clutchid.verbs.attached`

        @property
        def evidence(self) -> Any: ...

        @property
        def verdict(self) -> Any: ...

        @property
        def comparison(self) -> Any: ...

        @property
        def problem(self) -> Any: ...

        def plot(self) -> Figure: ...

        def report(self, path: str | PathLike[str]) -> None: ...

    def __repr__(self) -> str:
        names = [repr(name) for name in self.recordings]
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        lines = [f"Fit of {', '.join(names[:_NAMED])}{more}: {self.status}, {self.message}"]
        for name, e in [*self.parameters.items()][:_SHOWN]:
            lines.append(f"  {name} = {e}")
        if len(self.parameters) > _SHOWN:
            lines.append(f"  and {len(self.parameters) - _SHOWN} more in .to_frame()")
        counts = {"warning": len(self.warnings), "change": len(self.changes)}
        lines += [f"  {n} {what}{'s' if n > 1 else ''} in .{what}s" for what, n in counts.items() if n]
        return "\n".join(lines)

    def to_frame(self) -> pl.DataFrame:
        """Free parameters as rows: name, value, unit, std, low and high, in SI and with 95 % intervals."""
        import polars as pl

        schema = {"name": pl.String, "value": pl.Float64, "unit": pl.String} | dict.fromkeys(
            ("std", "low", "high"), pl.Float64
        )
        return pl.DataFrame([{"name": name, **asdict(e)} for name, e in self.parameters.items()], schema=schema)

    def raised(self) -> Fit:
        """This fit, unless it failed.

        Raises
        ------
        SolveError
            If its status is "failed".
        """
        if self.status == "failed":
            raise SolveError(self.message)
        return self

    @property
    def load_is_fitted(self) -> bool:
        """Whether any load weight is free; a fixed load has no interval."""
        return any(name in self.actuator.load.names for name in self.parameters)

    @property
    def follows(self) -> bool:
        """Whether the simulation follows the measurement through sensor models, unlike that of the paper."""
        return self.method != "simulation"


def errors_over(pairs: Iterable[tuple[Log, Log]]) -> Errors:
    """Errors of simulated against measured recordings, over all (measured, simulated) pairs and samples."""
    sums: dict[str, tuple[float, int]] = {}
    for measured, simulated in pairs:
        for name in ("position", "pressure_a"):
            if name in measured:
                difference = simulated[name] - measured[name]
                differences = difference[np.isfinite(difference)]
                total, count = sums.get(name, (0.0, 0))
                sums[name] = (total + float(np.sum(differences**2)), count + differences.size)
    return _errors(sums)


def _errors(sums: Mapping[str, tuple[float, int]]) -> Errors:
    def rms(name: str) -> float:
        total, count = sums[name]
        return float(np.sqrt(total / count)) if count else float("nan")

    if "position" not in sums:
        sums = {**sums, "position": (float("nan"), 1)}
    pressure = "pressure_a" in sums and sums["pressure_a"][1] > 0
    return Errors(
        rms("position"),
        sums["position"][0],
        rms("pressure_a") if pressure else None,
        sums["pressure_a"][0] if pressure else None,
    )


class Compared(NamedTuple):
    """A simulated recording, and the pair (measured, simulated sensor output) that its errors are computed from."""

    recording: Recording
    shown: tuple[Log, Log]


def compare_states(
    plan: Plan,
    states: FloatArray,
    starts: Sequence[tuple[float, float]],
    shown: Mapping[str, FloatArray] | None = None,
    half: FloatArray | None = None,
) -> Compared:
    """Compare a recording with its simulated `states`, shape (n, n_states).

    Parameters
    ----------
    plan : Plan
        The recording and its actuator.
    starts : (m, Pa)
        Position and pressure in chamber A at the start of every segment.
    shown : {column: values}, optional
        Simulated sensor outputs in SI; the states by default.
    half : Pa, optional
        Half width of the 95 % interval of the pressure at every sample.
    """
    simulated = simulated_log(plan.log, states, plan.actuator)
    pair = plan.log, simulated.with_columns(**shown) if shown else simulated
    if half is not None:
        pressure = simulated["pressure_a"]
        simulated = simulated.with_columns(**{"pressure_a low": pressure - half, "pressure_a high": pressure + half})
    return Compared(Recording(plan.log, simulated, errors_over([pair]), tuple(starts)), pair)


def position_and_pressure(actuator: Actuator, state: FloatArray) -> tuple[float, float]:
    """Position in m and pressure in chamber A in Pa of a state."""
    return float(state[actuator.states.index("y")]), float(state[actuator.states.index("p_A")])


def fitted_curve(
    actuator: Actuator, names: Sequence[str], covariance: FloatArray, quantile: float, bias: FloatArray | None = None
) -> LoadCurve:
    """The load with its pointwise 95 % interval.

    Parameters
    ----------
    actuator : Actuator
        As fitted.
    names : names
        Of the rows and columns of `covariance`; only load weights are used.
    covariance : SI
        Of the estimates.
    quantile : 1
        Half width of a 95 % interval in standard deviations.
    bias : N or N/m, optional
        Bias of every weight that has been subtracted; its standard deviation is taken equal to its size.

    Returns
    -------
    curve : LoadCurve
        With an infinite interval wherever a weight of infinite variance acts.
    """
    load = actuator.load
    y = np.linspace(0.0, actuator.parameters.y_max, POINTS)
    phi, force = load.phi(y), load.force(y)
    weights = [(i, load.names.index(name)) for i, name in enumerate(names) if name in load.names]
    rows, columns = [i for i, _ in weights], [j for _, j in weights]
    P = covariance[np.ix_(rows, rows)]
    unknown = ~np.isfinite(np.diag(P)) if rows else np.zeros(0, dtype=bool)
    P = np.where(np.isfinite(P), P, 0.0)
    variance = np.einsum("ni,ij,nj->n", phi[:, columns], P, phi[:, columns])
    if bias is not None:
        variance = variance + (phi @ bias) ** 2
    half = quantile * np.sqrt(np.maximum(variance, 0.0))
    half[np.any(phi[:, columns][:, unknown] != 0.0, axis=1)] = np.inf
    return LoadCurve(y, force, force - half, force + half)


def calibrated_curve(actuator: Actuator, calibration: Calibration) -> LoadCurve | None:
    """The load of a calibration on the basis of `actuator`, with its 95 % interval by the data; None if it has none.

    What the model misses, `calibration.missed`, is not in it.
    """
    load = actuator.load
    if len(calibration.theta) != len(load.theta):
        return None
    calibrated = replace(actuator, load=replace(load, theta=calibration.theta))
    return fitted_curve(calibrated, load.names, calibration.theta_covariance, QUANTILE)


def physical_limits(actuator: Actuator, name: str) -> tuple[float, ...]:
    """The ends of a parameter's physical range in SI; none of a load weight."""
    if name in actuator.load.names:
        return ()
    row = actuator.row(name)
    return row.low, row.high


def plan_warnings(plans: Sequence[Plan]) -> tuple[str, ...]:
    """Warnings about the recordings and their plans."""
    warnings = [warning for plan in plans for warning in (*plan.log.warnings, *plan.warnings)]
    return tuple(dict.fromkeys(warnings))
