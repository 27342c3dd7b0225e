"""What is asked of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from clutchid.errors import ParameterError
from clutchid.measured import MEASURED
from clutchid.names import ParameterName
from clutchid.parameters import unknown_name
from clutchid.simulation.partition import Partition
from clutchid.uncertainty.calibration import Calibration
from clutchid.uncertainty.coordinates import Prior

#: Of fewer draws a bootstrap gives no spread.
FEWEST_DRAWS = 10


@dataclass(frozen=True, slots=True)
class FitRequest:
    """What is asked of a fit; the fields are the arguments of `clutchid.fit`, which explains them.

    Raises
    ------
    ParameterError
        If a measured column is unknown or none is named, or the bootstrap has too few draws.
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
    def automatic(self) -> bool:
        """Whether all is free that a recording with pressure may determine."""
        return "auto" in self.free

    @property
    def checks(self) -> bool:
        """Whether intervals are to be checked by profile likelihood or bootstrap."""
        return bool(self.profile or self.bootstrap)

    @property
    def has_priors(self) -> bool:
        """Whether something is asked for that only a method with priors knows."""
        own = any(ParameterName.parse(name).recording for name in self.free)
        return bool(self.automatic or own or self.checks or self.calibration or self.priors)
