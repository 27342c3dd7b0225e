"""The bundled recording and its halves."""

import json

import numpy as np

from clutchid.log import Log
from clutchid.study import bundled_recording
from clutchid.study.bundled import true_load


def test_the_bundled_recording_is_30_s_at_1_khz_with_pressure(logs):
    log = bundled_recording()
    assert len(log) == 30_000
    np.testing.assert_allclose(np.diff(log.time), 1e-3, rtol=1e-9)
    assert set(log.columns) == {"position", "duty_supply", "duty_exhaust", "pressure_a"}
    assert len(log.metadata["sha256"]) == 64


def test_the_bundled_recording_and_its_truth_are_those_of_truck_1(shared, source):
    folder = shared / "data" / "trucks" / "truck1"
    mine = source / "study/data"
    assert (mine / "truck1_calibration.csv").read_bytes() == (folder / "calibration.csv").read_bytes()
    assert json.loads((mine / "truck1_truth.json").read_text()) == json.loads((folder / "truth.json").read_text())


def test_halves_are_cut_at_a_rest_and_lose_no_sample(logs):
    first, second = logs
    whole = bundled_recording()
    for name in whole.columns:
        np.testing.assert_array_equal(np.concatenate([first[name], second[name]]), whole[name])
    around = np.concatenate([first["position"][-100:], second["position"][:100]])
    assert np.ptp(around) <= 5e-4
    assert abs(len(first) - 15_000) <= 3_000
    assert first.name != second.name


def test_the_halves_know_the_true_load_and_other_recordings_do_not(logs):
    truth = true_load(logs[1])
    assert truth.force.max() > 4000
    assert truth.position.shape == truth.force.shape
    assert true_load(Log(np.arange(3.0), {})) is None
