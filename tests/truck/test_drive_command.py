"""The command ``drive``: files, options, and bad input in one sentence."""

import json

import numpy as np
import pytest

import clutchid
from clutchid.cli.drive import drive
from fixtures.cases import case_tables
from fixtures.commands import called

CASES = case_tables(__file__, "refusals")


@pytest.mark.parametrize("family", ["B", "h:0"])
def test_every_option_of_the_command_reaches_the_drive_in_si(tmp_path, capsys, family):
    out, truth = tmp_path / "worn1.parquet", tmp_path / "truth.json"
    options = (
        "--manoeuvre", "strokes", "--wear", 1.5, "--cycles", 2e5, "--temperature", -20, "--supply", 8, "--change",
        "seals", "--no-pressure", "--conditions", "--bus", "--dropouts", 2, "--offset", 0.2, "--sensor-zero", "kept",
        "--late", 30,
    )  # fmt: skip
    files = ("--out", out, "--truth", truth)
    assert called("drive", "--family", family, "--truck", 2, "--seed", 3, "--seconds", 2, *options, *files) == 0
    assert [line.split(": ")[1] for line in capsys.readouterr().out.splitlines()] == [str(out), str(truth)]
    expected = clutchid.drive(
        clutchid.truck.truck(2, family), seconds=2.0, seed=3, name="worn1", manoeuvre="strokes", wear=1.5e-3,
        cycles=2e5, temperature=-20 + 273.15, supply=8e5, change=("seals",), pressure=False, conditions=True,
        recorder="bus", dropouts=2, offset=2e-4, sensor_zero="kept", late=0.03,
    )  # fmt: skip
    log = clutchid.read(out)
    assert log.columns.keys() == expected.log.columns.keys()
    for name, values in {"time": log.time, **log.columns}.items():
        assert np.array_equal(values, {"time": expected.log.time, **expected.log.columns}[name], equal_nan=True), name
    expected.write_truth(tmp_path / "expected.json")
    assert truth.read_bytes() == (tmp_path / "expected.json").read_bytes()


def test_the_one_json_object_names_the_files(tmp_path, capsys):
    assert drive(out=tmp_path / "log.parquet", seconds=1, json=True) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["status"] == "ok"
    assert content["written"] == [str(tmp_path / "log.parquet")]


@pytest.mark.parametrize(("options", "words"), CASES["commands"])
def test_bad_input_is_one_sentence_and_nothing_is_written(tmp_path, capsys, options, words):
    assert drive(out=tmp_path / "log.parquet", **options) == 2
    said = capsys.readouterr()
    assert words in said.err
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["nowhere/log.parquet", "log.wav"])
def test_an_output_that_cannot_be_written_is_one_sentence(tmp_path, capsys, name):
    assert drive(out=tmp_path / name, seconds=1) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_the_truth_must_not_be_the_recording(tmp_path, capsys):
    assert drive(out=tmp_path / "a.csv", truth=tmp_path / "a.csv") == 2
    assert "the same file as --out" in capsys.readouterr().err
