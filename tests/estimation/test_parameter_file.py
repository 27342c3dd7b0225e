"""Parameter files: what is written is read, and every problem is reported in a sentence."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.estimation.parameter_file import ParameterFile, read_parameters, write_parameters
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.variants import VARIANTS
from clutchid.model.weighted_load import DEFAULT_KNOTS
from clutchid.parameters import Parameters
from fixtures.cases import case_tables
from fixtures.sentences import one_sentence

CASES = case_tables(__file__, "test_parameter_file")

#: Weights of a load on two knots.
WEIGHTS = "[parameters]\ntheta_1 = 1.0\ntheta_2 = 2.0\ntheta_3 = 3.0\ntheta_4 = 4.0\n"

KEPT = {"data": {"worn 1": "abc"}}
STARTS = {"worn 1": ((0.0, 109500.0), (0.004, 2.5e5))}


def test_a_file_names_only_what_differs_from_the_appendix(tmp_path):
    path = tmp_path / "start.toml"
    path.write_text("[fit]\nformat = 1\n[parameters]\nP_S = 800000\n[recording.run]\n")
    content = read_parameters(path)
    assert content.actuator == Actuator().replace({"P_S": 8e5})
    assert content.starts == {"run": ()}


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize(
    "load",
    [
        Load((8e5, -1e4, 2e4)),
        Load((8e5, 1 / 3, 1e-17), (0.0, 1e-3, 8e-3, 1.1e-2), 0.001),
        Load.on_b_splines(),
        Load((1.0, 2.0, 3.0, 0.1 + 0.2), (0.0, 0.02), basis="b-spline"),
    ],
    ids=["paper", "other knots and slope", "B-splines", "two knots"],
)
def test_every_variant_with_every_load_is_read_exactly_as_it_was_written(variant, load, tmp_path):
    path = tmp_path / "fit.toml"
    content = ParameterFile(Actuator(Parameters(h_A=1 / 3, R_S=1.7), load, variant), STARTS, KEPT)
    write_parameters(content, path)
    assert read_parameters(path) == content
    model = tomllib.loads(path.read_text(encoding="utf-8"))["model"]
    assert (model["variant"], model["load_basis"]) == (variant, load.basis)
    assert ("phi2_slope" in model) == (load.basis == "paper")


@pytest.mark.parametrize("knots", [None, (0.0, 0.004, 0.01, 0.025)], ids=["usual knots", "own knots"])
def test_b_splines_without_weights_are_those_that_a_search_starts_from(knots, tmp_path):
    path = tmp_path / "start.toml"
    path.write_text(f"[model]\nload_basis = 'b-spline'\n{f'knots = {[*knots]}' if knots else ''}\n")
    assert read_parameters(path).actuator.load == Load.on_b_splines(knots=knots or DEFAULT_KNOTS)


def test_a_file_with_few_knots_and_many_weights_has_one_problem(tmp_path):
    path = tmp_path / "start.toml"
    path.write_text(f"[model]\nload_basis = 'b-spline'\n{WEIGHTS}theta_9 = 1.0\nC_sv = 1e-8\n")
    with pytest.raises(ParameterError) as caught:
        read_parameters(path)
    message = str(caught.value)
    assert "2 problems" in message
    assert "theta" not in message.partition("Known are")[0]
    assert "'C_sv'" in message


@pytest.mark.parametrize(("text", "words"), CASES["texts"])
def test_a_wrong_entry_is_one_sentence_with_the_file(text, words, tmp_path):
    path = tmp_path / "start.toml"
    path.write_text(text)
    message = one_sentence(ParameterError, read_parameters, path)
    assert message.startswith(f"{path}: ")
    for word in words:
        assert word in message


@pytest.mark.parametrize("period", [None, 0.0, 0.01])
def test_what_a_calibration_found_of_the_duty_cycles_is_kept(period, tmp_path):
    actuator = Actuator(duty_period=period)
    write_parameters(ParameterFile(actuator), tmp_path / "a.toml")
    read = read_parameters(tmp_path / "a.toml").actuator
    assert read == actuator
    assert repr(read) == ("Actuator()" if period is None else f"Actuator(duty_period={period})")
    assert ("duty" in (tmp_path / "a.toml").read_text()) == (period is not None)


def test_all_wrong_entries_are_reported_at_once(tmp_path):
    path = tmp_path / "start.toml"
    path.write_text(
        "[model]\nvariant = 5\n[parameters]\nC_sv = 1.0\n[recording]\na = 5\n[recording.b]\npressure = [1.0]\n"
    )
    with pytest.raises(ParameterError) as caught:
        read_parameters(path)
    for word in ("4 problems", "variant", "C_sv", "a = 5", "'pressure'"):
        assert word in str(caught.value)


def test_starts_belong_to_one_file_and_not_to_its_name():
    def log(name: str, **metadata: str) -> Log:
        return Log(np.arange(3.0), {"position": np.zeros(3)}, name, metadata)

    content = ParameterFile(Actuator(), STARTS, KEPT)
    assert content.starts_for(log("worn 1", sha256="abc")) == STARTS["worn 1"]
    assert content.starts_for(log("worn 1", sha256="other")) is None
    assert content.starts_for(log("worn 1")) is None
    assert content.starts_for(log("worn 2", sha256="abc")) is None
    for about in ({}, {"data": 5}, {"data": {"worn 1": 5}}, {"data": {"worn 1": "unknown"}}):
        assert ParameterFile(Actuator(), STARTS, about).starts_for(log("worn 1", sha256="abc")) is None
