"""A pneumatic cylinder: a real measurement of an actuator with one chamber and one 3/2 valve.

The valve's command was not recorded. Its times were read off the measured pressure, so what is shown here is how well
the pressure follows from the valve's times and the position, not that those times are known.
"""

from __future__ import annotations

import csv
import importlib.util
import re
import shlex
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from clutchid import Fit, FitRequest, Log, Partition, fit, simulate
from clutchid.cli import main
from clutchid.estimation.assess.diagnostics import fit_percent
from clutchid.measurements import read

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT.parent / "shared" / "data" / "wbident_pneumatic_cylinder" / "cylinder_1kHz.csv"


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    """The benchmark, whose fits are tested here."""
    spec = importlib.util.spec_from_file_location("cylinder", ROOT / "benchmarks" / "cylinder.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def halves(bench: ModuleType) -> tuple[Log, Log]:
    """The first 4 s of the recording, and the 4 s after them."""
    if not FILE.is_file():
        pytest.skip(f"no {FILE.parent.name} beside the repository: the recording of a cylinder is needed.")
    whole = bench.recording(FILE)
    return bench.part(whole, 0.0, "first"), bench.part(whole, 4.0, "later")


@pytest.fixture(scope="module")
def air(bench: ModuleType, halves: tuple[Log, Log]) -> Fit:
    """Supply, valve and dead volume, with the position as input."""
    return bench.fitted_air(halves[0])


@pytest.fixture(scope="module")
def motion(bench: ModuleType, halves: tuple[Log, Log], air: Fit) -> Fit:
    """Area and friction, ballistic."""
    return bench.fitted_motion(halves[0], air.actuator, halves[1])


def test_the_chamber_pressure_follows_from_the_measured_position_over_four_seconds(bench, halves, air):
    # 91 % is what the issue asks of the fitted seconds; those that were not fitted are as good
    for log in halves:
        simulated = simulate(air.actuator, log, partition=bench.INPUT).log
        assert fit_percent(log["pressure_a"], simulated["pressure_a"]) > 91.0


def test_position_and_pressure_are_simulated_together_over_four_seconds(motion):
    run = motion.recordings["first"]
    assert fit_percent(run.measured["position"], run.simulated["position"]) > 75.0
    assert fit_percent(run.measured["pressure_a"], run.simulated["pressure_a"]) > 89.0
    later = motion.verification["later"]
    # friction differs from stroke to stroke, which the position adds up and the pressure does not
    assert fit_percent(later.measured["pressure_a"], later.simulated["pressure_a"]) > 89.0


def test_the_pressure_comes_back_from_the_position_alone_within_its_band(bench, halves, motion):
    first, later = halves
    banded = bench.from_position(motion.actuator, later, first)
    assert fit_percent(later["pressure_a"], banded["pressure_a"]) > 91.0
    inside = (later["pressure_a"] >= banded["pressure_a low"]) & (later["pressure_a"] <= banded["pressure_a high"])
    pulse = later["pressure_a"] > bench.PULSE
    # 95 % is promised; the four pulses of the known seconds know the 95 % quantile of a group of n samples no better
    # than sqrt(0.95 0.05 / 4) = 11 %, were the samples of a pulse all alike
    assert inside.mean() > 0.95 - 0.11
    assert inside[pulse].mean() > 0.95 - 0.11
    half = (banded["pressure_a high"] - banded["pressure_a low"])[pulse] / 2
    assert half.mean() < 0.1 * (first["pressure_a"].max() - first["pressure_a"].min())


def test_the_simulation_with_the_position_as_input_does_not_look_at_the_measured_pressure(bench, halves, air):
    log = halves[0]
    blind = Log(log.time, {name: log[name] for name in ("position", "duty_supply")}, log.name)
    seen, unseen = (simulate(air.actuator, log_of_run, partition=bench.INPUT).log for log_of_run in (log, blind))
    assert np.array_equal(seen["pressure_a"], unseen["pressure_a"])


def test_a_fit_that_takes_the_pressure_at_every_reset_only_predicts_one_sample_ahead(bench, halves):
    start = bench.read_parameters(bench.ACTUATOR).actuator
    taken = Partition(every=1, carry="q")
    short = fit(halves[0], start, measure=("pressure_a",), free=("P_S",), request=FitRequest(partition=taken))
    open_loop = fit(halves[0], start, measure=("pressure_a",), free=("P_S",), request=FitRequest(partition=bench.INPUT))
    # one sample after it was measured the pressure is much the same, whatever the supply is thought to be
    assert short.errors.pressure_a_rms < 0.5 * open_loop.errors.pressure_a_rms


def test_the_commands_of_the_documentation_run_as_they_stand(bench, halves, tmp_path, monkeypatch, capsys):
    page = (ROOT / "docs" / "actuators.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```sh\n(.*?)```", page, re.DOTALL)
    lines = block.replace("\\\n", " ").splitlines()
    commands = [words[1:] for words in map(shlex.split, lines) if words and words[0] == "clutchid"]
    assert len(commands) == 4
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cylinder.toml").write_bytes((ROOT / "docs" / "actuators" / "cylinder.toml").read_bytes())
    for name, log in zip(("FIRST", "LATER"), halves, strict=True):
        _as_measured(log, tmp_path / f"{name}.csv", pressure=name == "FIRST")
    for words in commands:
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 0, capsys.readouterr().err
    pressure = read(tmp_path / "PRESSURE.csv")
    assert fit_percent(halves[1]["pressure_a"], pressure["pressure_a"]) > 91.0
    assert np.all(pressure["pressure_a low"] < pressure["pressure_a high"])


def _as_measured(log: Log, path: Path, pressure: bool) -> None:
    """A file with the units of the measurement, and no column for the exhaust."""
    columns = {"time [s]": log.time, "position [mm]": log["position"] * 1e3, "duty_supply [1]": log["duty_supply"]}
    if pressure:
        columns["pressure_a [bar(g)]"] = (log["pressure_a"] - 1e5) / 1e5
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
