"""``clutchid look --json``: channels, checks and map as one object, which says what the table says."""

import json

import pytest

from clutchid import write
from clutchid.truck import Truck, drive
from fixtures.commands import called


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Four seconds of a virtual truck."""
    path = tmp_path_factory.mktemp("look") / "run.csv"
    write(drive(Truck(), seconds=4.0, seed=1).log, path)
    return path


@pytest.fixture
def looked(capsys):
    """Exit code and object of `look --json`."""

    def run(*arguments):
        code = called("look", *arguments, "--json")
        return code, json.loads(capsys.readouterr().out)

    return run


def test_a_recording_has_its_channels_and_the_grades_of_its_checks(looked, recording):
    code, content = looked(recording)
    assert (code, content["status"]) == (0, "ok")
    position = next(channel for channel in content["channels"] if channel["name"] == "position")
    assert (position["heading"], position["unit"], position["samples"], position["missing"]) == (
        "position [m]", "m", 4000, 0,
    )  # fmt: skip
    assert {"name", "grade", "sentence"} <= content["checks"][0].keys()
    assert {(channel["begin_s"], channel["end_s"]) for channel in content["checks"]} == {(None, None)}
    assert {channel["grade"] for channel in content["checks"]} <= {"good", "undetermined"}
    assert content["grids"][0]["time"]["usual_interval_s"] == pytest.approx(1e-3)


def test_a_file_with_names_of_its_own_has_the_proposed_map(looked, recording, tmp_path):
    foreign = tmp_path / "foreign.csv"
    foreign.write_text(recording.read_text().replace("position [m]", "Kupplungsweg [m]"))
    code, content = looked(foreign, "--save", tmp_path / "map.toml")
    assert (code, content["needs_map"]) == (0, True)
    assert content["map"]["position"]["channel"] == "Kupplungsweg [m]"
    assert (tmp_path / "map.toml").exists()


def test_a_check_has_the_place_where_it_fails(looked, recording, tmp_path):
    head, *rows = recording.read_text().splitlines()
    place = head.split(",").index("position [m]")
    cells = [row.split(",") for row in rows]
    for k in range(1000, 3000):
        cells[k][place] = cells[1000][place]
    (tmp_path / "stuck.csv").write_text("\n".join([head, *map(",".join, cells)]) + "\n")
    _, content = looked(tmp_path / "stuck.csv")
    (stuck,) = (check for check in content["checks"] if check["name"] == "stuck position")
    assert stuck["grade"] == "bad"
    assert (stuck["begin_s"], stuck["end_s"]) == (pytest.approx(1.0, abs=0.01), pytest.approx(2.999, abs=0.01))


def test_problems_are_the_message_and_the_exit_code(looked, recording, tmp_path):
    spoiled = tmp_path / "spoiled.csv"
    spoiled.write_text(recording.read_text().replace("\n0.002,", "\nnoon,", 1))
    code, content = looked(spoiled)
    assert (code, content["status"]) == (2, "bad_input")
    assert "line 4 has 'noon'" in content["message"]
    assert content["checks"] == []


def test_a_file_that_is_not_there_is_an_object_too(looked, tmp_path):
    code, content = looked(tmp_path / "no.csv")
    assert (code, content["status"]) == (2, "bad_input")
    assert "no.csv" in content["message"]
