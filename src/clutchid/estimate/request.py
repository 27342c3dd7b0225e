"""What is asked of a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.log import Log
from clutchid.measured import MEASURED
from clutchid.model.equipment import Equipment
from clutchid.names import ParameterName
from clutchid.parameters import unknown_name
from clutchid.simulation.partition import Partition
from clutchid.simulation.plan import outside_stroke
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


def check_recordings(logs: Sequence[Log], others: Sequence[Log], measure: Sequence[str], y_max: float) -> None:
    """Refuse, before any work, recordings that lack a column; only the fitted `logs` need all of `measure`.

    Raises
    ------
    DataError
        The text lists the problems of all recordings.
    """
    if not logs:
        raise DataError("no recording given; a fit needs at least one.")
    problems = []
    for log, compared in (*((log, measure) for log in logs), *((log, ("position",)) for log in others)):
        needed = dict.fromkeys(("duty_supply", "duty_exhaust", "position", *compared))
        absent = [name for name in needed if name not in log]
        empty = [name for name in compared if name in log and not np.isfinite(log[name]).any()]
        sentences, alien = outside_stroke(log, y_max)
        problems += sentences if alien else []
        problems += [f"{log.name}: no column '{name}'; it has {', '.join(log.columns)}." for name in absent]
        problems += [f"{log.name}: column '{name}' has no finite sample; nothing can be compared." for name in empty]
    if problems:
        raise DataError("\n".join(problems))


def driven(logs: Sequence[Log], equipment: Equipment) -> list[Log]:
    """Logs with different names, and with duty cycles for both valves of the model."""
    return [equipment.driven(log) for log in _uniquely_named(list(logs))]


def _uniquely_named(logs: list[Log]) -> list[Log]:
    """Logs with different names: a number is added where two files have the same stem."""
    taken = {log.name for log in logs}
    used: set[str] = set()
    named = []
    for log in logs:
        name, number = log.name, 2
        while name in used or (name != log.name and name in taken):
            name, number = f"{log.name} ({number})", number + 1
        used.add(name)
        named.append(log if name == log.name else replace(log, name=name))
    return named
