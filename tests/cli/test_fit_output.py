"""What ``clutchid fit`` prints: ten lines of 80 columns, coloured on a terminal only, nothing twice, a next command."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir, redirect_stdout, suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from clutchid import Fit, FitRequest, fit, read_parameters, write
from clutchid.cli.fit import MOST_WARNINGS, answer
from clutchid.documents.console import OutputLost
from clutchid.errors import ExportError
from clutchid.estimation.assess.verdict import WearStates, states_of_wear
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.truck import Truck, drive
from clutchid.verbs.commands import FitCommand
from clutchid.verbs.next_step import document_with_next_step
from fixtures.baselines import with_baseline
from fixtures.commands import called

pytestmark = pytest.mark.slow

COMMAND = FitCommand(verb="fit", logs=(Path("worn.csv"),), start=Path("CAL.toml"))
ESCAPE = "\x1b"


def _all_from(parent: int) -> str:
    """What is written to a terminal until it is closed."""
    pieces = []
    with suppress(OSError):  # Linux: the other end is closed
        while piece := os.read(parent, 65536):
            pieces.append(piece)
    return b"".join(pieces).decode()


@pytest.fixture
def on_a_terminal(monkeypatch):
    """What is printed for a fit on a terminal of some width and with some environment."""
    pty = pytest.importorskip("pty")
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")

    def show(fitted, columns=100, **env):
        parent, child = pty.openpty()
        with ThreadPoolExecutor(1) as reader:
            everything = reader.submit(_all_from, parent)
            with monkeypatch.context() as patched, os.fdopen(child, "w", encoding="utf-8") as terminal:
                for name, value in {"COLUMNS": str(columns), **env}.items():
                    patched.setenv(name, value)
                patched.setattr(sys, "stdout", terminal)
                assert answer(document_with_next_step(fitted, COMMAND), {}, json=False, verbose=False) == 0
            text = everything.result(timeout=60)
        os.close(parent)
        return text.replace("\r\n", "\n")

    return show


def rows(text: str) -> list[str]:
    """The lines but for the command to paste and the files, which may be long."""
    return [line for line in text.splitlines() if not line.startswith(("  clutchid ", "written: "))]


@pytest.fixture(scope="module")
def fitted(drive, with_noise):
    """A fit of 4 s by the model that made them, as if read from a calibration."""
    return with_baseline(fit(with_noise(drive, 1).slice(0, 4000)))


@pytest.fixture(scope="module")
def truck(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where a virtual truck has been calibrated from 5 s, CAL.toml, and has a worn recording."""
    folder, shown = tmp_path_factory.mktemp("my truck"), StringIO()
    write(drive(Truck(), seconds=5.0, seed=1).log, folder / "my cal.csv")
    write(drive(Truck(), seconds=3.0, seed=2, pressure=False).log, folder / "my worn.csv")
    with chdir(folder), redirect_stdout(shown):
        assert called("calibrate", "my cal.csv", "--save", "my CAL.toml") == 0
    (folder / "calibrated.txt").write_text(shown.getvalue(), encoding="utf-8")
    return folder


def shown(fitted, capsys, *, verbose=False, command=COMMAND, writers=None):
    """Exit code, and what is printed on standard output and standard error."""
    code = answer(document_with_next_step(fitted, command), writers or {}, json=False, verbose=verbose)
    return code, *capsys.readouterr()


def test_a_summary_has_few_lines_of_at_most_80_columns_and_a_command(fitted, capsys):
    code, out, err = shown(fitted, capsys)
    assert (code, err) == (0, "")
    assert ESCAPE not in out
    lines = out.splitlines()
    assert len(lines) <= 14
    assert max(map(len, lines)) <= 80
    assert [line[:9].strip() for line in lines if line[:9].strip()] == [
        "trust", "load", "since", "errors", "next", "clutchi"
    ]  # fmt: skip
    assert shlex.split(lines[-1])[:2] == ["clutchid", "fit"]


@pytest.mark.parametrize("verbose", [False, True])
def test_long_names_and_sentences_are_wrapped_and_their_marks_are_text(fitted, capsys, verbose):
    (recording,) = fitted.recordings.values()
    name = "[red]a[/red] :smile: \x1b[31m\n" + "long" * 40
    named = replace(
        fitted,
        recordings={name: recording},
        baseline=replace(fitted.baseline, origin=Origin(name, name, name, name), converged=False),
        verification={name: recording},
        notes=(f"{name} has a note",),
    )
    _, out, err = shown(replace(named, readings={name: named}), capsys, verbose=verbose)
    assert ESCAPE not in out + err
    assert "[red]a[/red] :smile: ?[31m" in out.replace("\n", " ")
    assert max(map(len, rows(out))) <= 80


def test_verbose_says_nothing_twice(fitted, capsys):
    named = replace(fitted, converged=False, warnings=(f"the search {fitted.message}.", "2 s are missing"))
    _, out, err = shown(named, capsys, verbose=True)
    lines = [line for line in (*out.splitlines(), *err.splitlines()) if line.strip()]
    assert len(lines) == len(set(lines))
    together = " ".join((out + err).split())
    for once in (*named.verdict.reasons, named.message, "2 s are missing", f"{named.errors.position_rms * 1e3:.3f} mm"):
        assert together.count(once) == 1, once


def test_few_warnings_are_shown_and_all_in_verbose(fitted, capsys):
    warned = replace(fitted, warnings=tuple(f"warning number {i} " + "is long " * 12 for i in range(7)))
    _, _, err = shown(warned, capsys)
    assert err.count("warning: ") == MOST_WARNINGS
    assert err.splitlines()[-1] == f"{7 - MOST_WARNINGS} more warnings: --verbose"
    assert max(map(len, err.splitlines())) <= 80
    _, _, err = shown(warned, capsys, verbose=True)
    assert err.count("warning: ") == 7
    assert "more" not in err
    warned = replace(fitted, warnings=warned.warnings[: MOST_WARNINGS + 1])
    assert shown(warned, capsys)[2].splitlines()[-1] == "1 more warning: --verbose"


def test_the_files_are_written_though_nobody_reads_what_is_printed(fitted, capsys, tmp_path, monkeypatch):
    good = tmp_path / "CAL.toml"
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w", encoding="utf-8") as closed:
        monkeypatch.setattr(sys, "stdout", closed)
        writers = {good: lambda path: path.write_text("done")}
        with pytest.raises(OutputLost):
            answer(document_with_next_step(fitted, COMMAND), writers, json=False, verbose=False)
    assert good.read_text() == "done"


def test_a_file_that_cannot_be_written_does_not_cost_the_result(fitted, capsys, tmp_path):
    def full(path):
        raise ExportError(f"{path}: no space left\x1b[31m")

    good = tmp_path / "page.html"
    writers = {Path("F.toml"): full, good: lambda path: path.write_text("done"), None: full}
    code, out, err = shown(fitted, capsys, writers=writers)
    assert code == 1
    assert "trust" in out
    assert f"written: {good}" in out
    assert err == "clutchid: the fit is complete, but F.toml: no space left?[31m\n"
    assert "next" not in out
    assert answer(document_with_next_step(fitted, COMMAND), writers, json=True, verbose=False) == 1
    content = json.loads(capsys.readouterr().out)
    assert content["status"] == "failed"
    assert content["message"].startswith("the fit is complete, but F.toml")
    assert content["load_curve"]["force_N"]


def without_colour(text):
    return re.sub(r"\x1b\[[\d;]*m", "", text)


def test_only_the_trust_is_coloured_and_only_on_a_terminal(fitted, capsys, on_a_terminal):
    colour = re.compile(r"\x1b\[(?:\d+;)*3([0-7])m")
    _, piped, _ = shown(fitted, capsys)
    assert ESCAPE not in piped
    coloured = on_a_terminal(fitted)
    assert colour.findall(coloured) == ["2"]  # green
    assert without_colour(coloured) == piped
    assert colour.findall(on_a_terminal(replace(fitted, converged=False))) == ["3"]  # yellow
    assert colour.findall(on_a_terminal(fitted, NO_COLOR="1")) == []
    assert ESCAPE not in on_a_terminal(fitted, TERM="dumb")


def test_rows_are_as_wide_as_a_narrow_terminal(fitted, on_a_terminal):
    doubtful = replace(fitted, converged=False, baseline=replace(fitted.baseline, converged=False))
    lines = without_colour(on_a_terminal(doubtful, columns=50)).splitlines()
    assert max(len(line) for line in lines if line.startswith(("trust", "load", "since", "errors"))) <= 50


def test_each_next_command_runs_as_it_is_printed(truck, command):
    calibrated = (truck / "calibrated.txt").read_text(encoding="utf-8")
    assert max(map(len, rows(calibrated))) <= 80
    assert len(rows(calibrated)) <= 14
    words = shlex.split(calibrated.splitlines()[-1])
    assert words == ["clutchid", "estimate", "WORN.csv", "--start", "my CAL.toml"]
    read = command(*words[1:2], "my worn.csv", *words[3:], "--save=my worn.toml", "--report=my worn.html", cwd=truck)
    assert read.returncode == 0, read.stderr
    assert "half-load position" in read.stdout
    assert max(map(len, rows(read.stdout))) <= 80
    assert "New against worn" in (truck / "my worn.html").read_text(encoding="utf-8")
    words = shlex.split(read.stdout.splitlines()[-1])
    assert words[:3] == ["clutchid", "simulate", "my worn.csv"]
    process = command(*words[1:], cwd=truck)
    assert process.returncode == 0, process.stderr
    assert (truck / "my worn-pressure.csv").exists()


def test_recordings_of_one_wear_are_of_one_state_and_of_another_wear_of_two(truck):
    calibrated = read_parameters(truck / "my CAL.toml")

    def read(wear: float, seed: int, change: str = "") -> Fit:
        """Another manoeuvre, noise and air supply by the seed, after something has changed."""
        made = drive(Truck(), seconds=3.0, seed=seed, wear=wear, pressure=False, change=change or ())
        log = replace(made.log, name=f"{1e3 * wear:g} mm, {seed}")
        return fit(log, calibrated.actuator, free="load", request=FitRequest(calibration=calibrated.calibration))

    def states(*readings: Fit) -> WearStates | None:
        return states_of_wear(
            replace(readings[0], readings={next(iter(reading.recordings)): reading for reading in readings})
        )

    slight = read(0.5e-3, 11), read(0.5e-3, 13, "supply")
    worn = read(2.5e-3, 21), read(2.5e-3, 22)
    assert states(*slight) is None
    assert states(*worn) is None
    assert all(states(first, other) is not None for first in slight for other in worn)
    assert [len(group) for group in states(*slight, *worn).groups] == [2, 2]


def test_recordings_read_together_are_read_alone_too_without_parameters_of_the_others(truck, command):
    (truck / "other.csv").write_bytes((truck / "my worn.csv").read_bytes())
    own = ("--free", "load,P_S@other", "--prior", "P_S@other=9e5±1e4")
    process = command("fit", "my worn.csv", "other.csv", "--start", "my CAL.toml", *own, "--json", cwd=truck)
    assert process.returncode == 0, process.stdout
    content = json.loads(process.stdout)
    assert set(content["readings"]) == {"my worn", "other"}
    assert "P_S@other" in content["parameters"]
    assert content["calibration"]["name"] == "my CAL.toml"
    assert len(content["calibration"]["sha256"]) == 64
    assert np.isfinite(content["load_change"]["difference_N"]).all()
    assert content["states_of_wear"] is None
