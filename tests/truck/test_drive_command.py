"""The command ``drive``: files, options, and bad input in one sentence."""

import json

import pytest

import clutchid
from clutchid.cli.drive import drive


def test_a_drive_is_written_with_its_truth_under_the_name_of_the_recording(tmp_path, capsys):
    out, truth = tmp_path / "worn1.csv", tmp_path / "truth.json"
    assert drive(out=out, truck=2, seed=3, seconds=2, wear=1.5, truth=truth, pressure=False) == 0
    log = clutchid.read(out)
    assert len(log) == 2000
    assert "pressure_a" not in log
    content = json.loads(truth.read_text())
    assert content["logs"]["worn1"]["wear_m"] == pytest.approx(1.5e-3)
    assert [line.split(": ")[1] for line in capsys.readouterr().out.splitlines()] == [str(out), str(truth)]


def test_a_drive_has_the_temperature_that_is_asked_for(tmp_path):
    out, truth = tmp_path / "cold.csv", tmp_path / "truth.json"
    assert drive(out=out, truck=2, seconds=1, temperature=-20.0, truth=truth) == 0
    assert json.loads(truth.read_text())["logs"]["cold"]["ambient_K"] == pytest.approx(253.15)


def test_the_same_command_writes_the_same_recording_and_another_seed_another(tmp_path):
    paths = [tmp_path / f"{k}.csv" for k in range(3)]
    for path, seed in zip(paths, (1, 1, 2), strict=True):
        assert drive(out=path, truck=5, seed=seed, seconds=1, bus=True) == 0
    a, b, c = (path.read_bytes() for path in paths)
    assert a == b != c


def test_the_one_json_object_names_the_files(tmp_path, capsys):
    assert drive(out=tmp_path / "log.parquet", seconds=1, json=True) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["status"] == "ok"
    assert content["written"] == [str(tmp_path / "log.parquet")]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"manoeuvre": "crep"}, "did you mean 'creep'"),
        ({"wear": 12.0}, "exceeds the facing"),
        ({"truck": -4}, "numbered 0, 1, 2"),
        ({"temperature": 200.0}, "T_0 = 473.15 K"),
        ({"seconds": -1.0}, "0.5 to 3600"),
    ],
)
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


@pytest.mark.parametrize("family", ["A", "B"])
def test_a_drive_records_temperature_and_supply_where_they_are_asked_for(tmp_path, family):
    plain, with_them = tmp_path / "plain.csv", tmp_path / "with.csv"
    assert drive(out=plain, family=family, truck=2, seconds=1, temperature=5.0) == 0
    assert drive(out=with_them, family=family, truck=2, seconds=1, temperature=5.0, conditions=True) == 0
    log, other = clutchid.read(plain), clutchid.read(with_them)
    assert set(other.columns) - set(log.columns) == {"temperature_ambient", "pressure_supply"}
    assert all((log[name] == other[name]).all() for name in log.columns), "nothing else differs"
    assert other["temperature_ambient"].mean() == pytest.approx(278.15, abs=5.0)
    assert 6e5 < other["pressure_supply"].min() < other["pressure_supply"].max() < 1.2e6
