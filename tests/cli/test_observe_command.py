"""``clutchid observe``: files, the resumed run, one sentence for bad input, and nothing half-written."""

import json
import re

import numpy as np
import polars as pl
import pytest

from clutchid.estimation.parameter_file import ParameterFile, write_parameters
from clutchid.log import Log
from clutchid.measurements import write
from clutchid.observer.health import FLAGS


@pytest.fixture
def call(folder, observe):
    """Observe a recording of the folder."""
    return lambda log, *options, **others: observe(folder / log, *options, **others)


def test_it_writes_samples_and_strokes_and_says_what_was_found_with_the_load_and_its_trust_at_the_end(
    call, tmp_path, plant
):
    code, said, errors = call("worn.parquet")
    assert (code, errors) == (0, "")
    first, load, *trust = [line for line in said.splitlines() if not line.startswith("written: ")]
    written = [line for line in said.splitlines() if line.startswith("written: ")]
    assert first.startswith("observed worn: load at 12.5 mm ")
    assert " N (+" in first
    assert first.endswith(" strokes; no flags; supply pressure assumed")
    assert [line.rpartition("/")[2] for line in written] == ["est.parquet", "est.load.parquet"]
    assert re.fullmatch(r"load     at 5, 6, 7, 8 mm: (\d+ ± \d+, ){3}\d+ ± \d+ N", load)
    assert trust[0] == "trust    with care"
    assert "the supply pressure was not recorded" in " ".join(" ".join(trust).split())
    samples, strokes = pl.read_parquet(tmp_path / "est.parquet"), pl.read_parquet(tmp_path / "est.load.parquet")
    states = {f"{row.column} [{row.unit}]" for row in plant.state_rows.values()}
    bands = {"pressure_a low [Pa]", "pressure_a high [Pa]", "innovation [m]", "innovation std [m]", "used [1]"}
    bands |= {"nis_ratio [1]", "rest_shift [m]"}
    recorded = {"time [s]", "duty_supply [1]", "duty_exhaust [1]", "position_measured [m]", "pressure_a_measured [Pa]"}
    assert set(samples.columns) == states | bands | recorded
    assert samples.height == 6000
    assert {"time [s]", "stroke [1]", "theta_1 [N]", "F_C_std [N]", "load_05000um_low [N]"} <= set(strokes.columns)
    assert f"{strokes.height} strokes" in first


def test_a_resumed_run_gives_the_numbers_of_one_run(call, same):
    assert call("first.parquet", "--save", "state.toml", out="one.parquet")[0] == 0
    assert call("rest.parquet", "--resume", "state.toml", "--save", "state.toml", out="two.parquet")[0] == 0
    same("one", "two")


def test_the_json_object_has_the_load_at_the_end_and_the_health(call, plant, tmp_path):
    code, said, _ = call("worn.parquet", "--json")
    answer = json.loads(said)
    shown = {"status": "ok", "method": "joint", "trust": "with care"}
    assert (code, {name: answer[name] for name in shown}) == (0, shown)
    assert set(answer["health"]) == {*FLAGS}
    curve = answer["load_curve"]
    assert {len(values) for values in curve.values()} == {101}
    assert curve["position_m"][-1] == pytest.approx(plant.parameters.y_max)
    (at_half_stroke,) = plant.load.force(np.array([0.0125]))
    assert answer["calibrated_load_curve"]["force_N"][50] == pytest.approx(at_half_stroke)
    last = pl.read_parquet(tmp_path / "est.load.parquet").tail(1)
    assert set(answer["parameters"]["theta_3"]) == {"value", "std", "low", "high", "unit"}
    assert answer["parameters"]["theta_3"]["value"] == pytest.approx(last["theta_3 [N]"][0], rel=0.05)
    assert set(answer["parameters"]) == {*plant.load.names, "F_C", "V_0A", "y_max", "D_v", "tau_y", "C_A0"}
    assert 0.0 < answer["errors"]["pressure_a_rms_Pa"] < 2e4
    assert answer["calibration"]["name"] == "cal.toml"
    assert "the supply pressure was not recorded" in answer["reasons"][0]


def test_faults_of_the_signals_are_named_and_make_the_status_a_warning(call, folder, recorded_by, plant, tmp_path):
    log = recorded_by(plant, seconds=6.0, name="torn")
    position = log["position"].copy()
    position[2000:2100] = np.nan
    write(log.with_columns(position=position), tmp_path / "torn.parquet")
    assert ("flags: position_missing 0.1 s") in call(tmp_path / "torn.parquet")[1]
    assert json.loads(call(tmp_path / "torn.parquet", "--json")[1])["status"] == "warning"


def test_with_the_method_states_nothing_adapts(call):
    code, said, _ = call("worn.parquet", "--method", "states", "--json")
    answer = json.loads(said)
    assert (code, answer["parameters"], answer["method"]) == (0, {}, "states")
    curve, calibrated = answer["load_curve"], answer["calibrated_load_curve"]
    assert {name: curve[name] for name in calibrated} == calibrated
    assert set(curve) - set(calibrated) == {"low_as_calibrated_N", "high_as_calibrated_N"}
    assert answer["trust"] == "none"


SPOILED = {
    "duties above 1": lambda log: {"duty_supply": log["duty_supply"] + 0.3},
    "no finite position": lambda log: {"position": np.full(len(log), np.nan)},
    "no finite duty": lambda log: {"duty_supply": np.full(len(log), np.nan)},
    "infinite positions": lambda log: {"position": np.full(len(log), np.inf)},
}


@pytest.mark.parametrize("name", SPOILED)
@pytest.mark.parametrize("option", [[], ["--force"]])
def test_a_spoiled_recording_is_bad_input_and_nothing_is_written(call, tmp_path, recorded_by, plant, name, option):
    log = recorded_by(plant, seconds=2.0)
    write(log.with_columns(**SPOILED[name](log)), tmp_path / "bad.parquet")
    code, said, errors = call(tmp_path / "bad.parquet", "--save", "state.toml", "--report", "page.html", *option)
    assert (code, said) == (2, "")
    assert errors.startswith("clutchid: ")
    assert [path.name for path in tmp_path.iterdir()] == ["bad.parquet"]


def test_a_recording_too_slow_for_its_duty_cycles_is_refused_unless_forced(call, tmp_path, plant, recorded_by):
    write_parameters(ParameterFile(plant.replace({"T_pwm": 0.02})), tmp_path / "carrier.toml")
    log = recorded_by(plant, seconds=8.0)
    slow = Log(log.time[::10], {name: values[::10] for name, values in log.columns.items()})
    write(slow, tmp_path / "slow.parquet")
    for options, expected in (([], 2), (["--force"], 0)):
        code, _, errors = call(tmp_path / "slow.parquet", *options, start=tmp_path / "carrier.toml")
        assert code == expected
        assert "a sample every 10 ms does not show every change of the duty cycles" in errors


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--method", "jonit"], "joint"),
        (["--resume", "none.toml"], "there is no such file"),
        (["--save", "est.parquet"], "is the file of --out"),
        (["--report", "est.load.parquet"], "is the file of --out (load by stroke) too"),
    ],
)
def test_a_wrong_option_is_one_sentence(call, tmp_path, options, words):
    code, said, errors = call("worn.parquet", *options)
    assert (code, said) == (2, "")
    assert words in errors
    assert list(tmp_path.iterdir()) == []


def test_a_recording_or_calibration_that_is_not_there_is_named(call, tmp_path):
    for code, _, errors in (call("-"), call("worn.parquet", start=tmp_path / "none.toml")):
        assert code == 2
        assert "there is no such file" in errors


def test_a_calibration_without_a_load_says_how_to_make_one(call, tmp_path):
    (tmp_path / "cal.toml").write_text("[parameters]\nP_S = 9e5\n")
    code, _, errors = call("worn.parquet", start=tmp_path / "cal.toml")
    assert code == 2
    assert "has no load weights (theta_1, ...) in [parameters]" in errors


def test_the_samples_may_be_text(call, tmp_path):
    assert call("first.parquet", out="est.csv")[0] == 0
    assert {path.name for path in tmp_path.iterdir()} == {"est.csv", "est.load.csv"}


@pytest.mark.slow
def test_the_page_has_the_command_and_needs_no_other_file(call, tmp_path, monkeypatch):
    assert call("worn.parquet", "--report", "page.html")[0] == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Load and pressure of worn, on line" in page
    assert "No fault was found." in page
