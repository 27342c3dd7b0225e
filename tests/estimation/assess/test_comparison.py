"""A load compared with that of its calibration: differences that are known, and what cannot be compared."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation import LoadCurve
from clutchid.estimation.assess.comparison import SMALLEST_SHARE, comparison
from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.result import QUANTILE
from fixtures.baselines import calibration_like, with_baseline


def test_a_load_a_quarter_above_the_calibrated_one_is_25_percent_at_the_same_position(short_fit):
    compared = comparison(with_baseline(short_fit, share=0.8))
    np.testing.assert_allclose(compared.difference.force, 0.2 * short_fit.load_curve.force, rtol=1e-9, atol=1e-9)
    assert compared.at(6e-3).share == pytest.approx(0.25, rel=1e-9)
    assert compared.at(6e-3).force == pytest.approx(
        0.2 * float(short_fit.actuator.load.force(np.array([6e-3]))[0]), rel=1e-3
    )
    assert compared.shift.position == pytest.approx(0.0, abs=1e-12)
    assert compared.reach == reach(short_fit)


def test_the_interval_of_the_difference_adds_both_variances(short_fit):
    std = 2e4
    compared = comparison(with_baseline(short_fit, std=std))
    own = (short_fit.load_curve.high - short_fit.load_curve.low) / 2
    before = QUANTILE * std * np.sqrt(np.sum(short_fit.actuator.load.phi(short_fit.load_curve.position) ** 2, axis=1))
    half = (compared.difference.high - compared.difference.low) / 2
    np.testing.assert_allclose(half, np.sqrt(own**2 + before**2), rtol=1e-9, atol=1e-6)
    change = compared.at(6e-3)
    assert change.low < change.force < change.high


def test_a_load_that_moved_by_half_a_millimetre_has_this_shift_with_the_interval_of_both(short_fit):
    baseline = with_baseline(short_fit, share=1.0, std=1e4)
    before = comparison(baseline).calibrated
    force = np.interp(before.position - 0.5e-3, before.position, before.force, left=0.0)
    moved = comparison(replace(baseline, load_curve=LoadCurve(before.position, force, force - 50.0, force + 50.0)))
    # the two curves are interpolated between points 0.25 mm apart
    assert moved.shift.position == pytest.approx(0.5e-3, abs=2e-5)
    now, old = moved.half_now, moved.half_before
    assert moved.shift.high - moved.shift.position == pytest.approx(
        np.hypot(now.high - now.position, old.position - old.low), rel=1e-9
    )
    assert moved.shift.position - moved.shift.low == pytest.approx(
        np.hypot(now.position - now.low, old.high - old.position), rel=1e-9
    )


def test_no_share_is_given_where_the_calibrated_load_is_next_to_nothing(short_fit):
    compared = comparison(with_baseline(short_fit))
    small = compared.calibrated.force <= SMALLEST_SHARE * compared.calibrated.force.max()
    assert small[0]
    np.testing.assert_array_equal(np.isnan(compared.difference.share), small)


@pytest.mark.parametrize("share", [0.0, -1.0])
def test_a_calibrated_load_that_is_nowhere_above_0_has_differences_and_no_share(short_fit, share):
    compared = comparison(with_baseline(short_fit, share=share))
    np.testing.assert_allclose(compared.difference.force, (1.0 - share) * short_fit.load_curve.force, atol=1e-9)
    assert np.isnan(compared.difference.share[compared.calibrated.force <= 0.0]).all()
    assert np.isnan(compared.shift.position)


@pytest.mark.parametrize("without", [np.inf, np.nan])
def test_an_interval_without_an_end_makes_that_of_the_difference_one_too(short_fit, without):
    nowhere = np.full(101, without)
    curve = short_fit.load_curve
    lost = replace(with_baseline(short_fit), load_curve=LoadCurve(curve.position, curve.force, -nowhere, nowhere))
    change = comparison(lost).at(6e-3)
    assert np.isfinite(change.force)
    assert not np.isfinite(change.low)
    assert not np.isfinite(change.high)
    assert not np.isfinite(comparison(lost).shift.high)


def test_a_weight_of_the_calibration_that_is_unknown_has_an_infinite_interval(short_fit):
    covariance = np.diag([1e8, 1e8, np.inf])
    compared = comparison(with_baseline(short_fit, theta_covariance=covariance))
    assert np.isfinite(compared.difference.force).all()
    acts = short_fit.actuator.load.phi(compared.calibrated.position)[:, 2] != 0.0
    assert acts.any()
    assert np.isinf(compared.difference.high[acts]).all()


def test_a_recording_that_stays_below_5_mm_is_compared_up_to_there(short_fit):
    (recording,) = short_fit.recordings.values()
    low = recording.measured.with_columns(position=0.25 * recording.measured["position"])
    compared = comparison(replace(with_baseline(short_fit), recordings={"low": replace(recording, measured=low)}))
    assert compared.reach < 5e-3
    assert not compared.half_now.position > compared.reach


def test_nothing_is_compared_without_a_calibration_or_its_load_or_a_fitted_load(short_fit):
    baseline = with_baseline(short_fit)
    assert comparison(baseline) is not None
    assert comparison(short_fit) is None
    assert comparison(replace(baseline, status="failed")) is None
    assert comparison(replace(baseline, parameters={})) is None
    older = calibration_like(short_fit, theta=(), theta_covariance=np.zeros((0, 0)))
    assert comparison(replace(short_fit, baseline=older)) is None
    splines = replace(baseline.baseline, theta=(1.0,) * 9, theta_covariance=np.eye(9))
    assert comparison(replace(short_fit, baseline=splines)) is None
