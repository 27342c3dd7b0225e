"""The result of a fit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from clutchid.errors import SolveError
from clutchid.estimation.changes import Change, Departure
from clutchid.estimation.search_state import SearchState
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import Assumption
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.recordings.strokes.vented_rest import RestShift

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

Status = Literal["ok", "warning", "failed"]

#: Recordings and parameters that the text of a fit names; there may be hundreds.
_NAMED, _SHOWN = 3, 6


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimate in SI with standard error and 95 % interval, which are infinite if the data do not determine it.

    Examples
    --------
    As text it has the 95 % interval, not the standard error:

    >>> print(Estimate(8.9e5, "Pa", 1e3, 8.8804e5, 8.9196e5))
    8.9e+05 ± 2e+03 Pa
    """

    value: float
    unit: str
    std: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half width of the 95 % interval; the wider side of one that ends at a bound."""
        return max(self.high - self.value, self.value - self.low)

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.value:.4g} ± {self.half:.2g}{unit}" if np.isfinite(self.half) else "not determined"


@dataclass(frozen=True, slots=True, eq=False)
class LoadCurve:
    """The load in N over the position in m with its pointwise 95 % interval, 101 points from 0 to the full stroke."""

    position: FloatArray
    force: FloatArray
    low: FloatArray
    high: FloatArray

    def __repr__(self) -> str:
        at = self.peak(float(self.position[-1]))
        return (
            f"LoadCurve({self.position.size} points from {self.position[0] * 1e3:g} to {self.position[-1] * 1e3:g} mm, "
            f"greatest {self.force[at] / 1e3:.3g} kN at {self.position[at] * 1e3:.3g} mm)"
        )

    def peak(self, furthest: float) -> int:
        """Index of the greatest load up to position `furthest` in m, among points with an interval if any has one."""
        inside = self.position <= max(furthest, float(self.position[0]))
        known = inside & np.isfinite(self.high - self.low)
        return int(np.argmax(np.where(known if known.any() else inside, self.force, -np.inf)))


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of a simulation against the measured samples: rms and sum of squares, in m and Pa.

    The paper's Table 2 lists sums of squares. Pressure is None if it was not measured.
    """

    position_rms: float
    position_sse: float
    pressure_a_rms: float | None
    pressure_a_sse: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One recording of a fit: simulation, errors, and start values of its segments (position in m, pressure in Pa).

    `rest` says how far the vented rest has moved since the calibration, None where that is not known; `subtracted` is
    what was therefore subtracted from the recorded position, in m.
    """

    measured: Log
    simulated: Log
    errors: Errors
    starts: tuple[tuple[float, float], ...]
    rest: RestShift | None = None
    subtracted: float = 0.0


@dataclass(frozen=True, eq=False)
class Fit:
    """The result of `clutchid.fit`.

    `actuator` is the fitted one, `parameters` are its free parameters with intervals, in the order of `covariance`.
    `recordings` are the fitted ones by name, `verification` those that were only simulated. `scales` are the noise
    scales by which residuals of position (m) and pressure (Pa) were divided, `bounds` the bounds of the free
    parameters. `notes` say which parameters the data determine, `calibration` serves later fits of the same actuator.
    `converged` says that the search ended within its limits, `search` how, with what a later search needs to continue
    it. `baseline` is the calibration that the fit started from, `changes` are what has changed, or may have, since,
    and `departure` says how far a load from position alone departs from it. `assumed` are the conditions of the
    recordings that are not known. `readings` are several recordings read
    one by one from the calibration, by name.
    """

    status: Status
    message: str
    actuator: Actuator
    parameters: Mapping[str, Estimate]
    covariance: FloatArray
    load_curve: LoadCurve
    recordings: Mapping[str, Recording]
    errors: Errors
    scales: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]]
    evaluations: int
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
    readings: Mapping[str, Fit] = field(default_factory=dict)

    if TYPE_CHECKING:  # attached by `clutchid.workflow.attached`

        @property
        def evidence(self) -> Any: ...

        @property
        def verdict(self) -> Any: ...

        @property
        def comparison(self) -> Any: ...

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
                known = difference[np.isfinite(difference)]
                total, count = sums.get(name, (0.0, 0))
                sums[name] = (total + float(np.sum(known**2)), count + known.size)
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
