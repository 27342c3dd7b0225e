"""Answers of jobs: recordings, maps, fits, their files and exports, and observations."""

import os
from urllib.parse import unquote

import numpy as np
import pytest

from clutchid import observe
from clutchid.app.jobs import Job
from clutchid.documents.fit_json import fit_json
from clutchid.errors import DataError
from fixtures.commands import called, wait_for

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cal(working, recorded):
    """The id of a recording with pressure."""
    return working.checked(recorded / "cal.csv")


@pytest.fixture(scope="module")
def calibrated(working, cal):
    """The id of its calibration."""
    id_ = working.ask("POST", "/api/fits", {"verb": "calibrate", "recordings": [cal]}).json["id"]
    wait_for(lambda: (working.get(id_)["found"] or {"writing": True})["writing"] is False)
    return id_


def test_a_recording_has_its_channels_its_checks_and_its_samples(working, cal):
    look = working.get(cal)["look"]
    names = ["time", "position", "duty_supply", "duty_exhaust", "pressure_a"]
    assert [channel["name"] for channel in look["channels"]] == names
    assert {check["grade"] for check in look["checks"]} <= {"good", "undetermined"}
    assert {check["kind"] for check in look["strokes"]} == {"stroke", "rest"}
    answer = working.ask("GET", f"/api/recordings/{cal}/plot?grid=0&columns=1,4&begin=0&end=3&width=100")
    assert len(answer.body) == 3 * 8 * 200


def test_a_recording_is_shown_before_it_is_checked(working, recorded, monkeypatch):
    updated, update = [], working.session.board.update

    def noted(id_, **changes):
        updated.append(changes.get("look"))
        update(id_, **changes)

    monkeypatch.setattr(working.session.board, "update", noted)
    working.checked(recorded / "cal.csv")
    assert [look["checking"] for look in updated if look] == [True, False]


def repeated(served, id_, folder, monkeypatch):
    """What the Python that the page shows makes in a folder with the recordings."""
    monkeypatch.chdir(folder)
    made = {}
    exec(served.get(id_)["python"], made)
    return made


def test_a_calibration_is_that_of_the_python_that_is_shown_and_has_its_files(
    working, calibrated, recorded, monkeypatch
):
    content = working.get(calibrated)["found"]
    expected = fit_json(repeated(working, calibrated, recorded, monkeypatch)["fit"])
    assert (recorded / "load.png").stat().st_size > 0
    assert content["parameters"] == expected["parameters"]
    assert content["load_curve"]["force_N"] == expected["load_curve"]["force_N"]
    assert set(content["files"]) == {"fit.toml", "fit.mat", "report.html", "result.json"}
    assert (content["failures"], content["is_calibration"], content["next"]["kind"]) == ([], True, "estimate")
    report = working.ask("GET", f"/api/results/{calibrated}/files/report.html")
    assert report.headers["content-security-policy"].startswith("sandbox allow-scripts; default-src 'none'")
    stages = working.get(next(job["id"] for job in working.all(Job) if job["do"] == "FitRecordings"))
    assert (stages["share"], stages["stage"]) == (1.0, "writing")


def test_a_worn_clutch_is_compared_with_the_calibration(working, calibrated, recorded):
    worn = working.upload(recorded / "worn.csv")
    working.wait(worn, "ready")
    body = {"verb": "estimate", "recordings": [worn], "start": calibrated}
    id_ = working.ask("POST", "/api/fits", body).json["id"]
    content = working.wait(id_, "done")["found"]
    assert content["calibrated_load_curve"]["force_N"]
    name = f"calibrate cal.csv ({calibrated.removeprefix('result-')})"
    assert content["calibration"]["name"] == f"{name}.toml"  # as in the command that is shown, and of the download
    assert f"--start '{name}.toml'" in working.get(id_)["command"]
    assert working.get(calibrated)["name"] == name
    assert {job["title"] for job in working.all(Job) if job["about"] == calibrated} == {name}
    saved = working.ask("GET", f"/api/results/{calibrated}/files/fit.toml")
    assert unquote(saved.headers["content-disposition"]).endswith(f"''{name}.toml")
    assert "residual position" in content["recordings"][0]["columns"]


def test_a_saved_calibration_is_opened_again(working, calibrated):
    saved = working.ask("GET", f"/api/results/{calibrated}/files/fit.toml").body
    first, again = (working.ask("PUT", "/api/calibrations?name=CAL.toml", body=[saved]).json["id"] for _ in range(2))
    shown = working.wait(first, "done")
    assert (shown["name"], shown["found"]["trust"]) == ("CAL.toml", working.get(calibrated)["found"]["trust"])
    assert working.get(again)["name"] == f"CAL ({again.removeprefix('result-')}).toml"


def test_a_file_that_is_no_calibration_is_refused_with_a_sentence(working):
    id_ = working.ask("PUT", "/api/calibrations?name=MAP.toml", body=[b'[position]\nchannel = "x"\n']).json["id"]
    assert "MAP.toml" in working.wait(id_, "failed")["message"] or working.get(id_)["message"]


def test_names_of_another_language_are_mapped_and_checked_also_in_the_python_that_is_shown(
    working, recorded, tmp_path, monkeypatch
):
    id_ = working.upload(recorded / "german.csv")
    working.wait(id_, "ready")
    entries = working.get(id_)["look"]["map"]
    entries["position"]["sign"] = -1
    assert working.ask("PUT", f"/api/recordings/{id_}/map", {"channels": entries}).status == 200
    wait_for(lambda: working.get(id_)["look"]["checks"] and working.get(id_)["status"] == "ready")
    wait_for(lambda: any(check["grade"] == "bad" for check in working.get(id_)["look"]["checks"]))
    fit = working.ask("POST", "/api/fits", {"verb": "calibrate", "recordings": [id_]}).json["id"]
    refused = working.wait(fit, "failed")
    assert "--force" in refused["message"]
    assert refused["bad_input"]
    saved = working.ask("GET", f"/api/recordings/{id_}/map.toml")
    (tmp_path / "german.csv.map.toml").write_bytes(saved.body)  # under the name of the download
    assert saved.headers["content-disposition"].endswith("german.csv.map.toml")
    (tmp_path / "german.csv").write_bytes((recorded / "german.csv").read_bytes())
    with pytest.raises(DataError) as said:
        repeated(working, fit, tmp_path, monkeypatch)
    assert str(said.value) == refused["message"]


def test_the_map_of_a_calibration_serves_a_recording_without_its_pressure(working, calibrated, recorded):
    whole, worn = (working.upload(recorded / name) for name in ("german.csv", "german_worn.csv"))
    entries = working.wait(whole, "ready")["look"]["map"]
    working.wait(worn, "ready")
    assert working.ask("PUT", f"/api/recordings/{worn}/map", {"channels": entries}).status == 200
    assert "pressure_a" in working.wait(worn, "ready")["look"]["map"]
    id_ = working.ask(
        "POST", "/api/observations", {"recording": worn, "start": calibrated, "method": "joint", "force": True}
    )
    run = working.wait(id_.json["id"], "done", "failed")
    assert (run["message"], run["found"]["next"]["kind"]) == ("", "export")
    named = {name: entry for name, entry in entries.items() if name != "pressure_a"}
    assert working.ask("PUT", f"/api/recordings/{whole}/map", {"channels": named}).status == 200
    assert {*working.wait(whole, "ready")["look"]["map"]} == {*named}


def test_a_range_of_time_is_a_recording_of_its_own(working, cal):
    assert any(stroke["kind"] == "stroke" for stroke in working.get(cal)["look"]["strokes"])
    id_ = working.ask("POST", f"/api/recordings/{cal}/cut", {"span": [1.0, 2.0]}).json["id"]
    event = working.wait(id_, "ready")
    assert (event["name"], event["message"]) == ("cal-cut.parquet", "")
    assert event["look"]["grids"][0]["samples"] == 1000
    assert "choose a range of time" in working.ask("POST", f"/api/recordings/{cal}/cut", {"span": [2.0, 1.0]}).message


def test_a_file_that_ends_its_reader_is_said_in_the_sentence_of_the_command_line(working, tmp_path, capsys):
    poison = tmp_path / "poison.mf4"
    poison.write_bytes(b"MDF     4.10    clutchid" + os.urandom(40) + b"\xff" * 4000)
    id_ = working.upload(poison)
    shown = working.wait(id_, "failed", "ready")
    said = shown["message"] or shown["look"]["message"]
    assert called("look", poison) == 2
    assert " ".join(said.replace(str(tmp_path), "").split())[-40:] in " ".join(capsys.readouterr().out.split())


@pytest.mark.needs("cc")
def test_an_export_is_a_zip_file_of_the_result(working, calibrated):
    assert working.ask("POST", f"/api/results/{calibrated}/export", {"to": "c,a2l", "method": "joint"}).status == 200
    wait_for(lambda: working.get(calibrated)["exports"])
    (export,) = working.get(calibrated)["exports"]
    assert "the C agrees with Python" in export["words"]
    assert working.ask("GET", f"/api/results/{calibrated}/files/export.zip").body[:2] == b"PK"


def test_an_export_to_something_unknown_is_refused(working, calibrated):
    working.ask("POST", f"/api/results/{calibrated}/export", {"to": "fortran", "method": "joint"})

    def failed():
        exports = [export for export in working.all(Job) if export["do"] == "Export"]
        return [export for export in exports if export["status"] == "failed"]

    wait_for(failed)
    assert "--to fortran" in failed()[0]["message"]


def test_a_recording_is_observed_as_by_the_library(working, calibrated, recorded):
    worn = working.upload(recorded / "worn.csv")
    working.wait(worn, "ready")
    body = {"recording": worn, "start": calibrated, "method": "joint"}
    id_ = working.ask("POST", "/api/observations", body).json["id"]
    content = working.wait(id_, "done", "failed")["found"]
    expected = observe(recorded / "worn.csv", working.session.calibration_file(calibrated))
    assert [row["time"] for row in content["loads"][1:]] == [row.time for row in expected.strokes]
    assert content["loads"][-1]["curve"]["force_N"] == expected.strokes[-1].curve.force.tolist()
    assert len(content["faults"]) == sum(seconds > 0.0 for seconds in expected.health.values())
    answer = working.ask("GET", f"/api/observations/{id_}/plot?grid=0&columns=0,1&begin=1&end=2&width=2000")
    pressure = np.frombuffer(answer.body).reshape(3, -1)[2]
    assert pressure.size == pytest.approx(1000, abs=3)
    assert set(pressure) <= set(expected.estimates()["pressure_a"])
    assert working.ask("DELETE", f"/api/observations/{id_}").status == 200


@pytest.mark.parametrize("change", [{"recording": "recording-99"}, {"start": "result-99"}, {"method": 3}])
def test_an_observation_without_its_inputs_is_refused(working, cal, calibrated, change):
    body = {"recording": cal, "start": calibrated, "method": "joint"} | change
    assert working.ask("POST", "/api/observations", body).status == 422
