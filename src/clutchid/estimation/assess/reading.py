"""Reasons against a load that was read from position alone: its calibration, and how far the recording departs from it.

The thresholds are those of the table in docs/derivations.md, chosen on both families of the virtual truck.
"""

from __future__ import annotations

import numpy as np

from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.assess.reason import Reason
from clutchid.estimation.changes import Departure
from clutchid.estimation.result import Fit
from clutchid.numerics.interval import QUANTILE

#: Expected error of the load, rms over the stroke in % of the peak: up to the first it is good, beyond the second none.
GOOD_ERROR, POOR_ERROR = 1.8, 3.3

#: Distance from the calibration beyond the number of parameters, in standard deviations of chi-square: beyond the first
#: no change alone explains it, beyond the second the calibration is of another truck.
FAR, ANOTHER = 2.0, 4.0

#: Cost for each second in motion over that of the calibration: beyond the first the model misses part of the recording.
MISFIT, POOR_MISFIT = 1.5, 2.2

#: Position in m from which the error counts: before, the load is small.
FROM = 5e-4


def reading_reasons(fit: Fit) -> list[Reason]:
    """Reasons against a load from position alone; none for another fit."""
    if fit.departure is None or fit.baseline is None:
        return []
    origin = fit.baseline.origin
    name = origin.name if origin and origin.name else "of this fit"
    return [*_another_truck(fit.departure, name), *_poor_fit(fit.departure.misfit), *_expected_error(fit)]


def expected_error(fit: Fit) -> float:
    """Expected error of the load by its band, rms over the recorded stroke in % of the peak; NaN without a band."""
    curve, furthest = fit.load_curve, reach(fit)
    inside = (curve.position >= FROM) & (curve.position <= furthest)
    std = (curve.high - curve.low)[inside] / (2 * QUANTILE)
    peak = float(curve.force[curve.peak(furthest)])
    return 100.0 * float(np.sqrt(np.mean(std**2))) / peak if std.size and peak > 0.0 else float("nan")


def departs(fit: Fit) -> bool:
    """Whether the truck is farther from its calibration, or the recording costs more, than any change explains."""
    found = fit.departure
    return found is not None and (_beyond(found) > ANOTHER or found.misfit > POOR_MISFIT)


def _beyond(departure: Departure) -> float:
    """Distance from the calibration beyond the number of parameters, in standard deviations of chi-square."""
    return (departure.distance - departure.parameters) / float(np.sqrt(2.0 * departure.parameters))


def _another_truck(departure: Departure, name: str) -> list[Reason]:
    """Parameters farther from the calibration than a change explains."""
    distance, count, _ = departure
    beyond = _beyond(departure)
    measure = f"(squared distance {distance:.0f} over {count} parameters)"
    if beyond > ANOTHER:
        text = f"the calibration {name} seems to be of another truck: what may change is farther from it than a change "
        return [Reason(f"{text}explains {measure}; take the calibration of this truck, or make one.", True)]
    if beyond > FAR:
        text = f"what may change is far from the calibration {name} {measure}: "
        return [Reason(f"{text}inputs that are late or a sensor that is off do that; check them.")]
    return []


def _poor_fit(ratio: float) -> list[Reason]:
    """A cost that the calibration recordings did not have."""
    if not ratio > MISFIT:
        return []
    text = f"the recording costs {ratio:.1f} times as much for each second in motion as those of the calibration: the "
    text += "model misses something that has changed, and the load may have errors that its interval does not include."
    return [Reason(text, ratio > POOR_MISFIT)]


def _expected_error(fit: Fit) -> list[Reason]:
    """A band as wide as errors that matter."""
    error = expected_error(fit)
    if error <= GOOD_ERROR:
        return []
    text = f"the expected error of the load is {error:.1f} % of its peak, more than {GOOD_ERROR:g} %: what has changed "
    text += "is not certain enough. Record longer, or give what is known of it with --prior."
    return [Reason(text, error > POOR_ERROR, banded=True)]
