"""Why a vented rest has moved, what is subtracted, and how it is said: a reading with an offset is that without."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid import parameter_file, read_parameters, write_parameters
from clutchid.documents import document_of
from clutchid.documents.fit_json import fit_json
from clutchid.estimation.assess.rest import Stop, moved_rests, rest_cause
from clutchid.estimation.fit import fit_request
from clutchid.estimation.request import FitRequest
from clutchid.preparation.inspection import inspect
from clutchid.strokes.vented_rest import RestShift, merged_levels, vented_rest

UP, DOWN = RestShift(3e-4, 2.8e-4, 3.2e-4), RestShift(-3e-4, -3.2e-4, -2.8e-4)


@pytest.mark.parametrize(
    ("shift", "stop", "less_worn", "cause"),
    [
        (UP, None, False, "sensor"),
        (UP, None, True, "unknown"),  # or a clutch that is newer than the calibrated one
        (DOWN, None, False, "unknown"),
        (DOWN, Stop(3e-4, 2e-5), False, "wear"),
        (DOWN, Stop(0.0, 2e-5), False, "sensor"),
        (DOWN, Stop(0.0, 5e-4), False, "unknown"),  # the stop was not reached
        (DOWN, Stop(1.5e-4, 2e-5), False, "unknown"),  # some of both
        (UP, Stop(-3e-4, 2e-5), False, "unknown"),  # a clutch cannot wear backwards
    ],
)
def test_the_far_stop_then_the_sign_decide(shift, stop, less_worn, cause):
    assert rest_cause(shift, stop, less_worn=less_worn) in ((cause, "sensor") if shift is UP and stop else (cause,))


@pytest.fixture(scope="module")
def readings(calibrated, worn_log):
    """The worn recording as it is, and with an offset that is subtracted, or kept."""
    calibration = replace(calibrated.calibration, rest=vented_rest(worn_log))
    offset = worn_log.with_columns(position=worn_log["position"] + 3e-4)
    asked = {"as it is": (worn_log, "subtract"), "subtracted": (offset, "subtract"), "kept": (offset, "keep")}
    return {
        name: fit_request([log], calibrated.actuator, FitRequest(calibration=calibration, zero=zero))
        for name, (log, zero) in asked.items()
    }


@pytest.mark.slow
def test_a_calibration_keeps_the_rest_of_its_recordings(calibrated, drive_log, tmp_path):
    rest = calibrated.calibration.rest
    assert rest == pytest.approx(merged_levels([vented_rest(drive_log)]), nan_ok=True)
    write_parameters(parameter_file(calibrated), tmp_path / "cal.toml")
    assert read_parameters(tmp_path / "cal.toml").calibration.rest == pytest.approx(rest, nan_ok=True)


@pytest.mark.slow
def test_a_moved_zero_is_subtracted_and_the_load_is_that_without_it(readings):
    plain, subtracted, unshifted = readings.values()
    at = (plain.load_curve.position >= 5e-3) & (plain.load_curve.position <= 8e-3)
    peak = plain.load_curve.force[at].max()
    assert np.abs(subtracted.load_curve.force - plain.load_curve.force)[at].max() < 1e-3 * peak
    assert np.abs(unshifted.load_curve.force - plain.load_curve.force)[at].max() > 1e-2 * peak
    assert moved_rests(plain) == ()
    (moved,) = moved_rests(subtracted)
    assert moved.cause == "sensor"
    assert moved.subtracted == moved.shift.value == pytest.approx(3e-4, abs=5e-6)


@pytest.mark.slow
def test_a_moved_rest_is_said_wherever_the_result_is(readings):
    moved = readings["subtracted"]
    since = next(row.text for row in document_of(moved).rows if row.label == "since")
    assert "the vented rest has moved by +0.30 mm" in since
    assert "the position sensor" in since
    document = fit_json(moved)
    assert document["rest_shift_m"] == document["logs"]["worn"]["rest_shift_m"]
    assert document["rest_shift_m"]["cause"] == "sensor"
    assert document["rest_shift_m"]["low"] < 3e-4 < document["rest_shift_m"]["high"]
    assert any("vented rest" in note for note in document["notes"])
    assert fit_json(readings["as it is"])["rest_shift_m"]["cause"] is None


@pytest.mark.slow
def test_a_moved_rest_that_is_kept_lowers_the_trust(readings):
    assert readings["kept"].verdict.trust != "good"
    assert any("--zero keep" in reason for reason in readings["kept"].verdict.reasons)
    assert not any("vented rest" in reason for reason in readings["subtracted"].verdict.reasons)


@pytest.mark.slow
def test_what_was_subtracted_is_saved_and_subtracted_again_from_the_same_file(readings, tmp_path):
    moved = readings["subtracted"]
    measured = moved.recordings["worn"].measured
    write_parameters(parameter_file(moved), tmp_path / "worn.toml")
    content = read_parameters(tmp_path / "worn.toml")
    assert content.own["worn"]["rest_shift"] == moved.recordings["worn"].subtracted
    recorded = measured.with_columns(position=measured["position"] + moved.recordings["worn"].subtracted)
    again = content.from_rest(replace(recorded, metadata={"sha256": "unknown"}))
    assert again.log["position"] == pytest.approx(measured["position"], abs=1e-12)
    assert content.from_rest(recorded).subtracted == pytest.approx(3e-4, abs=5e-6), "another file is compared"


@pytest.mark.slow
def test_a_check_of_the_recording_compares_its_rest(calibrated, worn_log):
    rest = vented_rest(worn_log)
    grades = {}
    for name, offset in (("same", 0.0), ("up", 3e-4)):
        log = worn_log.with_columns(position=worn_log["position"] + offset)
        grades[name] = {check.name: check.grade for check in inspect(log, calibrated.actuator, rest).checks}
    assert grades["same"]["vented rest"] == "good"
    assert grades["up"]["vented rest"] == "suspect"
    assert "vented rest" not in {check.name for check in inspect(worn_log, calibrated.actuator).checks}
