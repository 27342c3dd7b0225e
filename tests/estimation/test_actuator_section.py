"""Actuator files: a parameter file that says which chambers and valves there are."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from clutchid import fit, read_parameters, write_parameters
from clutchid.errors import ParameterError
from clutchid.estimation.parameter_file import ParameterFile
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.model.equipment import Equipment
from clutchid.simulation import simulate
from fixtures.cases import case_tables

CASES = case_tables(__file__, "refusals")

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "actuators" / "cylinder.toml"
DRAWING = "[parameters]\nA_A = 3e-4\nV_0A = 4e-5\nM = 1.5\ny_max = 0.1\n"


def made(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_the_example_of_the_documentation_is_a_cylinder_under_a_constant_load():
    actuator = read_parameters(EXAMPLE).actuator
    assert (actuator.equipment.chamber_b, actuator.equipment.valves) == (False, "3/2")
    assert actuator.load.force(np.array([0.0, 0.06, 0.125])).round(9).tolist() == [14.4, 14.4, 14.4]
    assert actuator.value("C_r") == 0.0


def test_the_gravity_load_of_the_example_is_the_weight_of_its_mass():
    text = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
    # printed to a tenth of a newton
    assert abs(text["actuator"]["gravity_load"] - 9.81 * text["parameters"]["M"]) < 0.05


def test_a_saved_actuator_is_read_as_it_was(tmp_path):
    content = ParameterFile(read_parameters(EXAMPLE).actuator)
    write_parameters(content, tmp_path / "saved.toml")
    assert read_parameters(tmp_path / "saved.toml") == content
    saved = tomllib.loads((tmp_path / "saved.toml").read_text(encoding="utf-8"))
    assert saved["actuator"]["name"] == "vertical cylinder"
    assert "C_r" not in saved["parameters"]
    assert "h_B" not in saved["parameters"]


def test_a_file_of_the_papers_actuator_has_no_section_of_its_own(tmp_path):
    write_parameters(ParameterFile(Actuator()), tmp_path / "saved.toml")
    assert "actuator" not in tomllib.loads((tmp_path / "saved.toml").read_text(encoding="utf-8"))


def test_gravity_on_other_knots_is_the_same_load(tmp_path):
    text = f"[actuator]\nchamber_b = false\ngravity_load = 15\n[model]\nknots = [0.0, 0.03, 0.1]\n{DRAWING}"
    load = read_parameters(made(tmp_path / "a.toml", text)).actuator.load
    assert load.theta == (15.0,) * 5
    assert load.force(np.linspace(0.0, 0.1, 7)).round(9).tolist() == [15.0] * 7


@pytest.mark.parametrize(("text", "words"), CASES["actuators"])
def test_problems_of_an_actuator_file_are_reported(text, words, tmp_path):
    with pytest.raises(ParameterError) as caught:
        read_parameters(made(tmp_path / "a.toml", text))
    assert all(word in str(caught.value) for word in words)


def test_what_does_not_exist_cannot_be_free():
    actuator = read_parameters(EXAMPLE).actuator
    t = np.arange(100) * 1e-3
    log = Log(t, {"position": 0.1 * t, "duty_supply": np.ones(100)})
    with pytest.raises(ParameterError, match=r"C_r: this actuator has no chamber B"):
        fit(log, actuator, free=("C_r",), force=True)


def test_a_fit_of_a_three_way_valve_needs_its_one_column_only_and_finds_the_friction():
    truth = read_parameters(EXAMPLE).actuator
    t = np.arange(2000) * 1e-3
    pulses = np.where(t % 1.0 < 0.08, 1.0, 0.0)
    made_log = simulate(truth, Log(t, {"duty_supply": pulses})).log
    log = Log(t, {"position": made_log["position"], "duty_supply": pulses})
    result = fit(log, truth.replace({"D_v": 24.0}), free=("D_v",))
    # noise-free: what is left is where the search stops, a 1e-9th of a sum of squares of nearly 0
    assert abs(result.parameters["D_v"].value / 30.0 - 1.0) < 1e-5
    assert (
        result.actuator.equipment
        == truth.equipment
        == Equipment(truth.equipment.name, truth.equipment.description, False, "3/2")
    )
