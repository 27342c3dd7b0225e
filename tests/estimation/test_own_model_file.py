"""Parameter files of models of one's own: no code is loaded, and the model must be the one that the file is for."""

import tomllib

import pytest
from sympy import symbols

from clutchid.errors import ParameterError
from clutchid.estimation.parameter_file import ParameterFile, read_parameters, write_parameters
from clutchid.estimation.request import FitRequest
from clutchid.inference.uncertainty.calibration import drift
from clutchid.inference.uncertainty.coordinates import coordinates
from clutchid.model import Actuator, OwnModel, OwnParameter
from clutchid.verbs.start import start_of
from fixtures.sentences import one_sentence

y, f_s, c_r, F_r = symbols("y f_s c_r F_r")
PARAMETERS = {
    "c_r": OwnParameter(4e3, "N/m", "stiffness of the return spring", range=(0, 1e5), std=2e3, drift=20.0),
    "F_r": OwnParameter(0.0, "N", "preload of the return spring", range=(-100, 1e3)),
}
SPRING = OwnModel("isothermal", PARAMETERS, terms={"f_s": f_s + F_r + c_r * y}, name="spring")
CHANGED = OwnModel("isothermal", PARAMETERS, terms={"f_s": f_s + F_r + 2 * c_r * y}, name="spring")


@pytest.fixture
def saved(tmp_path):
    """A saved file, and its text with something else in place of something."""

    def save(old="", new=""):
        path = tmp_path / "fit.toml"
        write_parameters(ParameterFile(Actuator(model=SPRING).replace({"c_r": 5e3}), {"log": ((0.0, 1e5),)}), path)
        path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
        return path

    return save


def test_a_written_file_is_read_as_it_was_with_its_model(saved):
    content = read_parameters(saved(), SPRING)
    assert content.actuator == Actuator(model=SPRING).replace({"c_r": 5e3})
    assert content.starts == {"log": ((0.0, 1e5),)}
    section = tomllib.loads(saved().read_text(encoding="utf-8"))["model"]
    assert (section["variant"], section["own"], section["sha256"]) == ("isothermal", "spring", SPRING.sha256)


def test_a_file_without_a_model_has_values_for_every_model(tmp_path):
    path = tmp_path / "start.toml"
    path.write_text("[parameters]\nP_S = 8e5\nc_r = 6000\n[recording.run]\nF_r = 3.0\n")
    content = read_parameters(path, SPRING)
    assert content.actuator == Actuator(model=SPRING).replace({"P_S": 8e5, "c_r": 6e3})
    assert content.own == {"run": {"F_r": 3.0}}
    with pytest.raises(ParameterError, match="no parameter 'c_r'"):
        read_parameters(path)


@pytest.mark.parametrize(
    ("old", "new", "model", "sentence"),
    [
        ("", "", None, "[model] own = 'spring': the file is for a model of your own, and a parameter file never loads"),
        ("", "", CHANGED, f"[model] sha256 = '{SPRING.sha256[:12]}…': spring has '{CHANGED.sha256[:12]}…'. It is"),
        ("sha256 =", "#", SPRING, "[model] sha256: missing; a file with own = 'spring' needs the hash of its model."),
        ("own =", "#", SPRING, "[model] variant = 'isothermal': the file is for this variant, not for the model"),
        ("c_r = 5000.0", "c_r = 'stiff'", SPRING, "c_r = 'stiff': a number in N/m is needed."),
        ("c_r = 5000.0", "c_r = -1.0", SPRING, "c_r = -1 N/m: it must be at least 0 and at most 100000."),
        ("c_r = 5000.0", "c_R = 5000.0", SPRING, "no parameter 'c_R'; did you mean 'c_r'?"),
    ],
)  # fmt: skip
def test_a_file_for_another_model_is_refused_in_one_sentence(saved, old, new, model, sentence):
    path = saved(old, new)
    message = one_sentence(ParameterError, read_parameters, path, model)
    assert message.startswith(f"{path}: {sentence}")


def test_a_fit_starts_from_a_file_only_with_its_model(saved):
    assert start_of(saved(), FitRequest(), SPRING)[0].value("c_r") == 5e3
    with pytest.raises(ParameterError, match="--model spring"):
        start_of(saved(), FitRequest())
    with pytest.raises(ParameterError, match="never loads code"):
        start_of(saved(), FitRequest(), "isothermal")


def test_own_parameters_have_their_own_prior_and_drift():
    actuator = Actuator(model=SPRING)
    (stiffness,) = coordinates(actuator, ["c_r"], {}, {})
    assert (stiffness.positive, stiffness.mean, stiffness.width) == (True, 4e3, 0.5)
    assert (stiffness.low, stiffness.high) == (0.0, 1e5)
    with pytest.raises(ParameterError, match=r"F_r: there is no default prior; give --prior F_r=VALUE±STD"):
        coordinates(actuator, ["F_r"], {}, {})
    assert (drift(actuator, "c_r"), drift(actuator, "F_r")) == (20.0, 0.0)
