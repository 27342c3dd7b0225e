"""The JSON object of a fit: the keys of the contract, and the comparison with a calibration."""

import json
from dataclasses import replace

import numpy as np
import pytest

import clutchid
from clutchid.cli.common import print_json
from clutchid.documents.fit_json import fit_json
from clutchid.estimation import LoadCurve
from clutchid.estimation.result import Change
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.numerics.least_squares import Start
from fixtures.baselines import ORIGIN, with_baseline


@pytest.fixture
def written(capsys):
    """What is printed for a fit, read again by a parser that admits neither NaN nor Infinity."""

    def write(fit):
        print_json(fit_json(fit))
        return json.loads(capsys.readouterr().out, parse_constant=pytest.fail)

    return write


def test_a_fit_without_a_calibration_has_null_in_its_place(fitted, written):
    text = written(fitted)
    for key in ("calibration", "calibrated_load_curve", "load_change"):
        assert text[key] is None
    assert text["readings"] == {}
    assert (text["trust"], text["reasons"]) == ("good", [])
    assert text["trust"] == text["verdict"]["trust"]


def test_a_reading_has_the_calibration_its_load_and_the_difference(fitted, written):
    text = written(with_baseline(fitted, share=0.8))
    assert text["calibration"] == ORIGIN._asdict()
    assert set(text["calibration"]) == {"name", "created", "sha256", "trust"}
    now, before, change = (text[key] for key in ("load_curve", "calibrated_load_curve", "load_change"))
    assert set(before) == set(now) == {"position_m", "force_N", "low_N", "high_N"}
    assert before["position_m"] == change["position_m"] == now["position_m"]
    assert {len(values) for values in before.values()} == {101}
    assert all(low <= force <= high for _, force, low, high in zip(*now.values(), strict=True))
    np.testing.assert_allclose(change["difference_N"], np.subtract(now["force_N"], before["force_N"]), atol=1e-9)
    assert change["difference_percent"][0] is None  # no load at the rest
    assert change["difference_percent"][24] == pytest.approx(25.0)
    assert set(change["half_load"]) == {"before", "now", "shift"}
    assert change["half_load"]["shift"]["position_m"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("origin", [None, Origin()])
def test_a_calibration_that_is_from_no_file_is_there_without_a_name(fitted, written, origin):
    assert written(with_baseline(fitted, origin=origin))["calibration"] == dict.fromkeys(Origin._fields, "")


def test_a_calibration_of_an_older_file_is_named_and_not_compared(fitted, written):
    text = written(with_baseline(fitted, theta=(), theta_covariance=np.zeros((0, 0))))
    assert text["calibration"]["name"] == "CAL.toml"
    assert text["calibrated_load_curve"] is None
    assert text["load_change"] is None


def test_every_start_is_there_with_its_cost_and_null_where_it_has_none(fitted, written):
    starts = Start("initial values", 12.5, "stalled"), Start("new states 1", np.inf, "failed")
    assert written(replace(fitted, starts=starts))["starts"] == [
        {"name": "initial values", "cost": 12.5, "status": "stalled"},
        {"name": "new states 1", "cost": None, "status": "failed"},
    ]


@pytest.mark.parametrize("end", [np.inf, np.nan])
def test_what_is_not_finite_is_null(fitted, written, end):
    curve, nowhere = fitted.load_curve, np.full(101, end)
    lost = replace(with_baseline(fitted), load_curve=LoadCurve(curve.position, curve.force, -nowhere, nowhere))
    text = written(lost)
    assert text["load_change"]["high_N"] == text["load_change"]["low_N"] == [None] * 101
    assert text["load_change"]["half_load"]["now"]["low_m"] is None
    assert text["trust"] == "none"


def test_recordings_read_alone_are_there_by_name(fitted, written):
    change = Change("first", "C_vs", 1.0, 2.0, 0.1, "1", 0.75, "valves")
    alone = replace(with_baseline(fitted), changes=(change,))
    reading = written(replace(alone, readings={'[red]"a\n': alone}))["readings"]['[red]"a\n']
    assert reading["trust"] == "good"
    assert reading["changes"][0]["after"] == 2.0
    assert reading["changes"][0]["probability"] == 0.75
    assert len(reading["load_curve"]["force_N"]) == len(reading["load_change"]["difference_N"]) == 101


def test_identifiability_and_profiles_are_in_the_json_of_a_fit():
    log = clutchid.bundled_recording().slice(0, 4000)
    request = clutchid.FitRequest(profile=("F_C",))
    fit = clutchid.fit(log, free="load,F_C", measure="position,pressure_a", request=request)
    data = fit_json(fit)
    assert {row["name"] for row in data["identifiability"]["ranking"]} == set(fit.parameters)
    assert data["profiles"]["F_C"]["shape"] in ("bounded", "open below", "open above", "flat")
    assert len(data["profiles"]["F_C"]["values"]) == len(data["profiles"]["F_C"]["distances"]) >= 3
