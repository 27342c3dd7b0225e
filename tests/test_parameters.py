"""`Parameters`: checked where they are built, in words that say what, got, allowed, where."""

import dataclasses

import numpy as np
import pytest

from clutchid.errors import ParameterError
from clutchid.names import unknown_name
from clutchid.parameters import Parameters
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_parameters")


def test_a_negative_conductance_is_refused_in_the_words_of_the_design():
    with pytest.raises(ParameterError) as caught:
        Parameters(C_vs=-1.9e-8)
    assert str(caught.value) == (
        "C_vs = -1.9e-08 m³/(Pa·s): a conductance must be at least 0 and at most 1e-05. Appendix A has 1.9e-08."
    )


@pytest.mark.parametrize(("name", "wrong"), CASES["outside"])
def test_a_number_outside_its_range_is_refused_by_name(name, wrong):
    with pytest.raises(ParameterError, match=f"^{name} = "):
        Parameters(**{name: wrong})


@pytest.mark.parametrize(("name", "edge"), CASES["an_edge_that_belongs_to_the_range_is_taken"])
def test_an_edge_that_belongs_to_the_range_is_taken(name, edge):
    assert getattr(Parameters(**{name: edge}), name) == edge


@pytest.mark.parametrize(("name", "wrong", "allowed"), CASES["what_no_actuator_has_is_refused_and_the_range_is_named"])
def test_what_no_actuator_has_is_refused_and_the_range_is_named(name, wrong, allowed):
    with pytest.raises(ParameterError) as caught:
        Parameters(**{name: wrong})
    unit = Parameters.row(name).unit
    assert str(caught.value) == f"{name} = {wrong:g} {unit}: it must be {allowed}"


#: Symbol, and the smallest and the largest value of real actuators: the miniature cylinders and the heaviest clutch
#: actuators and valves of catalogues, and the lengths, pressures and temperatures that these are made for.
REAL = CASES["real"]


@pytest.mark.parametrize("name", sorted(REAL))
def test_the_range_of_a_magnitude_is_ten_times_wider_than_what_actuators_have(name):
    row, (low, high) = Parameters.row(name), REAL[name]
    assert row.admits(low / 10)
    assert row.admits(high * 10)


@pytest.mark.parametrize("wrong", ["9e5", None, True, [9e5]])
def test_what_is_no_number_is_refused(wrong):
    with pytest.raises(ParameterError, match=r"P_S = .*a number in Pa is needed"):
        Parameters(P_S=wrong)


def test_all_problems_are_named_at_once():
    with pytest.raises(ParameterError) as caught:
        Parameters(M=-1.0, C_vs=-1.0, B_0=2.0)
    assert [line.split(" ")[0] for line in str(caught.value).splitlines()] == ["M", "C_vs", "B_0"]


@pytest.mark.parametrize("valve", ["vs", "ve"])
def test_a_valve_must_open_with_its_duty_cycle(valve):
    with pytest.raises(ParameterError, match=f"R_0{valve} = 0.5 must be below R_1{valve} = 0.5: a valve opens with"):
        Parameters(**{f"R_0{valve}": 0.5, f"R_1{valve}": 0.5})


def test_the_rod_takes_area_from_chamber_b():
    with pytest.raises(ParameterError, match="A_B"):
        Parameters(A_B=13e-3)
    assert Parameters(A_B=12.3e-3).A_B == 12.3e-3


def test_parameters_cannot_be_changed_only_replaced():
    parameters = Parameters()
    with pytest.raises(dataclasses.FrozenInstanceError):
        parameters.M = 12.0
    other = parameters.replace({"M": 12})
    assert (parameters.M, other.M) == (10.0, 12.0)
    assert isinstance(other.M, float)


def test_replacing_checks_again_and_names_the_nearest():
    with pytest.raises(ParameterError, match="did you mean 'C_vs'"):
        Parameters().replace({"C_sv": 1e-8})
    with pytest.raises(ParameterError, match="at least 0"):
        Parameters().replace({"C_vs": -1e-8})


def test_numpy_numbers_are_numbers():
    assert Parameters(M=np.float32(12.0), P_S=np.int64(900000)).array()[7:9].tolist() == [12.0, 9e5]


def test_the_array_is_in_the_order_of_the_names():
    parameters = Parameters()
    assert parameters.array().tolist() == [getattr(parameters, name) for name in Parameters.names()]
    assert parameters.array().dtype == np.float64


def test_every_row_has_unit_meaning_range_and_source():
    for name in Parameters.names():
        row = Parameters.row(name)
        assert row.unit
        assert row.meaning
        assert row.source
        assert row.low < row.high
        assert row.admits(getattr(Parameters(), name))
        assert np.isfinite([row.low, row.high]).all()


def test_the_range_in_words():
    assert Parameters.row("C_vs").allowed == "at least 0 and at most 1e-05"
    assert Parameters.row("M").allowed == "at least 1e-05 and at most 100000"
    assert Parameters.row("B_ve").allowed == "at least -1 and at most 1"


def test_an_unknown_row_is_refused_with_the_nearest():
    with pytest.raises(ParameterError, match="did you mean 'V_0A'"):
        Parameters.row("V0A")


def test_a_name_like_no_other_gets_the_list_without_a_guess():
    text = unknown_name("xyzzy", ["C_vs", "P_S"])
    assert text.startswith("no parameter 'xyzzy'")
    assert "did you mean" not in text
    assert text.endswith("Known are C_vs, P_S.")
