"""The request of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from clutchid.errors import ParameterError
from clutchid.estimation.search_state import Continuation
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log.measured import MEASURED
from clutchid.names import EVERY_RECORDING, ParameterName, unknown_name
from clutchid.recordings.strokes.vented_rest import VentedRest, Zero
from clutchid.simulation.partition import Partition

#: Fewest draws of a bootstrap for a standard deviation.
FEWEST_DRAWS = 10


@dataclass(frozen=True, slots=True)
class FitRequest:
    """A request of a fit; the fields are the arguments of `clutchid.fit`.

    `continues` is the search of the start file, continued if it is of the same recordings and free parameters; `rest`
    is the vented rest of its calibration, from which the position counts with `zero` "subtract".

    Raises
    ------
    ParameterError
        If a measured column is unknown or none is given, or the bootstrap has too few draws.
    """

    measure: tuple[str, ...] = ("position",)
    free: tuple[str, ...] = ("load",)
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
        unknown = [unknown_name(name, MEASURED, "measured column") for name in self.measure if name not in MEASURED]
        if unknown or not self.measure:
            raise ParameterError(
                "\n".join(unknown) or "measure: nothing to compare with; give position, pressure_a or both."
            )
        if self.bootstrap < 0 or 0 < self.bootstrap < FEWEST_DRAWS:
            raise ParameterError(
                f"bootstrap = {self.bootstrap}: 0 for none, or at least {FEWEST_DRAWS} draws; 200 are usual."
            )

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
