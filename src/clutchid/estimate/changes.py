"""What has changed in an actuator since its calibration, as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Change:
    """A parameter that differs, or may differ, from its calibrated value in one recording.

    Parameters
    ----------
    recording, name
        Stem of the recording, and the parameter.
    before, after, std : unit
        As calibrated, as it is now, and the standard deviation of that.
    probability : 1
        That it has changed; None where the method gives none.
    group : str
        What changes together, for example "flow of the valves".
    fitted : bool
        Whether it was fitted with the load; else it was fixed, and the intervals are wider for it.
    distance : 1
        Of its group from an unchanged actuator, in standard deviations; None where it was fitted.
    """

    recording: str
    name: str
    before: float
    after: float
    std: float
    unit: str
    probability: float | None
    group: str
    fitted: bool
    distance: float | None = None
