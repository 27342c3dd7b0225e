"""A measured pressure that was not fitted, as a test of a reading."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from clutchid.estimation.assess.evidence import Reason, as_recorded
from clutchid.estimation.result import Fit, Recording
from clutchid.inference.uncertainty.conditions import ACCURACY
from clutchid.log import FloatArray, sample_interval
from clutchid.numerics.interval import QUANTILE
from clutchid.numerics.whiteness import block_means
from clutchid.strokes.vented_pressure import OFFSET_PRIOR, SIGNIFICANT

#: Time in s over which the difference is averaged, longer than the noise of a sensor is correlated.
_AVERAGED = 0.02

#: Standard deviation of the gain of a pressure sensor: that of the supply's sensor at 10 bar.
_GAIN = ACCURACY["P_S"] / 1e6


class PressureTest(NamedTuple):
    """Measured pressure less that of a result, rms in Pa, and what of it is expected.

    Attributes
    ----------
    rms
        Of the difference.
    sensor
        Standard deviation that an offset and a gain of the sensor leave.
    allowed
        The same with that of the load, by its band.
    """

    rms: float
    sensor: float
    allowed: float

    @property
    def deviates(self) -> bool:
        """Whether the difference is larger than a sensor explains."""
        return self.rms > SIGNIFICANT * self.sensor

    @property
    def contradicts(self) -> bool:
        """Whether it is larger than the sensor and the band of the load explain together."""
        return self.deviates and self.rms > QUANTILE * self.allowed


def pressure_test(
    measured: FloatArray, estimated: FloatArray, load_std: FloatArray, interval: float
) -> PressureTest | None:
    """Compare pressures (n,) in Pa, `interval` s apart, with the standard deviation (n,) in Pa that the load leaves.

    None where nothing can be compared.
    """
    block = max(1, round(_AVERAGED / interval))
    difference, pressure, std = (block_means(values, block) for values in (measured - estimated, measured, load_std))
    compared = np.isfinite(difference) & np.isfinite(std)
    if not compared.any():
        return None
    sensor = OFFSET_PRIOR.std**2 + (_GAIN * pressure[compared]) ** 2

    def root_mean(squares: FloatArray) -> float:
        return float(np.sqrt(np.mean(squares)))

    return PressureTest(root_mean(difference[compared] ** 2), root_mean(sensor), root_mean(sensor + std[compared] ** 2))


def pressure_tests(fit: Fit) -> dict[str, PressureTest]:
    """The test of each recording of a reading that has a pressure, by its name."""
    if fit.departure is None or "pressure_a" in fit.scales:
        return {}
    tests = {name: _of_recording(fit, name, recording) for name, recording in fit.recordings.items()}
    return {name: test for name, test in tests.items() if test is not None}


def _of_recording(fit: Fit, name: str, recording: Recording) -> PressureTest | None:
    log, curve = recording.measured, fit.load_curve
    if "pressure_a" not in log or "position" not in log:
        return None
    std = (curve.high - curve.low) / (2.0 * QUANTILE * fit.actuator.parameters.A_A)
    of_load = np.interp(log["position"], curve.position, std)
    estimated = as_recorded(fit, name, recording.simulated)["pressure_a"]
    return pressure_test(log["pressure_a"], estimated, of_load, sample_interval(log.time))


def pressure_reasons(fit: Fit) -> Iterator[Reason]:
    """Pressures that contradict a reading by more than their sensors explain."""
    for name, test in pressure_tests(fit).items():
        if test.deviates:
            reason = pressure_reason(test)
            yield reason._replace(text=f"{name}: {reason.text}")


def pressure_reason(test: PressureTest) -> Reason:
    """That the pressure of a recording deviates, and whether the band of the load explains it."""
    text = f"{difference_in_words(test)}, more than its sensor"
    if test.contradicts:
        text += (
            " and the band of the load allow: the calibration, the inputs or the sensor are wrong; check them, or "
            "calibrate with "
        )
        return Reason(f"{text}this recording.", True)
    return Reason(
        f"{text} explains: the load has an error of this size, which its band includes; calibrate with this recording."
    )


def pressure_notes(fit: Fit) -> list[str]:
    """The size of the test of each recording that supports the reading."""
    return [
        f"{name}: {difference_in_words(test)}, which the error of its sensor explains."
        for name, test in pressure_tests(fit).items()
        if not test.deviates
    ]


def difference_in_words(test: PressureTest) -> str:
    """Size of a test, as a clause."""
    size = f"{test.rms * 1e-3:.1f} kPa rms"
    return f"the measured pressure_a, which is not fitted, differs from the estimated pressure by {size}"
