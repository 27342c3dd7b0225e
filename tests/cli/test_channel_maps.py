"""A German MDF file as a user meets it: look, save the map, calibrate, and what `next` prints on a worn file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from clutchid import truck as virtual
from clutchid.log import Log
from clutchid.measurements import read
from fixtures.commands import called

asammdf = pytest.importorskip("asammdf", reason="reading MDF is an extra")

#: Ambient pressure in Pa, as that of gauge pressures by default.
AMBIENT = 1.013e5

AS_SAID = "as the lines marked - above say, then check the map with --map.\n"


def in_german(log: Log, path: Path, zero: float = 0.0) -> Path:
    """A log as an MDF 4 file with German names: set point beside the position, pressure in bar from the ambient one.

    The sensor of the pressure has its zero at `zero` in bar.
    """
    late = np.r_[np.full(40, log["position"][0]), log["position"][:-40]]
    channels = {
        "Kupplungsweg_Soll": (1e3 * late, "mm"),
        "Kupplungsweg_Ist": (1e3 * log["position"], "mm"),
        "Tastverhältnis_Belüftung": (100 * log["duty_supply"], "%"),
        "Tastverhältnis_Entlüftung": (100 * log["duty_exhaust"], "%"),
    }
    if "pressure_a" in log:
        channels["Druck_Zylinder"] = ((log["pressure_a"] - AMBIENT) / 1e5 + zero, "bar")
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(v, log.time, unit=unit, name=name) for name, (v, unit) in channels.items()])
        mdf.save(path)
    return path


@pytest.fixture(scope="module")
def log() -> Log:
    """Ten seconds of a virtual truck with pressure."""
    return virtual.drive(virtual.truck(7), seconds=10, seed=7, name="cal").log


@pytest.fixture(scope="module")
def worn() -> Log:
    """The same truck when its facing has lost 1.5 mm, without pressure."""
    return virtual.drive(virtual.truck(7), seconds=4, seed=1, wear=1.5e-3, pressure=False, name="worn").log


@pytest.mark.slow
def test_look_checks_with_the_map_that_it_proposes(tmp_path, log, capsys):
    file = in_german(log, tmp_path / "Messung.mf4")
    assert called("look", file, "--save", tmp_path / "MAP.toml") == 0
    printed = capsys.readouterr().out
    assert printed.endswith(f"Confirm the guessed units, {AS_SAID}")
    said = " ".join(printed.split())
    for words in (
        "position Kupplungsweg_Ist",
        "motion for 10 s good",
        r"so that the gauge unit \[bar\(g\)\] is guessed instead of \[bar\]",
        "Messung with the proposed channel map: 14 checks",
        r"unit of pressure_a [\d.e+]+ to [\d.e+]+ Pa good",
        "supply pressure not recorded: an estimate assumes that of its calibration within",
        "air temperature not recorded: an estimate assumes that of its calibration within",
    ):
        assert re.search(words, said)
    assert "would match as well" not in said


def test_a_map_reads_a_file_that_lacks_its_pressure_unless_that_is_measured(tmp_path, log, worn, capsys):
    chosen, second = tmp_path / "MAP.toml", in_german(worn, tmp_path / "worn.mf4")
    assert called("look", in_german(log, tmp_path / "cal.mf4"), "--save", chosen) == 0
    log_of_map = read(second, channels=chosen)
    assert "pressure_a" not in log_of_map
    assert "pressure_a: this file has no channel 'Druck_Zylinder' and is read without it." in log_of_map.warnings
    assert called("fit", second, "--map", chosen, "--measure", "position,pressure_a") == 2
    assert "pressure_a: there is no channel 'Druck_Zylinder'" in capsys.readouterr().err
    assert called("look", second, "--map", chosen) == 0
    assert "is read without it." in capsys.readouterr().out
    lost = chosen.read_text().replace("Kupplungsweg_Ist", "Kupplungsweg_Istwert")
    chosen.write_text(lost)
    assert called("fit", second, "--map", chosen) == 2
    assert "position: there is no channel 'Kupplungsweg_Istwert'" in capsys.readouterr().err


def test_a_proposal_that_lacks_the_valves_names_candidates_and_says_that_it_is_not_complete(tmp_path, log, capsys):
    file, chosen = tmp_path / "Messung.mf4", tmp_path / "MAP.toml"
    channels = {
        "Kupplungsweg": (25.7 - 1e3 * log["position"], "mm"),
        "Ventil_auf": (100 * log["duty_supply"], "%"),
        "Ventil_zu": (100 * log["duty_exhaust"], "%"),
        "Druck_A": (log["pressure_a"] / 1e5, "bar"),
        "Aussentemperatur": (np.full(len(log), 20.0), "°C"),
    }
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(v, log.time, unit=unit, name=name) for name, (v, unit) in channels.items()])
        mdf.save(file)
    assert called("look", file, "--save", chosen) == 0
    said = capsys.readouterr().out
    assert "  pressure_a           Druck_A\n  temperature_ambient  Aussentemperatur\n" in said
    assert "duty_supply: no channel name matches; add it to the map (candidates: 'Ventil_auf', 'Ventil_zu')." in said
    assert "without both duty cycles the supply pressure cannot be checked" in said
    assert said.endswith(f"Add duty_supply and duty_exhaust, {AS_SAID}")
    assert "\n# duty_supply: no channel name matches; add it to the map (candidates:" in chosen.read_text()
    chosen.write_text(
        chosen.read_text() + '[duty_supply]\nchannel = "Ventil_auf"\n[duty_exhaust]\nchannel = "Ventil_zu"\n'
    )
    assert called("calibrate", file, "--map", chosen) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "in a channel map sign = -1, and an offset by which the end at 25.7 mm becomes 0" in said
