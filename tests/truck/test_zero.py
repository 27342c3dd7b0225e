"""The zero of the position sensor, learned or kept, an offset of it, and duty cycles that are recorded late."""

import json

import numpy as np
import pytest

from clutchid.truck import drive, truck
from fixtures.commands import called

WEAR = 2e-3


@pytest.fixture(scope="module", params="AB")
def kind(request):
    return truck(2, request.param)


def shift_drive(kind, **options):
    return drive(kind, manoeuvre="gear-shift", seconds=3, seed=1, **options)


def rest(driven) -> float:
    """What the sensor reads before the first stroke, in m."""
    return float(np.median(driven.log["position"][:200]))


def test_a_learned_zero_does_not_show_wear_and_a_kept_one_falls_by_the_ratio_of_the_rest_times_the_wear(kind):
    new, learned, fallen = (
        rest(shift_drive(kind, wear=wear, sensor_zero=zero))
        for wear, zero in ((0.0, "kept"), (WEAR, "learned"), (WEAR, "kept"))
    )
    assert learned == pytest.approx(new, abs=kind.q_y)
    assert fallen - new == pytest.approx(-kind.i_w * WEAR, abs=2 * kind.q_y)


@pytest.mark.parametrize("zero", ["learned", "kept"])
def test_an_offset_is_read_by_recorder_and_controller_and_moves_the_rest_by_as_much(kind, zero):
    without, with_ = (shift_drive(kind, wear=WEAR, sensor_zero=zero, offset=off) for off in (0.0, 3e-4))
    assert rest(with_) - rest(without) == pytest.approx(3e-4, abs=2 * kind.q_y)
    assert with_.truth.shift - without.truth.shift == pytest.approx(3e-4, abs=1e-12)
    # the controller goes to the same readings, so the piston stops short
    top = [driven.truth.states["position"].max() - driven.truth.shift for driven in (without, with_)]
    assert top[0] - top[1] == pytest.approx(3e-4, abs=2.5e-4)


def test_the_true_load_over_the_travel_from_the_vented_rest_does_not_depend_on_the_zero(kind, tmp_path):
    travel = np.linspace(0, 0.02, 21)
    loads = [
        shift_drive(kind, wear=WEAR, sensor_zero=zero, offset=offset)
        for zero, offset in (("learned", 0.0), ("kept", 0.0), ("kept", -3e-4))
    ]
    for load in loads[1:]:
        assert load.truth.load(travel) == pytest.approx(loads[0].truth.load(travel), rel=1e-12)
        assert load.truth.touch == pytest.approx(loads[0].truth.touch, abs=1e-15)
    loads[-1].write_truth(tmp_path / "truth.json", "x")
    written = json.loads((tmp_path / "truth.json").read_text())["logs"]["x"]
    assert written["rest_shift_m"] == loads[-1].truth.shift
    assert written["rest_shift_m"] == pytest.approx(-kind.i_w * WEAR - 3e-4, abs=1e-5)


def test_late_duty_cycles_are_those_of_the_drive_some_samples_later(kind):
    now, later = shift_drive(kind), shift_drive(kind, late=3e-3)
    assert np.array_equal(later.log["position"], now.log["position"])
    for name in ("duty_supply", "duty_exhaust"):
        assert np.array_equal(later.log[name][3:], now.log[name][:-3])
        assert np.all(later.log[name][:3] == now.log[name][0])


def test_a_supply_pressure_replaces_that_of_the_truck(kind):
    assert shift_drive(kind, supply=7.5e5).truth.supply == 7.5e5
    assert shift_drive(kind, supply=8e5, change="supply").truth.supply == pytest.approx(7.6e5)


def test_the_command_has_a_word_of_its_own_for_the_zero_of_the_sensor(tmp_path, capsys):
    """`--zero` is what is done about a rest that has moved, in all commands that read a recording."""
    truth = tmp_path / "truth.json"
    worn = ("drive", "--wear", "2", "--seconds", "1", "--out", tmp_path / "worn.csv", "--truth", truth)
    assert called(*worn, "--sensor-zero", "kept") == 0
    assert json.loads(truth.read_text())["logs"]["worn"]["rest_shift_m"] < -1e-4
    assert called(*worn, "--zero", "kept") == 2
    assert "Unknown option: --zero" in capsys.readouterr().err
    assert called("drive", "--fleet", "1", "--out", tmp_path / "fleet", "--sensor-zero", "kept") == 2
    assert "--sensor-zero is for a single recording" in capsys.readouterr().err
