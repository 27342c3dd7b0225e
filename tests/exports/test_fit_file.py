"""Files for MATLAB: values to the last bit, and names and texts that MATLAB accepts."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from sympy import symbols

from clutchid.errors import ExportError, ParameterError
from clutchid.estimation import Fit
from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.parameter_file import read_parameters
from clutchid.estimation.result import Change
from clutchid.exports.fit_file import write_matlab
from clutchid.inference.uncertainty.estimates import Estimate
from clutchid.log import Log
from clutchid.measurements import write
from clutchid.model import Actuator, Load, OwnModel, OwnParameter
from clutchid.model.equipment import Equipment
from fixtures.baselines import with_baseline
from fixtures.programs import path_of


def loaded(path: Path) -> dict:
    """The struct in a file, as dictionaries."""
    return loadmat(path, simplify_cells=True)["clutchid"]


@pytest.fixture
def odd(fitted: Fit) -> Fit:
    """A fit of two recordings with a parameter of their own, an interval without end, and names that need care."""
    (recording,) = fitted.recordings.values()
    own = {f"F_C@{stem}": Estimate(60.0 + i, "N", 0.1, -np.inf, np.inf) for i, stem in enumerate(("a", "Bär's\n'); x"))}
    return replace(
        fitted,
        message="it's 90 % done;\nend",
        parameters={**fitted.parameters, **own},
        recordings={"a": recording, "Bär's\n'); x": replace(recording, starts=((0.001, 2e5), (0.0021, 3e5)))},
    )


def test_the_table_is_the_load_curve_and_the_parameters_are_those_of_the_fit(fitted: Fit, tmp_path: Path) -> None:
    write_matlab(fitted, tmp_path / "worn.mat")
    content, curve = loaded(tmp_path / "worn.mat"), fitted.load_curve
    columns = {"position_m": curve.position, "force_N": curve.force, "low_N": curve.low, "high_N": curve.high}
    for key, values in columns.items():
        assert np.array_equal(content["load"][key], values)
    assert tuple(content["load"]["knots_m"]) == fitted.actuator.load.knots
    assert tuple(content["load"]["weights"]) == fitted.actuator.load.theta
    assert content["load"]["phi2_slope"] == 1.0
    assert content["model"] == {"variant": "isothermal"}
    assert content["parameters"].keys() == set(fitted.actuator.names)
    for key, entry in content["parameters"].items():
        assert entry["value"] == fitted.actuator.value(key)
        estimate = fitted.parameters.get(key)
        expected = (estimate.std, estimate.low, estimate.high) if estimate else (np.nan,) * 3
        assert np.array_equal([entry["std"], entry["low"], entry["high"]], expected, equal_nan=True)
    assert content["parameters"]["C_vs"]["unit"] == "m^3/(Pa*s)"
    assert content["created_by"].startswith("clutchid ")


def test_the_reach_and_the_warnings_are_there(fitted: Fit, tmp_path: Path) -> None:
    warned = replace(fitted, warnings=("theta_3 lies at its lower bound 0 N/m.", "a second one."))
    write_matlab(warned, tmp_path / "worn.mat")
    content = loaded(tmp_path / "worn.mat")
    assert list(content["warnings"]) == list(warned.warnings)
    assert content["load"]["reach_m"] == reach(fitted)
    write_matlab(fitted, tmp_path / "worn.mat")
    assert len(loaded(tmp_path / "worn.mat")["warnings"]) == len(fitted.warnings)


def test_a_recording_and_a_fit_have_no_variable_in_common(fitted: Fit, tmp_path: Path) -> None:
    write_matlab(fitted, tmp_path / "worn.mat")
    write(Log(np.arange(3.0), {"position": np.zeros(3)}, metadata={"truck": "7"}), tmp_path / "states.mat")
    ours = [set(loadmat(tmp_path / name)) for name in ("worn.mat", "states.mat")]
    assert {variable for variable in ours[0] & ours[1] if not variable.startswith("__")} == set()


def test_recordings_have_their_hash_initial_states_and_own_parameters(odd: Fit, tmp_path: Path) -> None:
    write_matlab(odd, tmp_path / "odd.mat")
    content = loaded(tmp_path / "odd.mat")
    assert content["message"] == "it's 90 % done; end"
    first, other = content["recordings"]
    assert (first["name"], first["sha256"]) == ("a", "abc123")
    assert other["name"] == "Bar's '); x"
    assert ([*other["position_start_m"]], [*other["pressure_a_start_Pa"]]) == ([0.001, 0.0021], [2e5, 3e5])
    assert other["parameters"]["F_C"]["value"] == 61.0
    assert other["parameters"]["F_C"]["high"] == np.inf


@pytest.fixture
def compared(fitted: Fit) -> Fit:
    """A fit as if it had started from a calibration, with two changes, and not to be trusted without care."""
    values = {"D_v": (2100.0, 2570.0, 35.0, "N·s/m"), "T_0": (293.0, 277.3, 0.9, "K")}
    changes = tuple(Change("first", name, *value, 0.993, "temperature") for name, value in values.items())
    return with_baseline(replace(fitted, converged=False, changes=changes))


def test_a_result_carries_its_verdict_the_calibrated_load_and_what_has_changed(compared: Fit, tmp_path: Path) -> None:
    write_matlab(compared, tmp_path / "worn.mat")
    content = loaded(tmp_path / "worn.mat")
    assert content["trust"] == compared.verdict.trust == "with care"
    assert [*np.atleast_1d(content["reasons"])] == [*compared.verdict.reasons]
    assert content["calibration"]["name"] == "CAL.toml"
    calibrated = compared.comparison.calibrated
    assert np.array_equal(content["calibrated_load_curve"]["force_N"], calibrated.force)
    assert np.array_equal(content["load_change"]["difference_N"], compared.load_curve.force - calibrated.force)
    assert content["load_change"]["half_load"]["shift"]["position_m"] == compared.comparison.shift.position
    assert [change["name"] for change in content["changes"]] == ["D_v", "T_0"]
    assert {**content["changes"][0]} == {
        "recording": "first", "name": "D_v", "before": 2100.0, "after": 2570.0, "std": 35.0, "unit": "N*s/m",
        "probability": 0.993,
    }  # fmt: skip
    assert [*content["covariance"]["names"]] == [*compared.parameters]
    assert np.array_equal(content["covariance"]["matrix"], compared.covariance)


def test_without_a_calibration_nothing_is_compared(fitted: Fit, tmp_path: Path) -> None:
    write_matlab(fitted, tmp_path / "fit.mat")
    content = loaded(tmp_path / "fit.mat")
    assert np.size(content["changes"]) == 0
    assert not {"calibration", "calibrated_load_curve", "load_change"} & content.keys()


def test_the_table_interpolates_the_load_to_a_thousandth_of_its_peak(tmp_path: Path, fitted: Fit) -> None:
    write_matlab(fitted, tmp_path / "worn.mat")
    table = loaded(tmp_path / "worn.mat")["load"]
    y = np.linspace(0.0, fitted.actuator.parameters.y_max, 20_001)
    force = fitted.actuator.load.force(y)
    error = np.abs(np.interp(y, table["position_m"], table["force_N"]) - force)
    assert 0 < error.max() < 1e-3 * force.max()


def test_a_parameter_of_a_valve_that_does_not_exist_is_left_out(fitted: Fit, tmp_path: Path) -> None:
    write_matlab(replace(fitted, actuator=Actuator(equipment=Equipment(valves="supply"))), tmp_path / "lift.mat")
    content = loaded(tmp_path / "lift.mat")
    assert "C_ve" not in content["parameters"]
    assert content["actuator"]["valves"] == "supply"


def test_weights_of_b_splines_come_with_their_knots(fitted: Fit, tmp_path: Path) -> None:
    write_matlab(replace(fitted, actuator=Actuator(load=Load.on_b_splines())), tmp_path / "b.mat")
    load = loaded(tmp_path / "b.mat")["load"]
    assert (load["basis"], load["weights_unit"], len(load["weights"])) == ("b-spline", "N", len(load["knots_m"]) + 2)
    assert "phi2_slope" not in load


def test_another_suffix_is_refused_with_that_of_matlab(fitted: Fit, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"fit\.toml: MATLAB loads a struct from a file with the suffix \.mat"):
        write_matlab(fitted, tmp_path / "fit.toml")


def test_a_parameter_of_an_own_model_that_no_variable_can_be_called_is_refused(fitted: Fit, tmp_path: Path) -> None:
    f_s, end, y = symbols("f_s end y", real=True)
    stiffness = OwnParameter(4e3, "N/m", "stiffness of the return spring", range=(0, 1e5))
    model = OwnModel(base="isothermal", parameters={"end": stiffness}, terms={"f_s": f_s + end * y})
    with pytest.raises(ExportError, match="MATLAB has no variables with the name end; rename the parameter"):
        write_matlab(replace(fitted, actuator=Actuator(model=model)), tmp_path / "own.mat")
    assert not list(tmp_path.iterdir())


def test_a_file_for_matlab_cannot_start_a_fit_and_the_sentence_says_what_can(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"save the fit as \.toml too \(fit LOG --save FIT\.toml\)"):
        read_parameters(tmp_path / "fit.mat")


@pytest.mark.needs("octave-cli")
def test_octave_reads_the_struct(odd: Fit, tmp_path: Path) -> None:
    write_matlab(odd, tmp_path / "odd.mat")
    table = "clutchid.load.position_m, clutchid.load.force_N"
    program = f"load odd.mat; printf('%s|%.17g', clutchid.recordings(2).name, interp1({table}, 5.125e-3))"
    command = [path_of("octave-cli"), "--norc", "--eval", program]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=True).stdout
    name, _, force = said.partition("|")
    assert name == "Bar's '); x"
    curve = odd.load_curve
    assert float(force) == pytest.approx(np.interp(5.125e-3, curve.position, curve.force), rel=1e-14)
