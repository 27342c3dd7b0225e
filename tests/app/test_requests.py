"""What the page asks and the server refuses at once, with the sentence of the command line where there is one."""

from pathlib import Path

import pytest

from clutchid.app.commands import fit_command
from clutchid.app.records import File
from clutchid.errors import ParameterError
from fixtures.cases import case_tables

CASES = case_tables(__file__, "refusals")

FIT = {"verb": "calibrate", "recordings": ["recording-1"]}


@pytest.fixture
def opened(idle):
    """A recording that has been read."""
    (idle.session.below / "run.csv").write_text("time [s],position [m]\n0,0\n")
    assert idle.ask("POST", "/api/recordings", {"path": "run.csv"}).json == {"id": "recording-1"}
    idle.session.board.update("recording-1", look={}, status="ready")
    return idle


@pytest.mark.parametrize(("content", "said"), CASES["fits"])
def test_a_fit_that_cannot_be_made_is_refused_with_a_sentence(opened, content, said):
    before = len(opened.submitted)
    answer = opened.ask("POST", "/api/fits", content)
    assert answer.status == 422
    assert said in answer.message
    assert len(opened.submitted) == before


def test_a_fit_has_the_command_and_the_python_that_repeat_it(opened):
    options = {"free": "load,P_S", "bounds": ["P_S=8e5:9e5"], "force": True}
    assert opened.ask("POST", "/api/fits", {**FIT, "options": options}).status == 200
    shown = opened.get("result-2")
    assert shown["command"].endswith("run.csv --free load,P_S --bounds P_S=8e5:9e5 --force")
    assert shown["command"].startswith("clutchid calibrate ")
    assert "clutchid.calibrate(" in shown["python"]
    assert "free='load,P_S', bounds={'P_S': (800000.0, 900000.0)}, force=True" in shown["python"]


@pytest.mark.slow
def test_free_parameters_are_offered_with_their_bounds_and_what_is_wrong_with_those_that_are_chosen(idle):
    def asked(free, **options):
        answer = idle.ask(
            "POST", "/api/choices", {"verb": "calibrate", "free": free, "options": {"free": free, **options}}
        )
        return {row["name"]: row for row in answer.json["choices"]}, answer.json["message"]

    rows, message = asked("", bounds=["P_S=8e5:9e5"])
    assert message == ""
    assert rows["P_S"] == {
        "name": "P_S", "meaning": "supply pressure, absolute", "unit": "Pa", "start": 9e5, "low": 3e5, "high": 2.7e6,
        "group": "auto",
    }  # fmt: skip
    assert "gamma" in rows
    assert "theta_1" not in rows  # of a load that the calibration does not fit
    rows, message = asked("load,P_S@EACH", bounds=["P_S=9e5:8e5"])
    assert "P_S: lower bound 900000 is not below upper bound 800000" in message
    assert "gamma" not in rows  # without an effect in the model
    assert (rows["theta_2"]["low"], rows["theta_2"]["group"], rows["P_S"]["group"]) == (None, "load", "auto")
    assert "write NAME=LOW:HIGH" in asked("load", bounds=["P_S=x:"])[1]


def test_recordings_with_different_maps_are_no_one_command(opened):
    """A command has one map for all of its recordings."""
    other = opened.ask("POST", "/api/recordings", {"path": "run.csv"}).json["id"]
    opened.session.board.update(other, look={}, status="ready")
    entry = {"channel": "Weg", "unit": "mm"}
    for id_, said in ((other, ""), ("recording-1", "--map run.csv.map.toml")):
        assert opened.ask("PUT", f"/api/recordings/{id_}/map", {"channels": {"position": entry}}).status == 200
        opened.session.board.update(id_, status="ready")
        made = opened.ask("POST", "/api/fits", {**FIT, "recordings": ["recording-1", other]}).json["id"]
        shown = opened.get(made)
        assert shown["command"].partition("run.csv ")[2].partition("run.csv ")[2] == said
        assert ("channels='run.csv.map.toml'" in shown["python"]) == bool(said)
        answer = opened.ask("GET", f"/api/results/{made}/map.toml")
        assert ('channel = "Weg"' in answer.body.decode()) == bool(said), "a calibration remembers its map"


@pytest.mark.parametrize("body", [b"", b"[]", b"{", b"[" * 100_000, b"\xff\xfe"])
def test_a_body_that_is_no_object_is_refused(idle, body):
    assert "not a JSON object" in idle.ask("POST", "/api/fits", body=[body]).message


@pytest.mark.parametrize("length", [None, "x", str(1 << 30)])
def test_a_large_body_is_refused(idle, length):
    assert "too large" in idle.ask("POST", "/api/fits", {}, content_length=length).message


@pytest.mark.parametrize(
    ("channels", "said"),
    [
        ({"position": {"channel": "x", "unit": "furlong"}}, "unit = 'furlong': is not known here"),
        ({"position": {"channel": "x", "sign": 2}}, "sign = 2: must be 1 or -1"),
        ({"speed": {"channel": "x"}}, "speed"),
        ({"position": {"channel": "x", "delay": 3.0}}, "a delay of at most 0.5 s is needed"),
        ({"position": "x"}, "write a table"),
        ({"position": {"channel": ["x"]}}, "a string is needed"),
        ({"position": {"channel": [None]}}, "texts and numbers"),
        ({}, "contains no channel"),
    ],
)
def test_a_map_that_is_none_is_refused_with_the_sentence_of_the_command_line(opened, channels, said):
    answer = opened.ask("PUT", "/api/recordings/recording-1/map", {"channels": channels})
    assert answer.status == 422
    assert said in answer.message
    assert str(opened.session.folder) not in answer.message
    assert opened.get("recording-1")["map"] is None


def test_a_map_that_was_written_to_a_file_is_given_to_another_recording(opened):
    text = 'rate = 1000.0\n[position]\nchannel = "Weg"\nunit = "mm"\n'
    assert opened.ask("PUT", "/api/recordings/recording-1/map", {"toml": text}).status == 200
    body = opened.ask("GET", "/api/recordings/recording-1/map.toml").body.decode()
    assert "rate = 1000.0" in body
    assert 'channel = "Weg"' in body
    assert "is not a TOML file" in opened.ask("PUT", "/api/recordings/recording-1/map", {"toml": "[position"}).message


def test_a_map_that_fits_is_kept_and_can_be_downloaded(opened):
    entry = {"channel": "Kupplungsweg <b>", "unit": "mm", "sign": -1, "group": None}
    assert opened.ask("PUT", "/api/recordings/recording-1/map", {"channels": {"position": entry}}).status == 200
    answer = opened.ask("GET", "/api/recordings/recording-1/map.toml")
    assert 'channel = "Kupplungsweg <b>"' in answer.body.decode()
    assert answer.headers["content-disposition"] == "attachment; filename*=UTF-8''run.csv.map.toml"


@pytest.mark.parametrize("query", CASES["plots"])
def test_a_plot_of_nonsense_is_refused(opened, query):
    assert opened.ask("GET", f"/api/recordings/recording-1/plot?{query}").status == 422


@pytest.mark.parametrize("name", ["fit.toml", "..%2flock.json", "lock.json"])
def test_only_files_of_a_result_can_be_downloaded(idle, name):
    assert idle.ask("GET", f"/api/results/result-1/files/{name}").status in (404, 422)


def test_a_path_elsewhere_is_refused(idle, tmp_path):
    (tmp_path / "secret.csv").write_text("x")
    answer = idle.ask("POST", "/api/recordings", {"path": "../secret.csv"})
    assert "does not lie below" in answer.message


def test_what_is_forgotten_leaves_nothing(idle):
    idle.ask("PUT", "/api/recordings?name=a.csv", body=[b"x"])
    assert idle.ask("DELETE", "/api/recordings/recording-1").status == 200
    assert idle.get("recording-1") is None
    assert [path for path in idle.session.folder.rglob("*") if path.is_file()] == []


def test_options_that_are_left_empty_are_left_out():
    files = (File(Path("cal.csv"), name="cal.csv"),)
    asked = fit_command("calibrate", {"free": " ", "method": "", "prior": [], "force": False}, files)
    assert asked.words == ("calibrate", "cal.csv")
    with pytest.raises(ParameterError, match="options free = 3: a text in quotes is needed"):
        fit_command("calibrate", {"free": 3}, files)
