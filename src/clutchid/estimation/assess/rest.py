"""Cause of a shift of the vented rest since the calibration: its sensor, wear, or unknown."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from clutchid.estimation.assess.comparison import Comparison, comparison
from clutchid.estimation.assess.evidence import Reason
from clutchid.estimation.result import Fit
from clutchid.names import ParameterName
from clutchid.numerics.interval import QUANTILE
from clutchid.strokes.vented_rest import RestShift

Cause = Literal["sensor", "wear", "unknown"]

#: A travel to the far stop decides where its standard deviation is below this share of the shift of the rest.
_DECISIVE = 0.25


class MovedRest(NamedTuple):
    """A vented rest that has moved since the calibration, what of it was subtracted from the position in m, and why."""

    recording: str
    shift: RestShift
    subtracted: float
    cause: Cause


class Stop(NamedTuple):
    """By how much in m the travel from the rest to the far stop has grown, with its standard deviation."""

    growth: float
    std: float


def moved_rests(fit: Fit) -> tuple[MovedRest, ...]:
    """The rests of the fitted recordings that have moved since the calibration."""
    rests = []
    for name, recording in fit.recordings.items():
        shift = recording.rest
        if shift is not None and shift.moved:
            cause = rest_cause(shift, _stop(fit, name, shift, recording.subtracted), less_worn=_less_worn(fit))
            rests.append(MovedRest(name, shift, recording.subtracted, cause))
    return tuple(rests)


def rest_cause(shift: RestShift, stop: Stop | None = None, *, less_worn: bool = False) -> Cause:
    """Cause of a shift of the rest, from one recording alone.

    With wear of a clutch that is pushed the rest falls, and the travel from there to the far stop grows by as much; a
    sensor moves both ends alike. Without the far stop the sign decides, for wear does not lift the rest; downwards only
    the pace over several recordings does, see `clutchid.wear`.

    Parameters
    ----------
    shift : m
        Of the rest, which has moved.
    stop : Stop, optional
        Travel to the far stop, where it was reached.
    less_worn : bool
        Whether the load says that the clutch is less worn than at the calibration, as a new one is.

    Examples
    --------
    >>> up, down = RestShift(3e-4, 2.8e-4, 3.2e-4), RestShift(-3e-4, -3.2e-4, -2.8e-4)
    >>> rest_cause(up), rest_cause(down), rest_cause(down, Stop(3e-4, 2e-5)), rest_cause(down, Stop(0.0, 2e-5))
    ('sensor', 'unknown', 'wear', 'sensor')
    """
    if stop is not None and stop.std <= _DECISIVE * abs(shift.value):
        half = QUANTILE * float(np.hypot(stop.std, shift.std))
        if abs(stop.growth) <= half < abs(stop.growth + shift.value):
            return "sensor"
        if abs(stop.growth + shift.value) <= half < abs(stop.growth):
            return "wear" if shift.value < 0.0 else "unknown"
    return "sensor" if shift.value > 0.0 and not less_worn else "unknown"


def _stop(fit: Fit, recording: str, shift: RestShift, subtracted: float) -> Stop | None:
    """Growth of the travel to the far stop, where the fit has it for a recording."""
    now = fit.parameters.get(str(ParameterName("y_max", recording)))
    if now is None or fit.baseline is None or not np.isfinite(now.std):
        return None
    before = float(np.sqrt(fit.baseline.covariance_of(("y_max",))[0, 0]))
    growth = now.value - fit.actuator.parameters.y_max - (shift.value - subtracted)
    return Stop(growth, float(np.hypot(now.std, before)))


def _less_worn(fit: Fit) -> bool:
    """Whether the load reaches half of its peak earlier than at the calibration."""
    compared: Comparison | None = comparison(fit)
    return compared is not None and compared.shift.high < 0.0


def rest_reasons(fit: Fit) -> list[Reason]:
    """A reason for each rest that has moved while the position was kept as recorded."""
    return [
        reason
        for rest in moved_rests(fit)
        if not rest.subtracted
        for reason in kept_rest(rest.shift.value, rest.recording)
    ]


def kept_rest(shift: float, recording: str = "") -> list[Reason]:
    """The reason for a rest that has moved by `shift` in m while the position was kept; none where it has not."""
    if shift == 0.0:
        return []
    return [
        Reason(
            f"{recording}{': ' if recording else ''}the vented rest has moved by {shift * 1e3:+.2f} mm since the "
            "calibration and was not subtracted (--zero keep): the load refers to a different zero, and may have "
            "errors that its interval does not include."
        )
    ]
