"""The next command: it can be pasted into a shell, and runs with the files that there are."""

import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from clutchid.estimation.request import SearchState
from clutchid.verbs.commands import FitCommand
from clutchid.verbs.next_step import next_step
from clutchid.verbs.options import ReadingText, RequestText
from fixtures.baselines import calibration_like, with_baseline

LIMIT = SearchState("limit", 200, ("theta_1",), {})


def command(log, *, verb="fit", start=None, save=(), report=None, verify=(), **options):
    """A fit of a recording with these files."""
    files = {"start": start and Path(start), "report": report and Path(report)}
    saved, verified = tuple(map(Path, save)), tuple(map(Path, verify))
    return FitCommand(verb=verb, logs=(Path(log),), save=saved, verify=verified, **files, **options)


def following(fit, log, **files):
    """The words of the next command behind ``clutchid``."""
    first, *words = shlex.split(next_step(fit, command(log, **files)).command)
    assert first == "clutchid"
    return words


@pytest.fixture
def calibrated(fitted):
    return replace(fitted, calibration=calibration_like(fitted))


@pytest.fixture(params=[LIMIT, None], ids=["with priors", "by simulation"])
def unconverged(request, fitted):
    """A search that ended early: only one with priors has a state that a later search goes on from."""
    return replace(fitted, converged=False, search=request.param)


def test_options_stand_behind_those_that_take_several_values(fitted):
    words = following(with_baseline(fitted), "a.csv", start="CAL.toml", verify=["b.csv", "c.csv"])
    assert words == ["fit", "a.csv", "--start", "CAL.toml", "--verify", "b.csv", "c.csv", "--report", "a.html"]


def test_a_recording_with_pressure_is_calibrated_and_one_without_is_recorded_again(fitted):
    words = following(fitted, "my log.csv")
    assert words == ["calibrate", "my log.csv", "--save", "CAL.toml"]
    (recording,) = fitted.recordings.values()
    without = replace(
        fitted, recordings={"first": replace(recording, measured=recording.measured.without("pressure_a"))}
    )
    kind, why, _ = next_step(without, command("my log.csv"))
    assert kind == "record"
    assert why == "record once with pressure, and calibrate"
    assert following(without, "my log.csv")[:2] == ["calibrate", "CAL.csv"]


def test_the_actuator_of_the_start_file_stays_unless_it_is_that_of_the_paper(fitted):
    assert "--start" not in following(fitted, "a.csv", start="FIT.toml")
    other = replace(fitted, actuator=fitted.actuator.replace({"A_A": 0.02}))
    words = following(other, "a.csv", start="TRUCK.toml")
    assert words[2:4] == ["--start", "TRUCK.toml"]


def test_how_recordings_are_read_stays_and_force_only_for_the_same_recordings(fitted, calibrated):
    process = command("a.csv", save=["F.toml"], files=ReadingText(map=Path("M.toml")), force=True)
    words = shlex.split(next_step(fitted, process).command)
    assert words[:6] == ["clutchid", "calibrate", "a.csv", "--map", "M.toml", "--force"]
    words = shlex.split(next_step(calibrated, process).command)
    assert words == ["clutchid", "estimate", "WORN.csv", "--map", "M.toml", "--start", "F.toml"]
    read = replace(process, report=Path("a.html"))
    words = shlex.split(next_step(with_baseline(fitted), read).command)
    assert words[:6] == ["clutchid", "simulate", "a.csv", "--map", "M.toml", "--force"]
    assert words[6:] == ["--parameters", "F.toml", "--out", "a-pressure.csv"]


def test_a_calibration_is_kept_and_then_a_worn_clutch_is_read(calibrated):
    assert following(calibrated, "a.csv")[-2:] == ["--save", "CAL.toml"]
    # what is saved for MATLAB is not read back, and is saved all the same
    words = following(calibrated, "a.csv", save=["F.mat"])
    assert words == ["fit", "a.csv", "--save", "F.mat", "--save", "CAL.toml"]
    words = following(calibrated, "a.csv", save=["my cal.toml"])
    assert words == ["estimate", "WORN.csv", "--start", "my cal.toml"]


def test_a_calibration_that_is_not_to_be_trusted_is_repeated(calibrated):
    bad = replace(calibrated, baseline=None, load_curve=with_baseline(calibrated).load_curve, recordings={})
    assert bad.verdict.trust == "none"
    kind, why, text = next_step(bad, command("a.csv", save=["CAL.toml"]))
    assert kind == "correct"
    assert "calibrate again" in why
    assert text == "clutchid fit a.csv --save CAL.toml"


def test_a_reading_is_shown_kept_and_simulated(fitted):
    read = with_baseline(fitted)
    log = "to/worn 1.csv"
    assert following(read, log, start="CAL.toml")[-2:] == ["--report", "worn 1.html"]
    assert following(read, log, start="CAL.toml", report="p.html")[-2:] == ["--save", "worn 1.toml"]
    words = following(read, log, start="CAL.toml", report="p.html", save=["w.toml"])
    assert words == ["simulate", "to/worn 1.csv", "--parameters", "w.toml", "--out", "worn 1-pressure.csv"]


def test_no_file_of_the_command_is_overwritten_by_the_next(fitted, calibrated):
    # the calibration recording is read once more
    words = following(with_baseline(fitted), "CAL.csv", start="CAL.toml", report="C.html")
    assert words[-2:] == ["--save", "CAL-2.toml"]
    again = following(calibrated, "a.csv", start="./CAL.toml")
    assert again[-2:] == ["--save", "CAL-2.toml"]
    (html,) = following(with_baseline(fitted), "a.html", start="b")[-1:]
    assert html == "a-2.html"


@pytest.mark.parametrize(
    ("files", "added"),
    [
        ({}, ["--save", "FIT.toml"]),
        ({"save": ["F.mat"]}, ["--save", "F.mat", "--save", "FIT.toml"]),
        ({"save": ["F.toml", "F.mat"]}, ["--start", "F.toml", "--save", "F-continued.toml"]),
        (
            {"save": ["my cal.toml"], "search": RequestText(free="auto"), "report": "p.html"},
            ["--free", "auto", "--start", "my cal.toml", "--save", "my cal-continued.toml"],
        ),
        (
            {"start": "CAL.toml", "save": ["W.toml"], "verify": ["b.csv"]},
            ["--verify", "b.csv", "--start", "W.toml", "--save", "W-continued.toml"],
        ),
    ],
)
def test_a_search_that_did_not_converge_is_saved_and_continued(unconverged, files, added):
    assert following(unconverged, "a.csv", **files) == ["fit", "a.csv", *added]


def test_a_name_that_begins_with_a_dash_is_no_option(fitted):
    assert following(fitted, "-a.csv")[:2] == ["calibrate", "./-a.csv"]
    assert following(with_baseline(fitted), "-a.csv") == ["fit", "./-a.csv", "--report", "./-a.html"]
