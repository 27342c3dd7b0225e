"""Channel maps proposed from names, units and ranges."""

import numpy as np
import pytest

from clutchid.io.columns import REQUIRED
from clutchid.io.map.proposal import map_for, propose

TIME = np.arange(100) / 100
DUTY = (TIME % 0.2 < 0.1) * 1.0


def proposed(source, *names, units=("s", "mm", "%", "%", "bar(g)"), scale=(1, 20, 100, 100, 8)):
    columns = {
        name: (unit, factor * (TIME if i in (0, 1, 4) else DUTY))
        for i, (name, unit, factor) in enumerate(zip(names, units, scale, strict=False))
    }
    return propose(source(columns, clock=False))


@pytest.mark.parametrize(
    "names",
    [
        ("time", "ClutchPos", "DutySupply", "DutyExhaust", "ClutchPressure"),
        ("t", "clutch_travel", "pwm_inlet_valve", "pwm_outlet_valve", "p_clutch"),
        ("Zeit", "Kupplungsweg", "Tastverhältnis_Zuluft", "Tastverhältnis_Abluft", "Kupplungsdruck"),
        ("Zeit", "KupplungsWeg_ist", "Belüftungsventil", "Entlüftungsventil", "Druck_Zylinder"),
        ("timestamps", "Actuator.Stroke", "Valve_Fill_Cmd", "Valve_Vent_Cmd", "Chamber_Press"),
    ],
)
def test_english_and_german_names_are_known(source, names):
    found = proposed(source, *names)
    told = {name: entry.channel for name, entry in found.channels.channels.items()}
    assert told == dict(zip(("time", "position", "duty_supply", "duty_exhaust", "pressure_a"), names, strict=True))
    assert found.complete, found.open


def test_other_pressures_and_positions_are_left_alone(source):
    names = ("time", "ThrottlePosition", "BrakePressure", "EngineOilPress", "Kupplungsweg", "Steering_Pos")
    columns = {name: ("bar" if "ress" in name else "s" if name == "time" else "mm", TIME) for name in names}
    found = propose(source(columns, clock=False))
    assert {name: entry.channel for name, entry in found.channels.channels.items()} == {
        "time": "time",
        "position": "Kupplungsweg",
    }
    assert found.open == (
        "duty_supply: no channel name matches; add it to the map.",
        "duty_exhaust: no channel name matches; add it to the map.",
    )


def test_a_j1939_reservoir_is_the_supply_and_a_circuit_is_no_chamber(source):
    columns = {"time": ("s", TIME), "PneumaticSupplyPress": ("kPa", 900 + TIME), "Clutch_Pos": ("%", TIME)}
    found = propose(source(columns))
    assert {name: entry.channel for name, entry in found.channels.channels.items()} == {
        "pressure_supply": "PneumaticSupplyPress"
    }


def test_a_unit_is_guessed_from_the_range_and_has_to_be_confirmed(source):
    names = ("t", "Weg", "duty_fill", "duty_vent", "press")
    found = proposed(source, *names, units=(None,) * 5)
    units = {name: entry.unit for name, entry in found.channels.channels.items()}
    assert units == {"time": "s", "position": "mm", "duty_supply": "%", "duty_exhaust": "%", "pressure_a": "bar"}
    assert not found.complete
    assert "position: 'Weg' has no unit; [mm] is guessed from its range." in found.open


def test_two_that_fit_as_well_are_told(source):
    found = proposed(
        source, "t", "Weg", "duty_fill", "duty_vent", "p", units=("s", "mm", "1", "1", "bar"), scale=(1,) * 5
    )
    assert found.complete
    columns = {"t": ("s", TIME), "Weg 1": ("mm", TIME), "Weg 2": ("mm", TIME)}
    both = propose(source(columns, clock=False))
    assert "position: 'Weg 1' is proposed, but 'Weg 2' would match as well." in both.open


def test_the_same_name_in_two_groups_gets_its_group(source):
    raster = {"t": ("s", TIME), "ClutchPos": ("mm", TIME)}
    found = propose(source(raster, {"t": ("s", TIME), "ClutchPos": ("V", TIME)}))
    assert found.channels.channels["position"].group == "group 0"


def test_a_given_map_wins(source):
    given = propose(source({"t": ("s", TIME), "Weg": ("mm", TIME)})).channels
    assert map_for(source({"t": ("s", TIME), "ClutchPos": ("mm", TIME)}), given, REQUIRED) is given
