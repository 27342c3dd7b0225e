"""Reasons against a load from position alone: another truck's calibration, a poor fit, and a wide band."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from clutchid import fit
from clutchid.estimation import LoadCurve
from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.assess.reasons import (
    GOOD_ERROR,
    POOR_ERROR,
    departure_reasons,
    expected_error,
    reading_reasons,
    slow_reasons,
)
from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.result import Change, Departure, InputFault, Moved
from clutchid.inference.uncertainty.conditions import Assumption
from fixtures.baselines import ORIGIN, with_baseline

NEAR = Departure(distance=5.0, expected=15.1, misfit=1.0, moved=(Moved("F_C", 109.0, 185.0), Moved("R_1ve", 0.93, 0.9)))


@pytest.fixture(scope="module")
def reading(drive, with_noise):
    """A fit that passes for a reading with a calibration whose recordings it resembles."""
    result = fit(with_noise(drive, 1).slice(0, 4000), measure=("position", "pressure_a"))
    return replace(with_baseline(result, origin=ORIGIN, converged=True), departure=NEAR)


def with_error(result, percent):
    """`result` with a band of the same standard deviation everywhere, in % of the peak."""
    curve = result.load_curve
    half = 1.96 * percent / 100 * curve.force[curve.peak(reach(result))]
    return replace(result, load_curve=LoadCurve(curve.position, curve.force, curve.force - half, curve.force + half))


def test_a_reading_near_its_calibration_is_good(reading):
    assert [*reading_reasons(reading)] == []
    assert verdict(reading).trust == "good"


def test_another_fit_has_no_reason_of_a_reading(reading):
    assert [*reading_reasons(replace(with_error(reading, 9.0), departure=None))] == []


# truck 3 of ../shared/data/trucks has 32 with the calibration of truck 2; chi-square(15.1) is below 22.4 in 90 % of all
# draws, below 30.7 in 99 %
@pytest.mark.parametrize(("distance", "trust"), [(22.0, "good"), (23.0, "with care"), (32.4, "none")])
def test_parameters_far_from_the_calibration_are_those_of_another_truck(reading, distance, trust):
    judged = verdict(replace(reading, departure=NEAR._replace(distance=distance)))
    assert judged.trust == trust
    if trust == "none":
        assert judged.reasons[0] == (
            "the calibration CAL.toml seems to be of another truck: no usual change explains the values of Coulomb "
            "friction, F_C (185 instead of 109 N) and duty cycle where the exhaust valve is fully open, R_1ve (0.9 "
            "instead of 0.93), whose squared distance from the calibration is 32 (usually about 15); use the "
            "calibration of this truck, or make one."
        )


def test_where_the_data_determine_no_change_there_is_no_other_truck(reading):
    assert verdict(replace(reading, departure=Departure(0.0, 0.0, 1.0))).trust == "good"


@pytest.mark.parametrize(("leak", "trust"), [(2e-10, "good"), (4e-10, "with care"), (5.3e-10, "none")])
def test_the_load_of_an_actuator_that_leaks_much_is_not_good(reading, leak, trust):
    change = Change("drive", "C_A0", 0.0, leak, 4e-12, "m³/(Pa·s)", 1.0, "leak")
    judged = verdict(replace(reading, changes=(change,)))
    assert judged.trust == trust
    assert [f"leak {what}" in reason for reason in judged.reasons for what in ("so much", "too much")] == {
        "good": [], "with care": [True, False], "none": [False, True],
    }[trust]  # fmt: skip


@pytest.mark.parametrize(
    ("probability", "ratio", "assumed", "said"),
    [
        (0.9, 0.6, "P_S", "record the supply pressure."),
        (0.9, 2.0, "T_0", "calibrate near this temperature."),
        (0.9, 0.8, "P_S", ""),
        (0.3, 2.0, "P_S", ""),
    ],
)
def test_grease_of_another_temperature_is_read_with_care(reading, probability, ratio, assumed, said):
    change = Change("drive", "D_v", 400.0, 400.0 * ratio, 20.0, "N·s/m", probability, "temperature and grease")
    assumption = Assumption(assumed, ("drive",), 9e5, 5e4, False)
    judged = verdict(replace(reading, changes=(change,), assumed=(assumption,)))
    assert judged.trust == ("with care" if said else "good")
    assert [said in reason for reason in judged.reasons] == [True] * bool(said)


@pytest.mark.parametrize(("ratio", "trust"), [(1.4, "good"), (1.6, "with care"), (3.0, "none"), (np.nan, "good")])
def test_a_cost_that_the_calibration_did_not_have_is_a_reason(reading, ratio, trust):
    judged = verdict(replace(reading, departure=NEAR._replace(misfit=ratio)))
    assert judged.trust == trust
    said = f"squared residuals in motion {ratio:.1f} times as large"
    assert [said in reason for reason in judged.reasons] == [True] * (trust != "good")


@pytest.mark.parametrize(
    ("percent", "trust"),
    [(0.9 * GOOD_ERROR, "good"), (1.1 * GOOD_ERROR, "with care"), (1.1 * POOR_ERROR, "none")],
)
def test_the_expected_error_is_that_of_the_band(reading, percent, trust):
    wide = with_error(reading, percent)
    assert expected_error(wide) == pytest.approx(percent, rel=1e-3)
    assert verdict(wide).trust == trust


@pytest.mark.parametrize(
    ("probability", "innovations", "said"),
    [(0.95, 4.9, False), (0.95, 5.1, True), (0.95, None, True), (0.995, 1.0, True), (0.8, 9.0, False)],
)
def test_a_far_recording_is_accused_where_no_observer_follows_it(reading, probability, innovations, said):
    distance = float(chi2.ppf(probability, NEAR.expected))
    causes = () if innovations is None else (InputFault("as recorded", "", "", 0.0, innovations, 0.0),)
    far = replace(reading, departure=NEAR._replace(distance=distance), causes=causes)
    assert any(True for _ in departure_reasons(far)) == said


def test_a_bound_does_not_lower_the_trust_in_a_reading(reading):
    name = "theta_1"
    at_bound = replace(reading, bounds={**reading.bounds, name: (0.0, reading.parameters[name].value)})
    assert verdict(at_bound).trust == "good"
    assert verdict(replace(at_bound, departure=None)).trust == "with care"


def test_a_load_that_is_only_uncertain_is_not_flawed(reading):
    uncertain = verdict(with_error(reading, 6.0))
    assert (uncertain.trust, uncertain.flawed) == ("none", False)
    for departure in (NEAR._replace(distance=60.0), NEAR._replace(misfit=3.0)):
        assert verdict(replace(with_error(reading, 6.0), departure=departure)).flawed
    poor = replace(reading, baseline=replace(reading.baseline, origin=ORIGIN._replace(trust="none")))
    assert verdict(poor).flawed
    assert not verdict(reading).flawed


@pytest.fixture(scope="module")
def slow(reading):
    """The same fit as a load from position alone of a recording with a sample every 10 ms."""
    (name, recording), *_ = reading.recordings.items()
    measured, simulated = (replace(log, time=10.0 * log.time) for log in (recording.measured, recording.simulated))
    scales = {"position": reading.scales["position"]}
    return replace(
        reading, recordings={name: replace(recording, measured=measured, simulated=simulated)}, scales=scales
    )


def test_a_slow_recording_is_read_with_care(slow):
    judged = verdict(slow)
    assert (judged.trust, judged.flawed) == ("with care", False)
    assert judged.reasons == (
        "drive: at 100 Hz the valves open and close between the samples, at times that are not recorded. The interval "
        "is widened for that, but by what it costs on virtual trucks only; record position and duty cycles at 1 kHz.",
    )


def test_only_a_load_from_position_alone_has_an_interval_for_slow_recordings(slow):
    for other in (replace(slow, baseline=None), replace(slow, scales={**slow.scales, "pressure_a": 1e3})):
        (reason,) = slow_reasons(other)
        assert "errors that its interval does not include; record position" in reason.text
