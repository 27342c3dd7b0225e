"""Truck types and their numbers: drawn from the ranges, checked, aged."""

import dataclasses
import math

import pytest

from clutchid.errors import ParameterError
from clutchid.truck import Truck, TruckB, aged, truck
from clutchid.truck.assembly import worn_parameters
from clutchid.truck.families import family_ranges
from fixtures.cases import case_tables
from fixtures.sentences import one_sentence

NUMBERS = [*range(24), *range(1000, 1024)]


def test_all_kinds_of_load_drive_and_period_occur():
    trucks = [truck(n) for n in NUMBERS]
    assert {t.load for t in trucks} == {"diaphragm", "kluever"}
    assert {t.drive for t in trucks} == {"pwm", "bang-bang"}
    assert {t.T_pwm for t in trucks if t.drive == "pwm"} == {0.005, 0.01, 0.02}


def test_every_name_in_the_file_is_a_number_of_a_truck():
    table = family_ranges()
    for part in ("uniform", "share"):
        assert set(table[part]) <= set(Truck.names())
    assert isinstance(table["version"], int)


@pytest.mark.parametrize(("make", "values", "words"), case_tables(__file__, "refusals")["trucks"])
def test_an_impossible_truck_is_named_in_one_sentence(make, values, words):
    assert words in one_sentence(ParameterError, {"Truck": Truck, "TruckB": TruckB}[make], **values)


def test_all_impossible_numbers_are_told_at_once():
    with pytest.raises(ParameterError) as caught:
        Truck(A_A=-1.0, M=0.0, load="x")
    assert len(str(caught.value).splitlines()) == 3


def test_an_unknown_number_names_the_nearest():
    with pytest.raises(ParameterError, match="did you mean 'UA_S'"):
        Truck().replace({"U_AS": 0.0})
    with pytest.raises(ParameterError, match="did you mean 'P_S'"):
        Truck.row("P_SS")


@pytest.mark.parametrize("number", [-1, 1.5, True])
def test_truck_types_are_numbered_from_0(number):
    with pytest.raises(ParameterError, match="numbered 0, 1, 2"):
        truck(number)


def test_every_number_has_a_unit_a_meaning_and_a_range_that_holds_its_default():
    for name in Truck.names():
        row = Truck.row(name)
        assert row.unit
        assert row.meaning
        assert row.source
        assert row.admits(getattr(Truck(), name))


def test_age_adds_up_and_leaves_the_new_numbers_alone():
    new = Truck()
    once, twice = aged(new, 2e-3, 4e5), aged(aged(new, 1e-3, 1e5), 1e-3, 3e5)
    assert once == twice
    assert dataclasses.replace(once, wear=0.0, cycles=0.0) == new


def test_strokes_change_each_number_by_its_own_law():
    new = Truck(a_F=0.3, a_C=4.0, a_H=0.02)
    old = worn_parameters(new.replace({"cycles": 2e5}))
    settled = 1 - 0.02 * (1 - math.exp(-1))
    expected = {"F_C": 1.06, "C_AB": 1.8, "C_A0": 1.8, "H": settled, "F_r": settled}
    assert {name: old[name] / getattr(new, name) for name in expected} == pytest.approx(expected, rel=1e-12)
    assert old["y_r"] == 0.0


def test_wear_moves_the_engaged_rest():
    assert worn_parameters(Truck(i_w=0.5, wear=2e-3))["y_r"] == pytest.approx(-1e-3)
