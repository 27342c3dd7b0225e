"""Loads read from recordings at 100 Hz: their interval, and the trust in them."""

import numpy as np
import pytest

import clutchid
from clutchid.estimation.result import QUANTILE
from clutchid.estimation.verification import MISSED, with_slow_logs
from fixtures.changed_logs import thinned

Y = np.linspace(0.5e-3, 15e-3, 40)

pytestmark = pytest.mark.slow


def at_100_hz(log):
    """Each tenth sample of a recording at 1 kHz, as a recorder on the bus keeps it."""
    return thinned(log, 10, first=3)


def half_width(fit):
    """Half width of the 95 % interval of the load at `Y`, in N."""
    return 0.5 * np.interp(Y, fit.load_curve.position, fit.load_curve.high - fit.load_curve.low)


def sides(fit):
    """Distances in N of the ends of the interval of the load from it at its points."""
    curve = fit.load_curve
    return np.array([curve.force - curve.low, curve.high - curve.force])


def test_a_load_from_100_hz_is_read_with_care_and_has_no_narrower_interval_than_from_1_khz(
    calibrated, adapted, worn_log
):
    slow = clutchid.fit(
        at_100_hz(worn_log), calibrated.actuator, request=clutchid.FitRequest(calibration=calibrated.calibration)
    )
    assert np.median(half_width(slow)) >= np.median(half_width(adapted))
    assert slow.verdict.trust == "with care"
    (reason,) = [reason for reason in slow.verdict.reasons if "worn: at 100 Hz" in reason]
    assert "The interval is widened for that" in reason
    assert "record position and duty cycles at 1 kHz." in reason


def test_a_slow_recording_adds_a_share_of_the_load_to_its_interval(adapted, worn_log):
    assert with_slow_logs(adapted, [worn_log]) is adapted
    wide = with_slow_logs(adapted, [worn_log, at_100_hz(worn_log)])
    added = QUANTILE * MISSED * adapted.load_curve.force
    np.testing.assert_allclose(sides(wide) ** 2, sides(adapted) ** 2 + added**2)
    at = [list(wide.parameters).index(name) for name in wide.actuator.load.names]
    before, after = (calibration.covariance[np.ix_(at, at)] for calibration in (adapted, wide))
    theta = np.array(wide.actuator.load.theta)
    assert after - before == pytest.approx(MISSED**2 * np.outer(theta, theta))
    for name, variance in zip(wide.actuator.load.names, np.diag(after), strict=True):
        estimate = wide.parameters[name]
        assert estimate.std == pytest.approx(np.sqrt(variance))
        narrow, wider = adapted.parameters[name], QUANTILE**2 * (variance - adapted.parameters[name].std ** 2)
        for calibration, other in ((estimate.low, narrow.low), (estimate.high, narrow.high)):
            squares = (calibration - estimate.value) ** 2 - (other - narrow.value) ** 2
            assert squares == pytest.approx(wider, rel=1e-6)
    others = [name for name in wide.parameters if name not in wide.actuator.load.names]
    assert [wide.parameters[name] for name in others] == [adapted.parameters[name] for name in others]
