"""The clutch of family B: its curves by hand, the gap, the touch point, and how both age."""

import numpy as np
import pytest

from clutchid.truck import TruckB, aged, load_curve
from clutchid.truck.assembly import worn_parameters
from clutchid.truck.parts.hump import cubic_hump

BARE = {"F_r": 1.0, "k_r": 0.0}


def at(curve, y: float) -> float:
    return float(curve.force(np.array([y]))[0])


def test_the_cubic_has_its_maximum_and_its_minimum_where_its_numbers_say():
    x = np.linspace(-0.01, 0.05, 6001)
    force = cubic_hump(x, 5200.0, 3900.0, 0.038)
    slope = np.gradient(force, x)
    assert force[np.argmin(np.abs(x))] == pytest.approx(5200)
    assert force[np.argmin(np.abs(x - 0.038))] == pytest.approx(3900)
    assert np.all(slope[(x > 1e-4) & (x < 0.0379)] < 0)
    assert np.all(slope[(x < -1e-4) | (x > 0.0381)] > 0)


def test_behind_the_touch_point_only_the_diaphragm_acts_and_before_it_the_cushion_too():
    t = TruckB(**BARE)
    curve = load_curve(t)
    for s in (1e-3, t.s_c, 0.01, 0.018):
        diaphragm = cubic_hump(t.x_0 + s, t.F_k, t.F_v, t.x_v)
        cushion = cubic_hump(t.x_0, t.F_k, t.F_v, t.x_v) * max(1 - s / t.s_c, 0)
        force = diaphragm - cushion
        # the table has a breakpoint each 0.1 mm, and the cushion's end is a kink of 1.5 kN/mm between two of them
        assert at(curve, t.gap + s + force / t.K_s) == pytest.approx(1.0 + force, abs=20 if s == t.s_c else 2)
    force = cubic_hump(t.x_0 + t.s_c, t.F_k, t.F_v, t.x_v)
    assert curve.touch == pytest.approx(t.gap + t.s_c + force / t.K_s)


@pytest.mark.parametrize("load", ["cubic", "tabulated"])
def test_within_the_gap_only_the_return_spring_acts(load):
    t = TruckB(load=load, gap=5e-4, F_r=50.0, k_r=1000.0)
    assert at(load_curve(t), 2e-4) == pytest.approx(50.2, abs=2)
    assert at(load_curve(t), 1e-3) > 200


def test_the_tabulated_hump_has_its_peak_and_its_end():
    t = TruckB(load="tabulated", F_k=5000.0, F_v=4000.0, s_k=9e-3, gap=1e-4, **BARE)
    curve = load_curve(t)
    y = np.linspace(0, 0.0249, 2001)
    force = curve.force(y)
    assert force.max() == pytest.approx(5001, rel=1e-3)
    assert y[force.argmax()] == pytest.approx(9.1e-3, abs=1e-4)
    assert at(curve, curve.touch) == pytest.approx(0.85 * 5000 + 1, rel=2e-3)


def test_wear_moves_the_cubic_towards_its_maximum_and_raises_and_shifts_the_table():
    cubic = TruckB(a_H=0.0, i_w=0.4)
    new, old = load_curve(cubic), load_curve(aged(cubic, wear=1.5e-3))
    assert old.rest == pytest.approx(-0.6e-3)
    assert at(old, old.rest + 0.02) > at(new, 0.02) + 100
    table = TruckB(load="tabulated", a_H=0.0, a_k=30.0, a_s=0.4, i_w=0.0, **BARE)
    y = np.linspace(0, 0.0249, 2001)
    before, after = load_curve(table).force(y), load_curve(aged(table, wear=2e-3)).force(y)
    assert after.max() / before.max() == pytest.approx(1.06, rel=1e-3)
    assert y[before.argmax()] - y[after.argmax()] == pytest.approx(0.8e-3, abs=5e-5)


def test_each_part_ages_by_its_own_law():
    t = TruckB(a_F=0.3, a_C=2.0, a_H=0.005, a_c=50.0, cycles=2.5e5, wear=1e-3)
    age = worn_parameters(t)
    assert age["F_C"] / t.F_C == pytest.approx(1.15)
    assert age["C_AB"] / t.C_AB == pytest.approx(1.125)
    assert age["relaxed"] == pytest.approx(1 - 0.005 * np.log10(13.5))
    assert age["F_r"] / t.F_r == pytest.approx(age["relaxed"])
    assert age["s_c"] / t.s_c == pytest.approx(0.95)
    assert worn_parameters(TruckB())["F_C"] == TruckB().F_C
