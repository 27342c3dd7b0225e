"""The command line as a user meets it: exit codes, one JSON object, nothing half-written; some as real processes."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO, TextIOWrapper
from pathlib import Path

import numpy as np
import pytest

import clutchid
from clutchid.cli.common import guarded
from clutchid.estimation.assess import evidence
from fixtures.commands import called

pytestmark = pytest.mark.slow

Command = Callable[..., subprocess.CompletedProcess[str]]

KEYS = {"status", "message", "parameters", "load_curve", "errors", "logs", "warnings"}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six seconds that the paper's own model made: strokes with different reach, 30 µm of noise."""
    t = np.arange(6000) * 1e-3
    phase = t % 1.5
    supply = np.where(phase < 0.05 + 0.02 * np.floor(t / 1.5), 0.9, 0.0)
    exhaust = np.where(phase > 0.6, 0.5, 0.0)
    log = clutchid.Log(t, {"duty_supply": supply, "duty_exhaust": exhaust})
    truth = clutchid.Actuator(load=clutchid.Load((8.5e5, -2e4, 1e5)))
    made = clutchid.simulate(truth, log).log
    noise = np.random.default_rng(1).normal(0, 3e-5, t.size)
    path = tmp_path_factory.mktemp("cli") / "strokes.csv"
    columns = {"position": made["position"] + noise, "duty_supply": supply, "duty_exhaust": exhaust}
    clutchid.write(clutchid.Log(t, columns), path)
    return path


def test_fit_finds_the_load_and_prints_one_json_object(command: Command, recording: Path) -> None:
    process = command("fit", recording, "--json")
    assert process.returncode == 0, process.stderr
    answer = json.loads(process.stdout)
    assert answer.keys() >= KEYS
    theta = answer["parameters"]["theta_1"]
    assert theta["unit"] == "N/m"
    assert theta["low"] <= 8.5e5 <= theta["high"]
    curve = answer["load_curve"]
    assert curve.keys() == {"position_m", "force_N", "low_N", "high_N"}
    assert {len(value) for value in curve.values()} == {101}
    assert (curve["position_m"][0], curve["position_m"][-1]) == (0, pytest.approx(0.025))
    assert answer["errors"]["position_rms_m"] == pytest.approx(3e-5, rel=0.05)
    assert answer["errors"]["pressure_a_rms_Pa"] is None
    assert answer["logs"].keys() == {"strokes"}


def test_a_saved_fit_starts_a_fit_and_a_simulation(command: Command, recording: Path, tmp_path: Path) -> None:
    saved, out = tmp_path / "fit.toml", tmp_path / "sim.parquet"
    assert command("fit", recording, "--save", saved).returncode == 0
    again = command("fit", recording, "--start", saved, "--json")
    assert again.returncode == 0, again.stderr
    first = clutchid.read_parameters(saved).actuator
    for name, estimate in json.loads(again.stdout)["parameters"].items():
        assert abs(estimate["value"] - first.value(name)) < 1e-2 * estimate["std"]
    process = command("simulate", recording, "--parameters", saved, "--out", out)
    assert process.returncode == 0, process.stderr
    simulated = clutchid.read(out)
    assert set(simulated.columns) == {
        "position", "duty_supply", "duty_exhaust", "velocity", "pressure_a", "pressure_b", "deflection",
    }  # fmt: skip
    rms = np.sqrt(np.mean((simulated["position"] - clutchid.read(recording)["position"]) ** 2))
    assert rms == pytest.approx(3e-5, rel=0.05)


def test_what_a_verdict_rests_on_is_computed_once(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls, plain = [], evidence.diagnosed
    monkeypatch.setattr(evidence, "diagnosed", lambda *fit: calls.append(fit) or plain(*fit))
    for option in (["--json"], []):
        page = tmp_path / f"page{len(option)}.html"
        assert called("fit", recording, "--report", page, *option) == 0
        assert "trust" in capsys.readouterr().out
        assert page.exists()
    assert len(calls) == 2


def test_start_values_that_blow_up_the_simulation_fail_with_time_and_state(
    command: Command, recording: Path, tmp_path: Path
) -> None:
    start = tmp_path / "start.toml"
    start.write_text("[parameters]\ntheta_2 = -1e9\n")
    process = command("fit", recording, "--start", start, "--json")
    answer = json.loads(process.stdout)
    assert (process.returncode, answer["status"]) == (1, "failed")
    assert " s in " in answer["message"]
    assert " M = 10 kg" in answer["message"]


@pytest.mark.parametrize("arguments", [["--free", "C_sv"], ["--nonsense"]])
def test_debug_shows_the_traceback_and_keeps_the_exit_code_and_the_object(
    command: Command, recording: Path, arguments: list[str]
) -> None:
    for options in (["--debug"], ["--debug", "--json"], ["--json"]):
        process = command("fit", recording, *arguments, *options)
        assert (process.returncode, "Traceback" in process.stderr) == (2, "--debug" in options)
        if "--json" in options:
            answer = json.loads(process.stdout)
            assert (answer["status"], answer.keys() >= KEYS) == ("bad_input", True)
        else:
            assert process.stderr.splitlines()[-1].startswith("clutchid: ")


def test_an_error_that_was_not_expected_is_told_in_every_way(capsys: pytest.CaptureFixture[str]) -> None:
    @guarded
    def work(*, json: bool, debug: bool) -> int:
        raise ZeroDivisionError("by zero")

    for debug, words in ((False, "Run again with --debug"), (True, "Report it with the traceback")):
        assert work(json=True, debug=debug) == 1
        out, err = capsys.readouterr()
        assert words in json.loads(out)["message"]
        assert ("Traceback" in err) == debug


def test_results_are_printed_whatever_the_encoding_of_the_terminal(
    command: Command, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    odd, terminal = tmp_path / "strøm \u2192.csv", TextIOWrapper(BytesIO(), encoding="ascii", errors="strict")
    odd.write_bytes(recording.read_bytes())
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stdout", terminal)
        assert called("fit", odd, "--verbose") == 0
    assert b"fitted str?m ?: position" in terminal.buffer.getvalue()
    process = command("fit", odd, "--json")
    assert json.loads(process.stdout)["logs"].keys() == {odd.stem}
    assert process.stdout.isascii()


def test_a_simulation_tells_the_warnings_of_the_recording(command: Command, recording: Path, tmp_path: Path) -> None:
    lines = recording.read_text().splitlines()
    holed, start = tmp_path / "holed.csv", tmp_path / "p.toml"
    holed.write_text("\n".join([lines[0], *lines[1:3000], *lines[3100:]]) + "\n")
    start.write_text("[parameters]\ntheta_1 = 8.5e5\ntheta_2 = -2e4\ntheta_3 = 1e5\n")
    arguments = ("simulate", holed, "--parameters", start, "--out", tmp_path / "s.csv")
    process = command(*arguments, "--json")
    answer = json.loads(process.stdout)
    assert (process.returncode, answer["status"]) == (0, "warning")
    assert clutchid.read(holed).warnings
    assert set(clutchid.read(holed).warnings) <= set(answer["warnings"])
    assert len(set(answer["warnings"])) == len(answer["warnings"])
    process = command(*arguments)
    assert process.stderr.splitlines() == [f"warning: {warning}" for warning in answer["warnings"]]
    said, written = process.stdout.splitlines()
    assert said.startswith("simulated holed: position ")
    assert written.startswith("written: ")


def test_starts_are_used_for_the_very_recording_that_they_were_estimated_from(
    command: Command, recording: Path, tmp_path: Path
) -> None:
    lines = recording.read_text().splitlines()
    moving, saved, out = tmp_path / "moving.csv", tmp_path / "fit.toml", tmp_path / "s.csv"
    moving.write_text("\n".join([lines[0], *lines[200:]]) + "\n")
    assert command("fit", moving, "--save", saved).returncode == 0
    arguments = ("simulate", moving, "--parameters", saved, "--out", out, "--json")
    content = clutchid.read_parameters(saved)
    shifted = replace(content, starts={"moving": tuple((y + 1e-3, p) for y, p in content.starts["moving"])})
    clutchid.write_parameters(shifted, saved)
    assert json.loads(command(*arguments).stdout)["warnings"] == []
    assert clutchid.read(out)["position"][0] == pytest.approx(shifted.starts["moving"][0][0], abs=1e-9)
    moving.write_text("\n".join([lines[0], *lines[200:-1]]) + "\n")
    answer = json.loads(command(*arguments).stdout)
    assert answer["status"] == "warning"
    assert "estimated again" in answer["warnings"][0]
    assert clutchid.read(out)["position"][0] == pytest.approx(content.starts["moving"][0][0], abs=1e-4)


def test_the_files_model_wins_over_another_one(command: Command, recording: Path, tmp_path: Path) -> None:
    path = tmp_path / "start.toml"
    path.write_text("[model]\nvariant = 'isothermal'\n")
    process = command("fit", recording, "--start", path, "--model", "energy-balance")
    assert process.returncode == 2
    assert "leave --model out" in process.stderr


def test_warm_commands_import_neither_sympy_nor_matplotlib_and_a_look_no_linear_algebra(recording: Path) -> None:
    code = (
        "import sys; from clutchid.cli import main\n"
        "for command in ('look', 'fit'):\n"
        "    try: main([command, sys.argv[1]])\n"
        "    except SystemExit as end: assert end.code == 0\n"
        "    assert command == 'fit' or {'numba', 'scipy.linalg'} & set(sys.modules) == {'numba'}\n"
        "heavy = {'sympy', 'matplotlib', 'jinja2', 'polars'} & set(sys.modules); assert not heavy, heavy"
    )
    command = [sys.executable, "-c", code, str(recording)]
    process = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert process.returncode == 0, process.stderr
