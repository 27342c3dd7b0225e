"""The load: the table of the truck specification, its inverse functions, its table, and what wear does to it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.errors import ParameterError
from clutchid.truck import Truck, aged, load_curve, load_table
from clutchid.truck.parts.springs import cushion_compression, cushion_force, diaphragm_force, kluever_force
from fixtures.cases import case_tables

CASES = case_tables(__file__, "refusals")

T = Truck()
STEEL = (T.E, T.nu, T.h, T.H, T.R_d, T.r_d, T.R_1, T.r_1)


def clutch_force(truck, travel):
    """Force of the clutch in N over the travel from its engaged rest in m, without the return spring."""
    curve = load_curve(truck)
    y = curve.rest + travel
    return curve.force(y) - truck.F_r - truck.k_r * y


def test_the_diaphragm_has_the_hump_and_the_valley_that_were_computed():
    deflection = np.linspace(0, 15e-3, 15001)
    force = diaphragm_force(deflection, *STEEL)
    hump = np.argmax(np.where(deflection < 8e-3, force, 0))
    valley = np.argmin(np.where(deflection > 6e-3, force, np.inf))
    # copied from the specification: kN to 0.1, mm to 0.01 and 0.1; at an extremum half a unit of force moves it further
    assert force[hump] == pytest.approx(33.0e3, abs=50)
    assert deflection[hump] == pytest.approx(5.73e-3, abs=5e-6)
    assert force[valley] == pytest.approx(25.4e3, abs=50)
    assert deflection[valley] == pytest.approx(11.8e-3, abs=5e-5)


@pytest.mark.parametrize(
    ("wear", "clamp", "peak", "where", "at_25"),
    [(0, 31.4, 4771, 8.1, 4083), (1, 32.6, 5031, 8.4, 4282), (2, 32.9, 5201, 8.6, 4568), (3, 31.9, 5233, 11.2, 4868)],
)
def test_the_clutch_reproduces_the_table_of_the_specification(wear, clamp, peak, where, at_25):
    truck = Truck(wear=wear * 1e-3)
    assert diaphragm_force(truck.l_0 - truck.wear, *STEEL) == pytest.approx(clamp * 1e3, abs=51)
    travel = np.arange(0, 25.005e-3, 1e-5)
    force = clutch_force(truck, travel)
    # printed to 1 N and 0.1 mm
    assert force.max() == pytest.approx(peak, abs=0.51)
    assert travel[force.argmax()] * 1e3 == pytest.approx(where, abs=0.06)
    assert force[2500] == pytest.approx(at_25, abs=0.51)


@given(st.floats(1.0, 5e4))
def test_the_cushion_and_its_inverse_belong_together(force):
    cushion = (T.F_cu, T.c_cu, T.n_cu)
    assert cushion_force(cushion_compression(force, *cushion), *cushion) == pytest.approx(force, rel=1e-12)


def test_kluevers_load_is_the_formula_of_the_book():
    x = np.linspace(0, 0.025, 11)
    curve = load_curve(Truck(load="kluever", F_r=1.0, k_r=0.0))
    book = 4000 * (1 - np.exp(-500 * x)) - 20000 * x
    assert kluever_force(x, T.F_k, T.a_k, T.k_k) == pytest.approx(book)
    # a cubic spline of pitch d errs by up to 5/384 d^4 f'''' = 0.013 * 1e-16 * 4000 * 500^4, ten times that at the ends
    assert curve.force(x + curve.rest) - 1.0 == pytest.approx(book, abs=10 * 5 / 384 * 1e-16 * 4000 * 500**4)


@pytest.mark.parametrize("wear", [0.0, 2e-3])
def test_the_table_of_the_load_agrees_with_the_springs_between_its_breakpoints(wear, monkeypatch):
    truck = aged(Truck(), wear=wear)
    curve = load_curve(truck)
    monkeypatch.setattr(load_table, "PITCH", 0.01e-3)
    springs = load_curve.__wrapped__(truck)
    y = curve.rest + np.linspace(0, 0.025, 3333)
    # where the cushion comes free the curve is only (c_0 - s)^2.2: over a pitch d of 0.1 mm, d / 6.3 at the rim, it
    # bends by 30 kN (d / 6.3 / 0.8 mm)^2.2 / 6.3 = 1 N; a spline divides that by about ten, and a tenth of the pitch
    # leaves 0.6 % of it
    assert curve.force(y) == pytest.approx(springs.force(y), abs=0.1)
    assert len(springs.breakpoints) > 9 * len(curve.breakpoints)
    assert np.all(np.diff(curve.breakpoints) > 0)


def test_the_load_has_no_step_at_a_breakpoint():
    curve = load_curve(Truck(wear=1e-3))
    y, d = curve.breakpoints, 1e-9
    # 1 nm on a slope of at most 1000 N/mm
    assert np.abs(curve.force(y + d) - curve.force(y - d)).max() < 2 * d * 1e6 * 1.01


def test_wear_moves_the_rest_and_the_point_where_the_clutch_takes_hold_and_raises_the_load_at_full_stroke():
    new, worn = load_curve(Truck(i_w=0.5)), load_curve(Truck(i_w=0.5, wear=2e-3))
    assert worn.rest == pytest.approx(new.rest - 1e-3)
    assert worn.touch - worn.rest != pytest.approx(new.touch - new.rest, abs=1e-5)
    assert worn.force(worn.rest + 0.025) > 1.1 * new.force(new.rest + 0.025)


def test_a_worn_clutch_after_kluever_presses_harder_by_its_own_share():
    travel = np.linspace(1e-3, 20e-3, 20)
    new, worn = (clutch_force(Truck(load="kluever", a_k_w=50.0, wear=wear), travel) for wear in (0.0, 2e-3))
    assert worn == pytest.approx(1.1 * new, rel=1e-12)


@pytest.mark.parametrize("wear", [0.0, 2e-3])
def test_behind_the_engaged_rest_the_return_spring_alone_presses(wear):
    truck = Truck(i_w=0.5, wear=wear)
    curve = load_curve(truck)
    behind = curve.rest - np.array([1e-4, 3e-4])
    assert curve.force(behind) == pytest.approx(truck.F_r + truck.k_r * behind, rel=1e-12)


def test_relaxed_springs_press_less():
    new, old = Truck(), Truck(cycles=1e6)
    travel = np.linspace(1e-3, 20e-3, 20)
    loss = 1 - clutch_force(old, travel) / clutch_force(new, travel)
    # the height is lost by 0.8 %; the force goes with H^2 - ... and loses a few times that where H counts most
    assert 0 < loss.max() < 0.05


@pytest.mark.parametrize(("change", "word"), CASES["springs"])
def test_springs_that_cannot_be_a_clutch_are_named(change, word):
    with pytest.raises(ParameterError, match=word):
        load_curve(Truck(**change))
