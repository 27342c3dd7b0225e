"""Actuators that lack a chamber or a valve, or have a 3/2 valve in place of two."""

from __future__ import annotations

import numpy as np
import pytest

from clutchid.errors import DataError, ParameterError
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.model.equipment import VALVES, Equipment
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from fixtures.cases import case_tables

CASES = case_tables(__file__, "refusals")

STROKE = np.arange(400) * 1e-3
OPEN = np.where(STROKE < 0.15, 1.0, 0.0)


def cylinder(equipment: Equipment, model: str = "isothermal", **values: float) -> Actuator:
    """A soft cylinder of 20 mm bore that lifts 1.5 kg."""
    numbers = {
        "A_A": 3.14e-4, "A_B": 2.6e-4, "V_0A": 4e-5, "V_0B": 2e-5, "M": 1.5, "y_max": 0.125, "P_0": 1e5, "P_S": 3e5,
        "C_vs": 5e-8, "C_ve": 5e-8, "D_v": 30.0, "F_C": 10.0, "K_z": 2e4, "D_zdot": 30.0, "K_stop": 1e6,
        "D_stop": 300.0, "V_S": 1.0, "F_h": 1.0, "K_h": 2e3,
    }  # fmt: skip
    load = Load((14.7,) * 4, (0.0, 0.125), basis="b-spline")
    return Actuator(Parameters(**(numbers | values)), load, model, equipment)


@pytest.mark.parametrize("model", VARIANTS)
def test_without_chamber_b_its_pressure_is_the_ambient_one_always(model):
    recording = Log(STROKE, {"duty_supply": OPEN, "duty_exhaust": 1.0 - OPEN})
    stroke = simulate(cylinder(Equipment(chamber_b=False), model), recording).log
    assert np.ptp(stroke["position"]) > 0.03
    # 1 m³ is squeezed by 1e-9 m² over a stroke: 1e-10 of the pressure, 1e-5 Pa
    assert np.abs(stroke["pressure_b"] - 1e5).max() < 2e-5


def test_a_chamber_b_that_breathes_freely_is_as_good_as_none():
    t = np.arange(1500) * 1e-4
    recording = Log(t, {"duty_supply": np.ones(t.size), "duty_exhaust": np.zeros(t.size)})
    none = simulate(cylinder(Equipment(chamber_b=False)), recording).log
    free = simulate(cylinder(Equipment(), C_r=1e-6), recording).log
    force = 2.6e-4 * float(np.abs(free["pressure_b"] - 1e5).max())
    assert 0.0 < force < 2e-3
    # so much force moves 1.5 kg so far in the 0.15 s of the stroke; as much again comes of the volume that follows
    far = force / 1.5 * t[-1] ** 2 / 2
    assert np.abs(none["position"] - free["position"]).max() < 2 * far


def test_a_valve_that_does_not_exist_passes_nothing_and_needs_no_column():
    supplied = simulate(cylinder(Equipment(valves="supply")), Log(STROKE, {"duty_supply": OPEN})).log
    closed = Log(STROKE, {"duty_supply": OPEN, "duty_exhaust": np.zeros(STROKE.size)})
    assert np.array_equal(supplied["pressure_a"], simulate(cylinder(Equipment()), closed).log["pressure_a"])
    vented = simulate(cylinder(Equipment(valves="exhaust")), Log(STROKE, {"duty_exhaust": OPEN})).log
    assert np.all(vented["duty_supply"] == 0.0)
    assert vented["pressure_a"][-1] <= 1e5 + 1.0


def test_a_three_way_valve_vents_where_it_does_not_supply():
    single = Log(STROKE, {"duty_supply": OPEN})
    both = single.with_columns(duty_exhaust=1.0 - OPEN)
    three_way = simulate(cylinder(Equipment(valves="3/2")), single).log
    assert np.array_equal(three_way["position"], simulate(cylinder(Equipment()), both).log["position"])
    # what was simulated has both columns and can be simulated again
    again = simulate(cylinder(Equipment(valves="3/2")), three_way).log
    assert np.array_equal(again["duty_exhaust"], 1.0 - OPEN)


def test_a_missing_sample_of_a_three_way_valve_is_missing_in_both_duty_cycles():
    duty = OPEN.copy()
    duty[7] = np.nan
    driven = Equipment(valves="3/2").driven(Log(STROKE, {"duty_supply": duty}))
    assert np.flatnonzero(np.isnan(driven["duty_exhaust"])).tolist() == [7]


@pytest.mark.parametrize("valves", VALVES)
def test_a_recording_without_the_valve_that_exists_is_refused(valves):
    with pytest.raises(DataError, match="no column"):
        simulate(cylinder(Equipment(valves=valves)), Log(STROKE, {"position": np.zeros(STROKE.size)}))


def test_the_actuator_of_the_paper_is_complete_and_left_as_it_is():
    actuator = Actuator()
    assert actuator.equipment == Equipment()
    assert actuator.equipment.fixed == {}
    recording = Log(STROKE, {"duty_supply": OPEN, "duty_exhaust": 1.0 - OPEN})
    assert actuator.equipment.driven(recording) is recording
    assert not any(actuator.equipment.missing(name) for name in actuator.names)


@pytest.mark.parametrize(
    ("equipment", "name", "word"),
    [
        (Equipment(chamber_b=False), "C_r", "no chamber B"),
        (Equipment(chamber_b=False), "A_B", "no chamber B"),
        (Equipment(valves="supply"), "C_ve", "no exhaust valve"),
        (Equipment(valves="exhaust"), "P_S", "no supply valve"),
    ],
)
def test_a_number_of_what_does_not_exist_cannot_be_set(equipment, name, word):
    with pytest.raises(ParameterError, match=f"{name}.*{word}"):
        cylinder(equipment).replace({name: 1e-8})


def test_a_copy_with_other_numbers_keeps_its_equipment():
    copy = cylinder(Equipment(chamber_b=False, valves="3/2")).replace({"M": 2.0, "theta_1": 15.0})
    assert (copy.equipment.valves, copy.value("C_r"), copy.value("M")) == ("3/2", 0.0, 2.0)


@pytest.mark.parametrize(("entries", "words"), CASES["equipment"])
def test_equipment_that_cannot_be_is_told_in_words(entries, words):
    with pytest.raises(ParameterError) as caught:
        Equipment(**entries)
    assert all(word in str(caught.value) for word in words)
