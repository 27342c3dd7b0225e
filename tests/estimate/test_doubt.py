"""What may have changed since a calibration: it is held, told, and counted in the band."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimate.calibrate import fit_with_priors
from clutchid.estimate.change import CHANGES
from clutchid.estimate.doubt import SUSPECTED, WARMTH, doubted
from clutchid.estimate.request import FitRequest
from clutchid.estimate.shooting.fit import SHOOTING
from clutchid.report.changes import change_sentences
from clutchid.uncertainty.calibration import Calibration, Score

GREASE = CHANGES["viscous friction"]["D_v"].same
FLOW = CHANGES["flow of the valves"]
BOTH = ("C_vs", "C_ve")


def moved(stem: str, **shares: float) -> Score:
    """Numbers that moved by so much, and are told almost exactly."""
    names = tuple(f"{name}@{stem}" if stem else name for name in shares)
    return Score(names, np.array([*shares.values()]), 1e-16 * np.eye(len(names)))


def known(**shares: float) -> Calibration:
    """A calibration that knows D_v to 1 N s/m and has a score of these numbers."""
    return Calibration(("D_v",), np.eye(1), score=moved("", **shares))


def test_what_moved_less_than_tells_a_change_but_not_little_is_doubted(plant):
    far = (SUSPECTED + 0.3) * GREASE
    less, (change,) = doubted(known(D_v=0.0), moved("w", D_v=-far), {"w": set()}, set(), plant)
    value = plant.value("D_v")
    assert less.covariance[0, 0] == pytest.approx(1.0 + (far * value) ** 2)
    start = f"w: viscous friction may have changed since the calibration (D_v {value:.4g} -> {value * (1 - far):.4g} N"
    (note,) = change_sentences([change])
    assert note.startswith(start)
    assert "2.3 standard deviations; it was fixed, and the interval is widened" in note


def test_what_moved_little_or_as_at_the_calibration_is_not_doubted(plant):
    calibration = known(D_v=0.0)
    here = moved("w", D_v=(SUSPECTED - 0.1) * GREASE)
    assert doubted(calibration, here, {"w": set()}, set(), plant) == (calibration, ())
    calibration = known(D_v=5.0 * GREASE)
    here = moved("w", D_v=5.1 * GREASE)
    assert doubted(calibration, here, {"w": set()}, set(), plant) == (calibration, ())


def test_numbers_of_a_kind_are_doubted_together_along_their_move(plant):
    shift = {name: 2.5 * near.same for name, near in FLOW.items()}
    less, changes = doubted(known(C_vs=0.0, C_ve=0.0), moved("w", **shift), {"w": set()}, set(), plant)
    by = np.array([shift[name] * plant.value(name) for name in BOTH])
    assert less.names == ("D_v", *BOTH)
    assert less.covariance_of(BOTH) == pytest.approx(np.outer(by, by), rel=1e-9)
    assert [(change.name, change.fitted) for change in changes] == [("C_vs", False), ("C_ve", False)]
    assert [change.after - change.before for change in changes] == pytest.approx(by.tolist())
    assert len(change_sentences(changes)) == 1


def test_of_several_recordings_the_one_that_moved_most_counts_and_each_is_told(plant):
    one, other = 2.2 * GREASE, 2.7 * GREASE
    here = Score(("D_v@a", "D_v@b"), np.array([one, other]), 1e-16 * np.eye(2))
    less, changes = doubted(known(D_v=0.0), here, {"a": set(), "b": set()}, set(), plant)
    assert less.covariance[0, 0] == pytest.approx(1.0 + (other * plant.value("D_v")) ** 2)
    assert [change.recording for change in changes] == ["a", "b"]


def test_after_a_change_all_else_is_known_as_two_recordings_tell_it_and_walls_to_30_kelvin(plant):
    here = moved("w", C_vs=0.0, C_ve=0.0)
    less, notes = doubted(known(D_v=0.0, C_vs=0.0, C_ve=0.0), here, {"w": {"D_v"}}, {"D_v"}, plant)
    assert notes == ()
    assert less.covariance_of(("D_v",)) == pytest.approx(1.0), "it is fitted, so nothing is taken as known of it"
    for name, near in FLOW.items():
        assert less.covariance_of((name,))[0, 0] == pytest.approx((near.same * plant.value(name)) ** 2)
    assert less.covariance_of(("T_w",))[0, 0] == pytest.approx((WARMTH * plant.value("T_w")) ** 2)
    less, _ = doubted(known(D_v=0.0), moved("w", D_v=0.0), {"w": set(BOTH)}, set(BOTH), plant)
    assert "T_w" not in less.names, "valves that pass less say nothing of the temperature"


def test_of_a_slow_recording_all_is_known_as_two_recordings_tell_it(plant):
    less, notes = doubted(known(C_vs=0.0, C_ve=0.0), moved("w", C_vs=0.0, C_ve=0.0), {"w": set()}, set(), plant, True)
    assert notes == ()
    assert less.covariance[0, 0] == pytest.approx(1.0 + (GREASE * plant.value("D_v")) ** 2)
    assert less.covariance_of(("C_vs",))[0, 0] == pytest.approx((FLOW["C_vs"].same * plant.value("C_vs")) ** 2)
    assert "T_w" not in less.names


def test_a_load_read_with_slightly_thicker_grease_has_a_wider_band_that_holds_it(calibrated, worn, recorded_by):
    thick = worn.replace({"D_v": (1.0 + 2.8 * GREASE) * worn.value("D_v")})
    log = recorded_by(thick, seconds=6.0, seed=6, name="cool", driven=1).without("pressure_a")
    blind = replace(calibrated.calibration, score=None)
    honest, sure = (
        fit_with_priors(SHOOTING, [log], calibrated.actuator, FitRequest(("position",), ("load",), calibration=c))
        for c in (calibrated.calibration, blind)
    )
    assert honest.actuator.load.theta == sure.actuator.load.theta, "the grease is held"
    assert any(note.startswith("cool: viscous friction may have changed") for note in change_sentences(honest.changes))
    (change,) = honest.changes
    known = blind.inflated(("D_v",), np.array([[(change.after - change.before) ** 2]]))
    request = FitRequest(("position",), ("load",), calibration=known)
    told = fit_with_priors(SHOOTING, [log], calibrated.actuator, request)
    half = [np.mean(fit.load_curve.high - fit.load_curve.low) for fit in (honest, sure, told)]
    assert half[0] == pytest.approx(half[2], rel=1e-9), "as wide as where the calibration is unsure by what has moved"
    # 4.2 % of the grease beside 2.2 % that the calibration leaves open, and what else makes the band
    assert half[0] > 1.4 * half[1]
    curve = honest.load_curve
    at = (curve.position > 0.5e-3) & (curve.position < 20e-3)
    true = thick.load.force(curve.position)[at]
    assert np.mean((curve.low[at] < true) & (true < curve.high[at])) > 0.9


def test_doubt_is_added_to_what_is_known_and_to_what_is_not():
    one = Calibration(("a", "b"), np.array([[2.0, 1.0], [1.0, 3.0]]))
    wider = one.inflated(("b", "c"), np.array([[4.0, 0.5], [0.5, 5.0]]))
    assert wider.names == ("a", "b", "c")
    assert np.array_equal(wider.covariance, [[2.0, 1.0, 0.0], [1.0, 7.0, 0.5], [0.0, 0.5, 5.0]])
    assert np.array_equal(one.covariance, [[2.0, 1.0], [1.0, 3.0]])


@pytest.mark.parametrize(("first", "second"), [(2.7, 2.2), (2.2, 2.7)])
def test_the_recording_that_moved_most_counts_wherever_it_stands(plant, first, second):
    here = Score(("D_v@a", "D_v@b"), GREASE * np.array([first, second]), 1e-16 * np.eye(2))
    less, changes = doubted(known(D_v=0.0), here, {"a": set(), "b": set()}, set(), plant)
    assert less.covariance[0, 0] == pytest.approx(1.0 + (2.7 * GREASE * plant.value("D_v")) ** 2)
    assert [change.distance for change in changes] == pytest.approx([first, second])
