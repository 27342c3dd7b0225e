"""The calibration of another truck of the type: recognised by what a change of this one does not move."""

from dataclasses import replace

import pytest

from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.request import FitRequest
from clutchid.estimation.shooting import SHOOTING
from clutchid.inference.uncertainty.calibration import Origin

#: What differs, moderately, between two trucks of a type, and more than a change of one of them moves it.
DIFFERENCES = {
    "C_vs": 1.2, "C_ve": 0.8, "R_0vs": 1.6, "R_0ve": 0.3, "R_1vs": 0.92, "R_1ve": 1.07, "F_C": 1.8, "C_r": 1.15,
    "tau_y": 1.8,
}  # fmt: skip


@pytest.fixture(scope="module")
def reading(worn, recorded_by, calibrated):
    another = worn.replace({name: share * worn.value(name) for name, share in DIFFERENCES.items()})
    log = recorded_by(another, seconds=4.0, seed=5, name="other", driven=1).without("pressure_a")
    calibration = replace(calibrated.calibration, origin=Origin("CAL.toml"))
    return fit_with(SHOOTING, [log], calibrated.actuator, FitRequest(("position",), ("load",), calibration=calibration))


@pytest.mark.slow
def test_the_calibration_of_another_truck_is_said_to_be_one(reading):
    judged = verdict(reading)
    assert judged.trust == "none"
    assert judged.reasons[0].startswith(
        "the calibration CAL.toml seems to be of another truck: no usual change explains "
    )
    assert "Coulomb friction, F_C (" in judged.reasons[0]


@pytest.mark.slow
def test_a_change_of_the_same_truck_is_nearer_than_what_is_expected(adapted):
    assert 0.0 < adapted.departure.distance < adapted.departure.expected < 24
    assert not [reason for reason in verdict(adapted).reasons if "another truck" in reason or "far from" in reason]
