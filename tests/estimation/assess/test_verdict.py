"""The verdict: each reason against a result that was made to have it, and none where all is well."""

import json
from dataclasses import replace

import numpy as np
import pytest

from clutchid import fit
from clutchid.documents.fit_json import verdict_json
from clutchid.estimation import Estimate, LoadCurve
from clutchid.estimation.assess.evidence import actuator_of, as_recorded, evidence, predicted_fit, reach
from clutchid.estimation.assess.reasons import ambient_reasons
from clutchid.estimation.assess.verdict import verdict
from clutchid.inference.uncertainty.calibration import Calibration, Origin
from clutchid.log import Log
from clutchid.numerics.interval import QUANTILE
from clutchid.simulation.sensors import lagged
from clutchid.strokes.vented_pressure import VENTED_KEY
from fixtures.baselines import ORIGIN, with_baseline


@pytest.fixture(scope="module")
def fitted(drive, with_noise):
    """A fit of 4 s by the model that made them."""
    noisy = with_noise(drive, 1).slice(0, 4000)
    return fit(noisy, measure=("position", "pressure_a"))


def reasons(result):
    return " ".join(verdict(result).reasons)


def shifted(result, column, by):
    """`result` whose measured column lies above the simulation by `by`."""
    name, recording = next(iter(result.recordings.items()))
    measured = recording.measured.with_columns(**{column: recording.simulated[column] + by})
    return replace(result, recordings={name: replace(recording, measured=measured)})


def also_free(result, name, estimate):
    """`result` with one more free parameter."""
    covariance = np.diag([*np.diag(result.covariance), estimate.std**2])
    return replace(result, parameters={**result.parameters, name: estimate}, covariance=covariance)


def test_a_fit_by_the_true_model_is_good(fitted):
    assert fitted.verdict is verdict(fitted)
    assert verdict(fitted).trust == "good"
    assert verdict(fitted).reasons == ()


def test_a_failed_fit_is_not_to_be_trusted(fitted):
    failed = replace(fitted, status="failed", message="no step is finite", recordings={})
    assert verdict(failed).trust == "none"
    assert verdict(failed).reasons == ("the fit failed: no step is finite.",)
    assert verdict_json(failed)["diagnostics"] == {}


def test_a_search_that_did_not_converge_is_a_reason(fitted):
    assert fitted.converged
    judged = replace(fitted, converged=False)
    assert verdict(judged).trust == "with care"
    assert "did not converge" in reasons(judged)


@pytest.mark.parametrize(
    ("origin", "converged", "trust", "said"),
    [
        (ORIGIN, True, "good", ""),
        (None, True, "good", ""),
        (Origin(), False, "with care", "the search of the calibration of this fit had not converged"),
        (None, False, "with care", "the search of the calibration of this fit had not converged"),
        (ORIGIN, False, "with care", "the search of the calibration CAL.toml had not converged"),
        (ORIGIN._replace(trust="with care"), True, "good", ""),
        (ORIGIN._replace(trust="none"), True, "none", "the calibration CAL.toml has trust 'none'; calibrate again"),
        (ORIGIN._replace(trust="none"), False, "none", "the calibration CAL.toml has trust 'none'; calibrate again"),
    ],
)
def test_a_reading_is_no_better_than_its_calibration(fitted, origin, converged, trust, said):
    judged = verdict(with_baseline(fitted, origin=origin, converged=converged))
    assert judged.trust == trust
    assert [reason.startswith(said) for reason in judged.reasons[:1]] == [True] * bool(said)
    assert any("had not converged" in reason for reason in judged.reasons) is not converged


def test_a_reading_with_a_calibration_that_saw_no_settled_rest_is_not_good(fitted):
    judged = verdict(with_baseline(fitted, vented=False))
    assert judged.trust == "with care"
    assert judged.reasons[0].startswith("the recordings of the calibration CAL.toml show no settled vented rest")


def test_an_ambient_pressure_that_no_recording_shows_is_a_reason(fitted):
    """The drive starts at rest; with a supply valve that never shuts nothing shows the vented pressure."""
    free = also_free(fitted, "P_0", Estimate(1.1e5, "Pa", 4e3, 1.02e5, 1.18e5))
    assert verdict(free).trust == "good"
    measured = fitted.recordings["drive"].measured
    moving = measured.with_columns(duty_supply=np.maximum(measured["duty_supply"], 0.1))
    unsettled = replace(free, recordings={"drive": replace(free.recordings["drive"], measured=moving)})
    (reason,) = ambient_reasons(unsettled)
    peak = float(fitted.load_curve.force.max())
    assert f"P_0, is known only to ± 7.8 kPa, ± {100 * 7.84e3 * 12.3e-3 / peak:.1f} % of the peak; " in reason.text
    assert reason.text.endswith(", or give --ambient.")
    stated = replace(moving, metadata={**moving.metadata, VENTED_KEY: "95e3"})
    recorded = {"drive": replace(free.recordings["drive"], measured=stated)}
    (advice,) = ambient_reasons(replace(free, recordings=recorded))
    assert advice.text.endswith("exhaust valve open."), "who gave --ambient is not told to"
    assert [*ambient_reasons(replace(unsettled, scales={"position": 1e-4}))] == [], "pressure is not in use"
    assert [*ambient_reasons(replace(fitted, recordings=unsettled.recordings))] == [], "P_0 is not estimated"
    own = also_free(free, "P_0@other", Estimate(1.1e5, "Pa", 4e3, 1.02e5, 1.18e5))
    other = {**free.recordings, "other": unsettled.recordings["drive"]}
    (reason,) = ambient_reasons(replace(own, recordings=other))
    assert reason.text.startswith("other: ")


def test_a_bound_that_is_hit_is_a_reason_and_an_infinite_one_is_none(fitted):
    value = fitted.parameters["theta_1"].value
    at_bound = replace(fitted, bounds={**fitted.bounds, "theta_1": (0.0, value)})
    assert "theta_1 (upper) lies at its bound" in reasons(at_bound)
    free = replace(fitted, bounds=dict.fromkeys(fitted.bounds, (-np.inf, np.inf)))
    assert verdict(free).trust == "good"


def test_a_covariance_at_its_rounding_is_a_reason(fitted):
    std = np.array([1e4, 1e4, 1e4])
    singular = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) * np.outer(std, std)
    lost = replace(fitted, covariance=singular)
    assert "numerically singular in the direction of theta_1 and theta_2" in reasons(lost)
    assert verdict(lost).trust == "none"  # load weights among them


def test_a_standard_error_as_large_as_the_value_is_a_reason(fitted):
    wide = also_free(fitted, "P_S", Estimate(9e5, "Pa", 1e6, -1e6, 2.8e6))
    assert "the standard error of P_S is as large" in reasons(wide)


def test_a_motion_that_another_actuator_made_is_a_reason(fitted):
    # twice the load over the whole stroke: the piston does not get there
    other = fitted.actuator.replace({name: 2 * fitted.actuator.value(name) for name in fitted.actuator.load.names})
    assert "part of the motion" in reasons(replace(fitted, actuator=other))


def test_a_residual_that_follows_a_valve_and_is_more_than_the_band_is_a_reason(fitted):
    duty = fitted.recordings["drive"].measured["duty_supply"]
    slow = np.convolve(duty, np.ones(20) / 20)[: duty.size]
    width = float(np.median(fitted.load_curve.high - fitted.load_curve.low))
    area = fitted.actuator.parameters.A_A
    rms = float(np.sqrt(np.mean(slow**2)))
    assert "the residual of pressure_a is autocorrelated" in reasons(
        shifted(fitted, "pressure_a", slow * 3 * width / area / rms)
    )
    assert "pressure_a" not in reasons(shifted(fitted, "pressure_a", slow * 0.3 * width / area / rms))
    # a load that was not freed has no interval that could be too narrow
    own = {"C_vs": Estimate(1.9e-8, "m³/(Pa·s)", 1e-11, 1.89e-8, 1.91e-8)}
    fixed = replace(fitted, parameters=own, covariance=np.array([[1e-22]]))
    assert "interval" not in reasons(shifted(fixed, "pressure_a", slow * 3 * width / area / rms))


@pytest.mark.parametrize("factor", [0.3, 3.0])
def test_a_residual_is_compared_with_the_band_of_a_calibration_by_its_data_alone(fitted, factor):
    duty = fitted.recordings["drive"].measured["duty_supply"]
    slow = np.convolve(duty, np.ones(20) / 20)[: duty.size]
    width = float(np.median(fitted.load_curve.high - fitted.load_curve.low))
    size = factor * width / fitted.actuator.parameters.A_A / float(np.sqrt(np.mean(slow**2)))
    alone = shifted(fitted, "pressure_a", slow * size)
    calibration = Calibration((), np.zeros((0, 0)), missed=5.0 * width)
    wide = replace(alone, calibration=calibration, load_curve=alone.load_curve.widened(QUANTILE * calibration.missed))
    by_data, plain = reasons(wide), reasons(alone)
    assert ("residual of pressure_a" in by_data) == ("residual of pressure_a" in plain) == (factor > 1.0)
    if factor > 1.0:
        assert f"more than the width of the interval by the data alone, {width:.0f} N: the model errs there" in by_data
        assert f"more than the width of the interval, {width:.0f} N: the interval is too narrow" in plain


def test_a_band_broader_than_a_tenth_of_the_peak_is_a_reason(fitted):
    curve = fitted.load_curve
    for part, trust in ((0.05, "good"), (0.2, "with care"), (2.0, "none")):
        half = part * curve.force[curve.position <= reach(fitted)].max()
        broad = LoadCurve(curve.position, curve.force, curve.force - half, curve.force + half)
        assert verdict(replace(fitted, load_curve=broad)).trust == trust


def test_a_band_that_is_not_there_takes_the_trust(fitted):
    curve, infinite = fitted.load_curve, np.full(101, np.inf)
    lost = replace(fitted, load_curve=LoadCurve(curve.position, curve.force, -infinite, infinite))
    assert verdict(lost).trust == "none"
    assert "do not determine the load" in reasons(lost)


def test_a_band_without_an_end_inside_the_reach_is_a_reason_and_its_load_no_peak(fitted):
    curve = fitted.load_curve
    at = int(np.flatnonzero(curve.position <= reach(fitted))[-1])
    force, high = curve.force.copy(), curve.high.copy()
    force[at], high[at] = 10.0 * force.max(), np.inf
    lost = replace(fitted, load_curve=LoadCurve(curve.position, force, curve.low, high))
    assert verdict(lost).trust == "with care"
    assert "infinite in part" in reasons(lost)
    assert lost.load_curve.peak(reach(fitted)) == curve.peak(curve.position[at - 1])
    assert curve.peak(-1.0) == 0


def test_parameters_that_only_combinations_determine_are_a_reason(fitted):
    weights = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
    std = np.sqrt(np.diag(fitted.covariance))
    # one direction of the three is a million times less known than the others
    mixed = (np.eye(3) + 1e8 * np.outer(weights, weights)) * np.outer(std, std) * 1e-8
    assert "of 3 parameters, theta_1 to theta_3, only combinations" in reasons(replace(fitted, covariance=mixed))
    assert reasons(replace(fitted, covariance=mixed, method="shooting")) == ""


def test_a_recording_that_does_not_reach_the_engaging_clutch_is_a_reason(fitted):
    (recording,) = fitted.recordings.values()
    # the position in other units: what is asked is only how far it went
    for part, grave in ((0.4, False), (0.2, True)):
        low = recording.measured.with_columns(position=part * recording.measured["position"])
        judged = verdict(replace(fitted, recordings={"drive": replace(recording, measured=low)}))
        assert any("so the load there is not determined" in reason for reason in judged.reasons)
        assert not grave or judged.trust == "none"


@pytest.mark.parametrize(
    ("method", "said"),
    [
        ("shooting", "in multiple shooting the position"),
        ("prediction-error", "in a fit by prediction error the position"),
    ],
)
def test_where_the_position_follows_it_cannot_judge_and_the_verdict_says_so(fitted, method, said):
    shot = replace(fitted, method=method)
    (sentence,) = verdict(shot).unseen
    assert sentence.startswith(said)
    assert "follows the measurement" in sentence
    assert "the measured pressure and the position" in sentence
    assert verdict(fitted).unseen == ()


def test_the_simulation_over_a_second_is_exact_where_the_model_is_the_truth(fitted, truth):
    exact = replace(fitted, actuator=truth)
    # what is left is noise of 0.05 mm on a motion of some 5 mm rms, once as it is and once at each start
    assert 97.0 < predicted_fit(exact, "drive") < 100.0


def test_numbers_of_one_recording_belong_to_it_alone(fitted):
    several = also_free(fitted, "P_S@drive", Estimate(8e5, "Pa", 1.0, 8e5, 8e5))
    assert actuator_of(several, "drive").parameters.P_S == 8e5
    assert actuator_of(several, "other").parameters.P_S == 9e5


def test_what_the_sensors_record_lags_and_is_offset(fitted):
    simulated = fitted.recordings["drive"].simulated
    shot = replace(fitted, method="shooting", actuator=fitted.actuator.replace({"tau_y": 2e-3, "e_y": 1e-4}))
    recorded = as_recorded(shot, "drive", simulated)
    np.testing.assert_allclose(recorded["position"], lagged(simulated["position"], 2e-3, 1e-3) + 1e-4, atol=1e-15)
    assert as_recorded(fitted, "drive", simulated) is simulated


def test_the_verdict_as_json_has_plain_values_only(fitted):
    text = json.dumps(verdict_json(fitted), allow_nan=False)
    document = json.loads(text)
    assert document["trust"] == "good"
    assert set(document) >= {"trust", "reasons", "diagnostics", "missing"}
    assert document["diagnostics"]["drive"]["position"]["fit_percent"] > 97.0
    assert document["diagnostics"]["drive"]["pressure_a"]["rms"] == pytest.approx(2e3, rel=0.1)


def test_a_recording_without_a_moment_to_compare_is_left_out(fitted):
    (recording,) = fitted.recordings.values()
    blank = Log(
        recording.measured.time,
        {**recording.measured.columns, "position": np.full(len(recording.measured), np.nan)},
        "blank",
    )
    both = replace(fitted, recordings={**fitted.recordings, "blank": replace(recording, measured=blank)})
    assert set(evidence(both).diagnoses) == {"drive"}


@pytest.mark.parametrize(("value", "held"), [(0.0, True), (5e-10, False)])
def test_an_estimate_lies_at_the_bound_0_where_it_is_0_and_not_where_it_is_small(fitted, value, held):
    # 5e-10 m³/(Pa·s) is a fortieth of the supply valve, and small beside numbers that are not conductances
    freed = also_free(fitted, "C_vs", Estimate(value, "m³/(Pa·s)", 1e-10, value - 2e-10, value + 2e-10))
    sentences = reasons(replace(freed, bounds={**fitted.bounds, "C_vs": (0.0, 57e-9)}))
    assert ("C_vs (lower) lies at its bound" in sentences) == held


@pytest.mark.parametrize(("share", "held"), [(1e-10, True), (1e-8, False)])
def test_an_estimate_lies_at_a_bound_to_a_billionth_of_it(fitted, share, held):
    value = fitted.parameters["theta_1"].value
    near = replace(fitted, bounds={**fitted.bounds, "theta_1": (0.0, (1.0 + share) * value)})
    assert ("theta_1 (upper) lies at its bound" in reasons(near)) == held
