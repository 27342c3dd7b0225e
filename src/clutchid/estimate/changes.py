"""Changes of an actuator since its calibration, as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Change:
    """A parameter that has changed, or may have changed, since the calibration, in one recording.

    Parameters
    ----------
    recording, name
        Stem of the recording, and the parameter.
    before, after, std : unit
        Calibrated value, present value, and the standard deviation of the latter.
    probability : 1
        Of a change; None if the method gives none.
    group : str
        Parameters that change together, for example "flow of the valves".
    fitted : bool
        Whether it was fitted with the load; otherwise it was fixed, and the intervals are wider because of it.
    distance : 1
        Of its group from an unchanged actuator in standard deviations; None if it was fitted.
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
