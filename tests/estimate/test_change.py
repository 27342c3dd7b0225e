"""What has changed since a calibration: where held numbers would go, and that what has moved is set free."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.estimate.calibrate import fit_with_priors
from clutchid.estimate.change import (
    CHANGED,
    CHANGES,
    SINGLE_CHANGED,
    SUPPLY,
    distance,
    fitted_changes,
    mean_score,
    score,
    with_changes,
)
from clutchid.estimate.free import FreeParameters
from clutchid.estimate.parameter_file import parameter_file, read_parameters, write_parameters
from clutchid.estimate.request import FitRequest
from clutchid.estimate.search_result import SearchResult
from clutchid.estimate.shooting import fit as module
from clutchid.estimate.shooting.fit import SHOOTING, shoot
from clutchid.numerics.failure import Failure
from clutchid.report.changes import change_sentences
from clutchid.uncertainty.calibration import Score
from clutchid.uncertainty.coordinates import Prior

RANGES = {name: near for kind in (*CHANGES.values(), *SUPPLY.values()) for name, near in kind.items()}
NAMES = tuple(RANGES)


def scored(stem: str = "", **shifts: float) -> Score:
    """Numbers shifted by so many of their own `same`, and known almost exactly."""
    names = tuple(f"{name}@{stem}" for name in NAMES) if stem else NAMES
    shift = np.array([shifts.get(name, 0.0) * near.same for name, near in RANGES.items()])
    return Score(names, shift, 1e-16 * np.eye(len(NAMES)))


@pytest.fixture(scope="module")
def cold(worn):
    """The worn plant with grease that is 40 % thicker."""
    return worn.replace({"D_v": 1.4 * worn.value("D_v")})


@pytest.fixture(scope="module")
def cold_log(cold, recorded_by):
    return recorded_by(cold, seconds=6.0, seed=6, name="cold", driven=1).without("pressure_a")


def reread(calibrated, logs):
    request = FitRequest(("position",), ("load",), calibration=calibrated.calibration)
    return fit_with_priors(SHOOTING, logs, calibrated.actuator, request)


def released(fit):
    return {name for name in fit.parameters if name.partition("@")[0] in NAMES}


def rms(load, true):
    y = np.linspace(0.5e-3, 20e-3, 40)
    miss = load.force(y) - true.force(y)
    return float(np.sqrt(np.mean(miss**2))) / true.force(y).max()


def test_a_score_says_where_a_fit_with_the_number_free_ends(calibrated, worn_log, monkeypatch):
    kept, actuator = calibrated.calibration, calibrated.actuator
    off = actuator.replace({"D_v": 0.92 * actuator.value("D_v")})
    shot = shoot([worn_log], off, FreeParameters(actuator.load.names, ("position",)), kept)
    said = score(shot)
    asked = [name for name in NAMES if name != "P_S"]
    names = (*actuator.load.names, *(f"{name}@worn" for name in asked))
    shares = {name: 1.0 if name[1:3] == "_0" else off.value(name) for name in asked}
    priors = {f"{name}@worn": Prior(off.value(name), RANGES[name].far * shares[name]) for name in asked}
    # the score counts every sample, so the fit that it foresees does
    monkeypatch.setattr(module, "MEMORY", 0.0)
    free = shoot([worn_log], off, FreeParameters(names, ("position",), priors=priors), kept)
    found = np.log(free.problem.actuator_of(free.solution.x, "worn").value("D_v") / off.value("D_v"))
    assert said.names == tuple(f"{name}@worn" for name in NAMES)
    said = said.of([f"{name}@worn" for name in asked])
    deviation = np.sqrt(said.covariance[0, 0])
    assert abs(found) > 3.0 * deviation, "the step has to be seen"
    assert said.shift[0] == pytest.approx(found, abs=0.25 * deviation)


def test_a_calibration_keeps_the_score_of_its_own_recording(calibrated):
    kept = calibrated.calibration.score
    assert kept.names == NAMES
    assert np.all(np.isfinite(kept.shift))
    assert np.all(np.linalg.eigvalsh(kept.covariance) > 0.0)


def test_a_calibration_is_read_from_its_file_as_it_was(calibrated, tmp_path):
    path = tmp_path / "cal.toml"
    write_parameters(parameter_file(calibrated), path)
    again, kept = read_parameters(path).calibration, calibrated.calibration
    assert (again.names, again.bias, again.method) == (kept.names, kept.bias, kept.method)
    assert np.array_equal(again.covariance, kept.covariance)
    assert again.score.names == kept.score.names
    assert np.array_equal(again.score.shift, kept.score.shift)
    assert np.array_equal(again.score.covariance, kept.score.covariance)


@pytest.mark.parametrize("spoil", [lambda score: score.pop("shift"), lambda score: score["shift"].pop()])
def test_a_spoiled_score_is_one_sentence(calibrated, spoil):
    content = parameter_file(calibrated)
    spoil(content.fit["calibration"]["score"])
    with pytest.raises(ParameterError, match=r"\[fit\.calibration\.score\]: names, a shift for each and their square"):
        _ = content.calibration


def test_a_load_is_read_in_the_cold_with_the_thicker_grease_set_free(calibrated, cold, cold_log):
    fit = reread(calibrated, [cold_log])
    assert released(fit) == {"D_v@cold"}
    assert fit.parameters["D_v@cold"].value == pytest.approx(cold.value("D_v"), rel=0.1)
    assert rms(fit.actuator.load, cold.load) < 0.03
    (note,) = change_sentences(fit.changes)
    assert note.startswith("cold: viscous friction has changed since the calibration and was fitted with the load (D")
    blind = replace(calibrated.calibration, score=None)
    request = FitRequest(("position",), ("load",), calibration=blind)
    held = fit_with_priors(SHOOTING, [cold_log], calibrated.actuator, request)
    assert released(held) == set(), "a calibration of an earlier version knows no change"
    assert rms(held.actuator.load, cold.load) > 0.08, "what thick grease costs where it is held"


def test_only_the_recording_in_which_something_has_changed_gets_a_number_of_its_own(calibrated, worn_log, cold_log):
    assert released(reread(calibrated, [worn_log, cold_log])) == {"D_v@cold"}


def test_a_number_that_the_user_sets_free_is_not_asked(calibrated, cold_log):
    value = calibrated.actuator.value("D_v")
    wide = {"D_v": Prior(value, 0.5 * value)}
    request = FitRequest(("position",), ("load", "D_v"), priors=wide, calibration=calibrated.calibration)
    fit = fit_with_priors(SHOOTING, [cold_log], calibrated.actuator, request)
    assert released(fit) == {"D_v"}
    assert not any("changed" in note for note in fit.notes)


def test_what_moves_on_the_calibration_recording_as_well_has_not_changed(plant):
    wanted = FreeParameters(plant.load.names, ("position",))
    assert with_changes(wanted, scored("worn", D_v=10.0), scored(D_v=10.0), plant) is wanted
    assert with_changes(wanted, scored("worn", D_v=SINGLE_CHANGED - 0.1), scored(), plant) is wanted
    wider = with_changes(wanted, scored("worn", D_v=SINGLE_CHANGED + 0.1), scored(), plant)
    assert wider.names == (*wanted.names, "D_v@worn")
    assert wider.priors == {"D_v@worn": Prior(plant.value("D_v"), 0.5 * plant.value("D_v"))}


def test_numbers_of_one_kind_are_set_free_together_and_others_stay(plant):
    wanted = FreeParameters(("theta_1",), ("position",))
    assert with_changes(wanted, scored("w", C_ve=-5.0), scored(), plant).names == ("theta_1", "C_vs@w", "C_ve@w")
    # root mean square of two
    assert with_changes(wanted, scored("w", C_ve=1.4 * (CHANGED - 0.1)), scored(), plant) is wanted
    timing = with_changes(wanted, scored("w", R_0vs=9.0), scored(), plant)
    assert timing.names[1:] == ("R_0vs@w", "R_0ve@w", "a_0vs@w", "a_0ve@w")
    assert timing.priors["R_0vs@w"] == Prior(plant.value("R_0vs"), 0.02)


def test_the_supply_is_asked_where_nothing_else_has_changed(plant):
    wanted = FreeParameters(("theta_1",), ("position",))
    assert with_changes(wanted, scored("w", P_S=5.0), scored(), plant).names == ("theta_1", "P_S@w")
    assert with_changes(wanted, scored("w", P_S=5.0, D_v=5.0), scored(), plant).names == ("theta_1", "D_v@w")
    assert with_changes(wanted, scored("w", P_S=SINGLE_CHANGED - 0.1), scored(), plant) is wanted


def test_the_supply_stays_where_another_kind_alone_explains_more(plant):
    wanted = FreeParameters(("theta_1",), ("position",))
    # only the friction has moved, less than tells a change; the supply alone would explain nearly as much
    names, shift = ("D_v@w", "P_S@w"), np.array([0.036, 0.0])
    here = Score(names, shift, np.array([[1e-4, -0.9e-4], [-0.9e-4, 1e-4]]))
    before = Score(("D_v", "P_S"), np.zeros(2), here.covariance)
    assert here.of(["P_S@w"]).shift[0] == pytest.approx(0.0324), "alone the supply seems to have changed"
    assert with_changes(wanted, here, before, plant) is wanted


def test_numbers_that_a_score_does_not_know_stay(plant):
    wanted = FreeParameters(("theta_1",), ("position",))
    assert with_changes(wanted, Score((), np.zeros(0), np.zeros((0, 0))), scored(), plant) is wanted
    alone = Score(("tau_y@w",), np.array([9.0]), np.eye(1))
    assert with_changes(wanted, alone, scored(), plant) is wanted


def test_a_score_of_some_numbers_has_the_others_held():
    root = np.random.default_rng(3).standard_normal((4, 4))
    gradient = np.array([1.0, -2.0, 0.5, 3.0])
    information = root @ root.T + np.eye(4)
    whole = Score(("a", "b", "c", "d"), np.linalg.solve(information, gradient), np.linalg.inv(information))
    part = whole.of(["c", "a"])
    own = information[np.ix_([2, 0], [2, 0])]
    assert part.names == ("c", "a")
    assert part.shift == pytest.approx(np.linalg.solve(own, gradient[[2, 0]]))
    assert part.covariance == pytest.approx(np.linalg.inv(own))


def test_a_distance_counts_what_is_known_and_how_alike_recordings_are():
    near = CHANGES["flow of the valves"]
    here = Score(("C_vs@w", "C_ve@w"), np.array([0.03, 0.02]), np.array([[4e-4, 1e-4], [1e-4, 1e-4]]))
    before = Score(("C_ve", "C_vs"), np.array([0.01, 0.01]), np.eye(2))  # not counted: `same` holds it
    spread = here.covariance + np.diag([near["C_vs"].same ** 2, near["C_ve"].same ** 2])
    moved = np.array([0.02, 0.01])
    expected = np.sqrt(moved @ np.linalg.inv(spread) @ moved / 2)
    assert distance(here, before, ("C_vs", "C_ve"), "w") == pytest.approx(expected)


def test_scores_of_several_recordings_are_averaged():
    one, other = (Score((f"D_v@{stem}",), np.array([s]), np.array([[0.01]])) for stem, s in (("a", 0.1), ("b", 0.3)))
    mean = mean_score([one, other])
    assert mean.names == ("D_v",)
    assert (mean.shift[0], mean.covariance[0, 0]) == pytest.approx((0.2, 0.005))


def test_a_search_that_failed_has_no_score(problem_of, drive_log, plant):
    shot = SearchResult("shooting", problem_of([drive_log], plant, ["C_vs"]), (), Failure("no end"))
    assert score(shot).message == "no end"


def test_fitted_changes_come_as_data_by_recording_and_group(calibrated, plant):
    now = calibrated.parameters["C_ve"]
    fit = replace(calibrated, parameters={"C_vs@a": now, "C_ve@a": now, "D_v@b": now})
    before = plant.replace({"C_vs": 2e-8, "C_ve": 1.5e-8, "D_v": 3000.0})
    changes = fitted_changes(("C_vs@a", "C_ve@a", "D_v@b"), before, fit)
    assert [(c.recording, c.name, c.before, c.group) for c in changes] == [
        ("a", "C_vs", 2e-8, "flow of the valves"),
        ("a", "C_ve", 1.5e-8, "flow of the valves"),
        ("b", "D_v", 3000.0, "viscous friction"),
    ]
    assert all(
        (c.after, c.std, c.unit, c.fitted, c.probability) == (now.value, now.std, now.unit, True, None) for c in changes
    )
    first, second = change_sentences(changes)
    value = f"{now.value:.4g}"
    assert first == (
        "a: flow of the valves has changed since the calibration and was fitted with the load "
        f"(C_vs 2e-08 -> {value} m³/(Pa·s), C_ve 1.5e-08 -> {value} m³/(Pa·s))."
    )
    assert second.startswith("b: viscous friction has changed")


def test_what_is_free_here_is_compared_with_a_calibration_in_which_it_was_free_too(plant):
    # at the calibration the supply would have moved by 5 % and the friction not at all; with the supply held, the
    # friction would have moved in its stead, by 0.9 of that
    before = Score(("D_v", "P_S"), np.array([0.0, 0.05]), 1e-4 * np.array([[1.0, 0.9], [0.9, 1.0]]))
    here = Score(("D_v@w",), np.array([0.0]), np.array([[1e-8]]))
    held, fitted = (FreeParameters(names, ("position",)) for names in (("theta_1",), ("theta_1", "P_S")))
    assert before.of(["D_v"]).shift[0] == pytest.approx(-0.045), "three times as far as recordings of one truck"
    assert with_changes(fitted, here, before, plant) is fitted
    assert with_changes(held, here, before, plant).names == ("theta_1", "D_v@w")
