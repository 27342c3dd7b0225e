"""A `Section`: a stroke or a rest of a recording, and the summary of its motion and inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from clutchid.log import Log

Kind = Literal["stroke", "rest"]

#: Labels of strokes and of rests, in the field's words.
STROKES = (
    "full stroke",
    "partial stroke",
    "gear shift",
    "pull-away",
    "slip control",
    "ramp",
    "staircase",
    "bang-bang",
)
RESTS = ("vented rest", "held", "no position")


@dataclass(frozen=True, slots=True)
class SectionSummary:
    """Motion and inputs of a section; positions in m as measured, speeds in m/s, times in s.

    `level` is the position of the vented rest estimated up to that time (the sensor's zero), `reach` the largest travel
    from there up to that time. `vented_rest` is the time at rest and vented before the section (for a rest: within it),
    which may be longer than the part of it in `Section.log`. A pulse is an opening of a closed valve, a duty step any
    change of a duty cycle. `missing` is the fraction of samples without a position, `pressure` whether the pressure of
    chamber A is measured.
    """

    lowest: float
    highest: float
    level: float
    reach: float
    opening_speed: float
    closing_speed: float
    vented_rest: float
    supply_pulses: int
    exhaust_pulses: int
    duty_steps: int
    missing: float
    pressure: bool


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """A stroke or a rest: its samples `log` from `start` to `end` in s, and the index `first` of its first sample.

    A stroke's samples begin with up to half a second of the vented rest before it, so that a simulation can start
    there with Eq. (24); `departure` is the time in s at which the stroke leaves it (`start` where there is none).
    Two sections are adjacent if the last sample of one is followed by the first of the other.
    """

    kind: Kind
    label: str
    log: Log
    start: float
    end: float
    departure: float
    first: int
    summary: SectionSummary

    def __len__(self) -> int:
        return len(self.log)

    @property
    def seconds(self) -> float:
        """Time from the first to the last sample in s."""
        return self.end - self.start
