"""Profile likelihood and bootstrap as the user asks for them."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid import fit
from clutchid.errors import ParameterError
from clutchid.estimation import checks as module
from clutchid.estimation.calibrate import free_parameters
from clutchid.estimation.checks import with_checked_intervals
from clutchid.estimation.fit import fit_request
from clutchid.estimation.method import fit_at
from clutchid.estimation.parameter_file import read_parameters
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import QUANTILE, ProfileCurve
from clutchid.estimation.shooting import SHOOTING, shoot
from clutchid.verbs.saving import save_fit
from fixtures.cases import case_tables

CASES = case_tables(__file__, "refusals")


@pytest.fixture(scope="module")
def shot(plant, worn_log):
    request = FitRequest(("position",), ("load", "F_C"))
    _, wanted = free_parameters([worn_log], plant, request)
    return shoot([worn_log], plant, wanted)


@pytest.fixture(scope="module")
def plain(shot):
    return fit_at(SHOOTING, shot)


@pytest.mark.slow
def test_a_profiled_number_has_its_own_interval_and_the_rest_is_as_before(shot, plain):
    result = with_checked_intervals(plain, shot, None, ("F_C",), 0)
    profiled, before = result.parameters["F_C"], plain.parameters["F_C"]
    assert (profiled.value, profiled.std) == (before.value, before.std)
    assert profiled.low < profiled.value < profiled.high
    assert (profiled.low, profiled.high) != (before.low, before.high)
    assert all(result.parameters[name] is plain.parameters[name] for name in plain.parameters if name != "F_C")
    assert any(note.startswith("F_C: ") and "by profile likelihood" in note for note in result.notes)
    assert (result.profiles["F_C"].low, result.profiles["F_C"].high) == (profiled.low, profiled.high)


def curve_of(low, high):
    """A profile with these ends, drawn through the middle."""
    values, distances = np.array([low, (low + high) / 2, high]), np.array([QUANTILE, 0.0, QUANTILE])
    return ProfileCurve(low, high, values, distances, "bounded")


def test_a_nonquadratic_interval_is_noted_with_both(shot, plain):
    low, high = plain.parameters["F_C"].low, plain.parameters["F_C"].high
    note = with_checked_intervals(plain, shot, None, ("F_C",), 0, lambda *_: curve_of(0.5 * low, high)).notes[-1]
    assert f"{0.5 * low:.4g} to {high:.4g} N by profile likelihood" in note
    assert f"gives {low:.4g} to {high:.4g}." in note


def test_the_interval_of_a_load_weight_is_shifted_as_its_value_is(shot, plain):
    name = plain.actuator.load.names[8]
    value = plain.parameters[name].value
    # bias of a calibration: 100 N
    moved = replace(plain, parameters={**plain.parameters, name: replace(plain.parameters[name], value=value - 100.0)})
    result = with_checked_intervals(moved, shot, None, (name,), 0, lambda *_: curve_of(value - 30.0, value + 40.0))
    estimate, curve = result.parameters[name], result.profiles[name]
    assert (estimate.low, estimate.high) == pytest.approx((value - 130.0, value - 60.0))
    assert curve.values == pytest.approx([value - 130.0, value - 95.0, value - 60.0])


def test_the_bootstrap_says_over_how_many_strokes_and_how_far_the_load_scatters(shot, plain):
    result = with_checked_intervals(plain, shot, None, (), 50)
    assert any(note.startswith("bootstrap over ") and "times that of its interval" in note for note in result.notes)
    assert result.parameters == plain.parameters
    assert result.draws.shape == (50, len(plain.parameters))
    # in standard deviations: the priors of the worn clutch are wide, and a draw moves the estimate a little
    moves = (result.draws - [e.value for e in plain.parameters.values()]) / [e.std for e in plain.parameters.values()]
    assert 0.01 < moves.std() < 1.0
    assert abs(moves.mean()) < 0.3


@pytest.mark.parametrize(
    ("ratio", "sentence", "status"),
    [(2.5, "2.5 times", "warning"), (np.nan, "a free load and two strokes are needed", "ok")],
    ids=["bands that are too narrow", "no free load"],
)
def test_what_the_bootstrap_finds_is_said(shot, plain, monkeypatch, ratio, sentence, status):
    monkeypatch.setattr(module, "scatter_ratio", lambda *_: ratio)
    result = with_checked_intervals(plain, shot, None, (), 50)
    assert result.status == status
    assert sentence in (result.warnings or result.notes)[-1]


def test_from_the_front_door_both_are_asked_for_by_name(plant, worn_log):
    result = fit(
        worn_log, plant, free=("load",), method="shooting", request=FitRequest(profile=("theta_9",), bootstrap=20)
    )
    assert sum("by profile likelihood" in note or "bootstrap over" in note for note in result.notes) == 2
    assert np.isfinite(result.parameters["theta_9"].low)


@pytest.mark.parametrize(("options", "sentence"), CASES["checks"])
def test_what_cannot_be_checked_is_refused_before_any_work(plant, worn_log, options, sentence):
    with pytest.raises(ParameterError, match=sentence.replace("(", r"\(")):
        fit(worn_log, plant, FitRequest(**options))


def test_a_result_can_be_saved_before_its_checks_begin(plant, worn_log, tmp_path):
    def stopped(*_):
        raise KeyboardInterrupt

    methods = {"shooting": replace(SHOOTING, check=stopped)}
    request, path = FitRequest(free=("load", "F_C"), profile=("F_C",)), tmp_path / "fit.toml"
    with pytest.raises(KeyboardInterrupt):
        fit_request([worn_log], plant, request, methods=methods, before_checks=lambda result: save_fit(result, path))
    assert "F_C" in read_parameters(path).actuator.parameter_names
    assert read_parameters(path).actuator.value("F_C") != plant.value("F_C")
