"""Parameters and states of an `OwnModel`."""

from __future__ import annotations

from dataclasses import dataclass

from clutchid.log.states import STATES, State
from clutchid.parameters import Adapting, Drift, Freed, GroupChange, Row, Spread

#: Defaults of a new state relative to its scale: process noise over 0.1 s, standard deviation at a vented start and at
#: any other, and a large rate in 1/s. They are those of the deflection z of the seals.
_LIKE = STATES["z"]
_NOISE, _START, _UNKNOWN_START, _FAST = (
    value / _LIKE.scale for value in (_LIKE.noise, _LIKE.start, _LIKE.unknown_start, _LIKE.fast)
)

#: Source of what a row of an own model says.
_OWN = "own model"


@dataclass(frozen=True, slots=True)
class OwnParameter:
    """A parameter of an `OwnModel`, in SI.

    Parameters
    ----------
    default, unit, meaning
        Value without another one, SI unit such as ``N·s/m`` (or ``N*s/m``), and a noun phrase.
    range
        Smallest and largest admissible value; -inf and inf are open. Required.
    std
        Standard deviation of its prior, in its unit, above 0. The prior is log-normal where the range has no negative
        value and the default is above 0, else normal.
    drift
        Standard deviation of its change between two recordings of one actuator, in its unit, at least 0.
    changes
        What a hypothesis about the groups of `clutchid.parameters.GROUPS` changes in it beyond, in its unit.
    freed
        Whether ``--free auto`` frees it; by default if it has `std`.
    considered
        Whether its drift is only part of the uncertainty, and not estimated from position alone.
    adapts
        Standard deviation of its change within hours, in its unit, above 0; with it, the parameter adapts in the
        observer's method 'joint'. By default it stays as calibrated.
    """

    default: float
    unit: str
    meaning: str
    range: tuple[float, float] | None = None
    std: float | None = None
    drift: float = 0.0
    changes: tuple[GroupChange, ...] = ()
    freed: bool | None = None
    considered: bool = False
    adapts: float | None = None

    @property
    def row(self) -> Row:
        """The row that parameters of the package have."""
        low, high = self.range or (float("nan"), float("nan"))
        freed = self.std is not None if self.freed is None else self.freed
        return Row(
            self.unit,
            self.meaning,
            low,
            high,
            True,
            _OWN,
            spread=None if self.std is None else Spread(self.std, False, _OWN),
            log_normal=low >= 0.0 and self.default > 0.0,
            drift=Drift(self.drift, considered=self.considered) if self.drift else None,
            changes=self.changes,
            freed=Freed() if freed else None,
            adapts=None if self.adapts is None else Adapting(std=self.adapts),
        )


@dataclass(frozen=True, slots=True)
class OwnState:
    """A state of an `OwnModel`, in SI.

    Parameters
    ----------
    unit, meaning
        SI unit and a noun phrase.
    scale
        Size that it reaches, above 0; it makes searches dimensionless.
    start
        Name of the parameter that is its initial value; 0 without one.
    noise
        Standard deviation of the process noise over 0.1 s, above 0; 5 % of the scale without one.
    """

    unit: str
    meaning: str
    scale: float
    start: str | None = None
    noise: float | None = None

    def row(self, name: str) -> State:
        """The row that states of the package have."""
        return State(
            unit=self.unit,
            meaning=self.meaning,
            column=f"{name} [{self.unit}]",
            scale=self.scale,
            noise=_NOISE * self.scale if self.noise is None else self.noise,
            start=_START * self.scale,
            unknown_start=_UNKNOWN_START * self.scale,
            starts_at=self.start,
            fast=_FAST * self.scale,
        )
