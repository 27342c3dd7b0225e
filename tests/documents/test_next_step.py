"""The next command: it can be pasted into a shell, and runs with the files that there are."""

import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from clutchid.documents.next_step import Command, next_step
from clutchid.estimation.request import SearchState
from fixtures.baselines import calibration_like, with_baseline

LIMIT = SearchState("limit", 200, ("theta_1",), {})


def command(line, **files):
    """A command as its line would give it; a file of an option is named as well."""
    words = tuple(shlex.split(line))
    others = tuple(map(Path, files.pop("others", ())))
    return Command(words, (Path(words[1]),), **{name: Path(path) for name, path in files.items()}, others=others)


def following(fit, line, **files):
    """The words of the next command behind ``clutchid``."""
    _, _, text = next_step(fit, command(line, **files))
    first, *words = shlex.split(text)
    assert first == "clutchid"
    return words


@pytest.fixture
def calibrated(fitted):
    return replace(fitted, calibration=calibration_like(fitted))


@pytest.fixture(params=[LIMIT, None], ids=["with priors", "by simulation"])
def unconverged(request, fitted):
    """A search that ended early: only one with priors has a state that a later search goes on from."""
    return replace(fitted, converged=False, search=request.param)


@pytest.mark.parametrize("option", ["--save CAL.toml", "--save=CAL.toml"])
def test_an_option_is_replaced_however_it_is_written(option):
    given = command(f"fit a.csv {option} --free load")
    assert given.with_options("--save", "B.toml", without=("--save",)) == "clutchid fit a.csv --free load --save B.toml"
    assert given.with_options() == f"clutchid fit a.csv {option} --free load"


def test_a_value_that_reads_like_an_option_is_a_value():
    given = command("fit a.csv --report --save b.csv --save c.toml")
    assert given.with_options(without=("--report",)) == "clutchid fit a.csv b.csv --save c.toml"
    assert given.with_options(without=("--report", "--save")) == "clutchid fit a.csv b.csv"


def test_options_stand_before_the_two_dashes_behind_which_nothing_is_one():
    given = command("fit --free load -- -log.csv --save")
    assert given.with_options("--save", "F.toml") == "clutchid fit --free load --save F.toml -- -log.csv --save"


def test_options_stand_behind_those_that_take_several_values(fitted):
    words = following(with_baseline(fitted), "fit a.csv --start CAL.toml --verify b.csv c.csv", start="CAL.toml")
    assert words == ["fit", "a.csv", "--start", "CAL.toml", "--verify", "b.csv", "c.csv", "--report", "a.html"]


def test_a_recording_with_pressure_is_calibrated_and_one_without_is_recorded_again(fitted):
    words = following(fitted, "fit 'my log.csv'")
    assert words == ["calibrate", "my log.csv", "--save", "CAL.toml"]
    (one,) = fitted.recordings.values()
    without = replace(fitted, recordings={"first": replace(one, measured=one.measured.without("pressure_a"))})
    kind, why, _ = next_step(without, command("fit 'my log.csv'"))
    assert kind == "record"
    assert why == "record once with pressure, and calibrate"
    assert following(without, "fit 'my log.csv'")[:2] == ["calibrate", "CAL.csv"]


def test_the_actuator_of_the_start_file_stays_unless_it_is_that_of_the_paper(fitted):
    assert "--start" not in following(fitted, "fit a.csv --start FIT.toml", start="FIT.toml")
    other = replace(fitted, actuator=fitted.actuator.replace({"A_A": 0.02}))
    words = following(other, "fit a.csv --start TRUCK.toml", start="TRUCK.toml")
    assert words[2:4] == ["--start", "TRUCK.toml"]


def test_how_recordings_are_read_stays_and_force_only_for_the_same_recordings(fitted, calibrated):
    given = replace(command("fit a.csv", save="F.toml"), reading=("--map", "M.toml"), forced=True)
    words = shlex.split(next_step(fitted, given).command)
    assert words[:6] == ["clutchid", "calibrate", "a.csv", "--map", "M.toml", "--force"]
    words = shlex.split(next_step(calibrated, given).command)
    assert words == ["clutchid", "estimate", "WORN.csv", "--map", "M.toml", "--start", "F.toml"]
    read = replace(given, report=Path("a.html"))
    words = shlex.split(next_step(with_baseline(fitted), read).command)
    assert words[:6] == ["clutchid", "simulate", "a.csv", "--map", "M.toml", "--force"]
    assert words[6:] == ["--parameters", "F.toml", "--out", "a-pressure.csv"]


def test_a_calibration_is_kept_and_then_a_worn_clutch_is_read(calibrated):
    assert following(calibrated, "fit a.csv")[-2:] == ["--save", "CAL.toml"]
    # what is saved for MATLAB is not read back, and is saved all the same
    words = following(calibrated, "fit a.csv --save F.mat", others=["F.mat"])
    assert words == ["fit", "a.csv", "--save", "F.mat", "--save", "CAL.toml"]
    words = following(calibrated, "fit a.csv --save 'my cal.toml'", save="my cal.toml")
    assert words == ["estimate", "WORN.csv", "--start", "my cal.toml"]


def test_a_calibration_that_is_not_to_be_trusted_is_repeated(calibrated):
    bad = replace(calibrated, baseline=None, load_curve=with_baseline(calibrated).load_curve, recordings={})
    assert bad.verdict.trust == "none"
    kind, why, text = next_step(bad, command("fit a.csv --save CAL.toml", save="CAL.toml"))
    assert kind == "correct"
    assert "calibrate again" in why
    assert text == "clutchid fit a.csv --save CAL.toml"


def test_a_reading_is_shown_kept_and_simulated(fitted):
    read = with_baseline(fitted)
    line = "fit 'to/worn 1.csv' --start=CAL.toml"
    assert following(read, line, start="CAL.toml")[-2:] == ["--report", "worn 1.html"]
    line += " --report p.html"
    assert following(read, line, start="CAL.toml", report="p.html")[-2:] == ["--save", "worn 1.toml"]
    words = following(read, line, start="CAL.toml", report="p.html", save="w.toml")
    assert words == ["simulate", "to/worn 1.csv", "--parameters", "w.toml", "--out", "worn 1-pressure.csv"]


def test_no_file_of_the_command_is_overwritten_by_the_next(fitted, calibrated):
    # the calibration recording is read once more
    words = following(with_baseline(fitted), "fit CAL.csv --start CAL.toml --report C.html", start="CAL.toml",
                      report="C.html")  # fmt: skip
    assert words[-2:] == ["--save", "CAL-2.toml"]
    again = following(calibrated, "fit a.csv --start ./CAL.toml --free auto", start="./CAL.toml")
    assert again[-2:] == ["--save", "CAL-2.toml"]
    (html,) = following(with_baseline(fitted), "fit a.html --start b", start="b")[-1:]
    assert html == "a-2.html"


@pytest.mark.parametrize(
    ("line", "files", "added"),
    [
        ("fit a.csv", {}, ["fit", "a.csv", "--save", "FIT.toml"]),
        ("fit a.csv --save F.mat", {"others": ["F.mat"]}, ["fit", "a.csv", "--save", "F.mat", "--save", "FIT.toml"]),
        (
            "fit a.csv --save F.toml --save F.mat",
            {"save": "F.toml", "others": ["F.mat"]},
            ["fit", "a.csv", "--start", "F.toml", "--save", "F-continued.toml"],
        ),
        (
            "fit a.csv --save 'my cal.toml' --free auto --report p.html",
            {"save": "my cal.toml", "report": "p.html"},
            ["fit", "a.csv", "--free", "auto", "--start", "my cal.toml", "--save", "my cal-continued.toml"],
        ),
        (
            "fit a.csv --start=CAL.toml --save=W.toml --verify b.csv",
            {"start": "CAL.toml", "save": "W.toml"},
            ["fit", "a.csv", "--verify", "b.csv", "--start", "W.toml", "--save", "W-continued.toml"],
        ),
    ],
)
def test_a_search_that_did_not_converge_is_saved_and_continued(unconverged, line, files, added):
    assert following(unconverged, line, **files) == added


def test_a_name_that_begins_with_a_dash_is_no_option(fitted):
    given = Command(("fit", "--", "-a.csv"), (Path("-a.csv"),))
    assert shlex.split(next_step(fitted, given).command)[:3] == ["clutchid", "calibrate", "./-a.csv"]
    read = next_step(with_baseline(fitted), given).command
    assert shlex.split(read) == ["clutchid", "fit", "--report", "./-a.html", "--", "-a.csv"]
