"""Channel maps proposed from names, units and ranges."""

import numpy as np
import pytest

from clutchid.measurements.columns import REQUIRED
from clutchid.measurements.map.proposal import map_for, propose
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_proposal")

TIME = np.arange(100) / 100
DUTY = (TIME % 0.2 < 0.1) * 1.0


def proposed(source, *names, units=("s", "mm", "%", "%", "bar(g)"), scale=(1, 20, 100, 100, 8)):
    columns = {
        name: (unit, factor * (TIME if i in (0, 1, 4) else DUTY))
        for i, (name, unit, factor) in enumerate(zip(names, units, scale, strict=False))
    }
    return propose(source(columns, clock=False))


def chosen(proposal):
    """The channel of each quantity."""
    return {name: entry.channel for name, entry in proposal.channels.channels.items()}


@pytest.mark.parametrize("names", CASES["english_and_german_names_are_known"])
def test_english_and_german_names_are_known(source, names):
    proposal = proposed(source, *names)
    assert chosen(proposal) == dict(
        zip(("time", "position", "duty_supply", "duty_exhaust", "pressure_a"), names, strict=True)
    )
    assert proposal.complete, proposal.open


def test_other_pressures_and_positions_are_left_alone(source):
    names = ("time", "ThrottlePosition", "BrakePressure", "EngineOilPress", "Kupplungsweg", "Steering_Pos")
    columns = {name: ("bar" if "ress" in name else "s" if name == "time" else "mm", TIME) for name in names}
    proposal = propose(source(columns, clock=False))
    assert chosen(proposal) == {"time": "time", "position": "Kupplungsweg"}
    assert proposal.open == (
        "duty_supply: no channel name matches; add it to the map (no channel has a unit of it).",
        "duty_exhaust: no channel name matches; add it to the map (no channel has a unit of it).",
    )


def test_a_j1939_reservoir_is_the_supply_and_a_circuit_is_no_chamber(source):
    columns = {"time": ("s", TIME), "PneumaticSupplyPress": ("kPa", 900 + TIME), "Clutch_Pos": ("%", TIME)}
    proposal = propose(source(columns))
    assert chosen(proposal) == {"pressure_supply": "PneumaticSupplyPress"}


def test_a_unit_is_guessed_from_the_range_and_has_to_be_confirmed(source):
    names = ("t", "Weg", "duty_fill", "duty_vent", "press")
    proposal = proposed(source, *names, units=(None,) * 5)
    units = {name: entry.unit for name, entry in proposal.channels.channels.items()}
    assert units == {"time": "s", "position": "mm", "duty_supply": "%", "duty_exhaust": "%", "pressure_a": "bar(g)"}
    assert not proposal.complete
    assert "position: 'Weg' has no unit; [mm] is guessed from its range." in proposal.open


def test_two_that_fit_as_well_are_told(source):
    names, units = ("t", "Weg", "duty_fill", "duty_vent", "p"), ("s", "mm", "1", "1", "bar(g)")
    assert proposed(source, *names, units=units, scale=(1,) * 5).complete
    columns = {"t": ("s", TIME), "Weg 1": ("mm", TIME), "Weg 2": ("mm", TIME)}
    both = propose(source(columns, clock=False))
    assert "position: 'Weg 1' is proposed, but 'Weg 2' would match as well." in both.open


def test_the_same_name_in_two_groups_gets_its_group(source):
    raster = {"t": ("s", TIME), "ClutchPos": ("mm", TIME)}
    proposal = propose(source(raster, {"t": ("s", TIME), "ClutchPos": ("V", TIME)}))
    assert proposal.channels.channels["position"].group == "group 0"


def test_a_constant_channel_is_proposed_for_nothing(source):
    still = np.full(100, 3.3)
    columns = {"t": ("s", TIME), "ClutchPos": ("mm", still), "Weg": ("mm", TIME), "pCyl": ("bar", still)}
    proposal = propose(source(columns, clock=False), (*REQUIRED, "pressure_a"))
    assert chosen(proposal) == {"time": "t", "position": "Weg"}
    said = "pressure_a: only constant channels match by name, 'pCyl' (always 3.3); add the right one to the map."
    assert said in proposal.open


def test_a_channel_that_rests_for_its_first_samples_only_is_not_constant(source):
    late = np.r_[np.zeros(70_000), np.ones(10)]
    proposal = propose(source({"t": ("s", np.arange(late.size) / 1000), "ClutchPos": ("mm", late)}), ("position",))
    assert proposal.channels.channels["position"].channel == "ClutchPos"


@pytest.mark.parametrize(("others", "proposed"), [(0, True), (1, False)])
def test_a_duty_cycle_of_0_is_proposed_only_if_its_name_is_unambiguous(source, others, proposed):
    columns = {"t": ("s", TIME), "ClutchPos": ("mm", TIME), "uSup": ("%", DUTY), "uExh": ("%", 0 * TIME)}
    columns |= {f"dc_vent_{i}": ("%", 0 * TIME) for i in range(others)}
    proposal = propose(source(columns))
    assert ("duty_exhaust" in proposal.channels.channels) == proposed
    assert proposal.complete == proposed
    assert ("duty_exhaust: 'uExh' is constant at 0." in proposal.notes) == proposed


def test_a_constant_channel_with_the_standard_name_is_that_quantity(source):
    proposal = propose(source({"t": ("s", TIME), "position": ("mm", 0 * TIME), "Weg": ("mm", TIME)}), ("position",))
    assert proposal.channels.channels["position"].channel == "position"


@pytest.mark.parametrize(
    ("unit", "low", "proposed"),
    [("bar", 0.02, "bar(g)"), ("bar", 0.98, None), ("kPa", 2.0, "kPa(g)"), ("Pa", 95e3, None), ("bar(g)", 0.0, None)],
)
def test_a_pressure_near_0_at_rest_is_proposed_as_gauge_pressure(source, unit, low, proposed):
    scale = {"bar": 1, "kPa": 100, "Pa": 1e5, "bar(g)": 1}[unit]
    proposal = propose(source({"t": ("s", TIME), "pCyl": (unit, low + 6 * scale * TIME)}), ())
    assert proposal.channels.channels["pressure_a"].unit == proposed
    assert proposal.complete == (proposed is None)
    if proposed:
        assert f"falls to {low:g} {unit}, so that the gauge unit [{proposed}] is guessed" in proposal.open[0]


@pytest.mark.parametrize(
    ("interval", "unit"),
    [(0.001, "s"), (0.1, "s"), (1.0, "ms"), (10.0, "ms"), (1e3, "us"), (1e5, "us"), (1e6, "ns"), (1e-3 / 86400, "d")],
)
def test_the_unit_of_time_is_guessed_from_the_interval(source, interval, unit):
    for clock in (False, True):
        proposal = propose(
            source({"t": (None, np.arange(100) * interval), "Weg": ("mm", TIME)}, clock=clock), ("time",)
        )
        proposed = proposal.channels.channels.get("time")
        if clock and unit == "s":
            assert proposed is None
        else:
            assert proposed.unit == unit
            assert proposal.open == (f"time: 't' has no unit; [{unit}] is guessed from its intervals.",)


def test_the_time_of_a_file_of_windows_counts_100_ns(source):
    proposal = propose(
        source({"t": (None, 1.335e17 + 1e4 * np.arange(100)), "Weg": ("mm", TIME)}, clock=False), ("time",)
    )
    assert proposal.channels.channels["time"].unit == "100ns"


def test_standard_names_need_no_warning_that_they_were_identified(source):
    columns = {"time": ("s", TIME), "position": ("mm", TIME), "force": ("N", TIME)}
    assert map_for(source(columns), ("time", "position", "force")).comments[""] == ""
    other = {"time": ("s", TIME), "Weg": ("mm", TIME), "force": ("N", TIME)}
    assert "were identified by their names" in map_for(source(other), ("position", "force")).comments[""]


def test_a_missing_quantity_has_the_channels_with_its_unit_as_candidates(source):
    columns = {"t": ("s", TIME), "Weg": ("mm", TIME), "A": ("%", DUTY), "B": ("1", DUTY), "n": ("rpm", TIME)}
    proposal = propose(source(columns, clock=False))
    assert proposal.channels.comments["duty_supply"] == "candidates: 'A', 'B'"
    assert "duty_supply: no channel name matches; add it to the map (candidates: 'A', 'B')." in proposal.open
    assert "rate" not in proposal.channels.comments
    without = propose(source({"Weg": ("mm", TIME), "A": (None, DUTY)}, clock=False))
    assert without.channels.comments["duty_supply"] == "candidates: 'A'"
    assert without.channels.comments["rate"] == "samples per second, for a file without time"
    assert "time: no channel name matches; add it to the map, or rate = 1000.0 (Hz)." in without.open


PERCENT = np.linspace(0.0, 100.0, 100)
FLAG = 1.0 * (PERCENT > 20)

#: A channel of each valve, {} for "Be" and "Ent": unit and samples.
DUTIES = {"TV_{}lueften": ("%", PERCENT), "Tastgrad_{}": ("%", PERCENT), "PWM_{}": ("1", PERCENT / 100)}
BESIDE = {
    "MV_{}_aktiv": (None, FLAG), "MV_{}_active": ("1", FLAG), "MV_{}": (None, FLAG),
    "Kupplung_PWM_MV_{}_Status": (None, FLAG),
    "PWM_{}_valid": ("1", 3.0 * FLAG), "PWM_{}_Fehler": (None, FLAG), "TV_{}_Soll": ("%", 0.9 * PERCENT),
    "PWM_{}_target": ("%", 0.9 * PERCENT), "Ventilstrom_{}": (None, PERCENT), "Kupplung_Ventil_{}": (None, PERCENT),
}  # fmt: skip


def proposed_of_valves(source, channels):
    """The proposal for a file with these channels of each valve, and the names of those of the supply valve."""
    columns = {"Zeit": ("s", TIME), "Kupplungsweg": ("mm", 20 * TIME)}
    for valve in ("Be", "Ent"):
        columns |= {name.format(valve): channel for name, channel in channels.items()}
    return propose(source(columns, clock=False)), [name.format("Be") for name in channels]


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("duty", DUTIES)
def test_a_duty_cycle_with_a_unit_is_proposed_before_what_lies_beside_it_which_is_named(source, duty, beside):
    proposal, (best, other) = proposed_of_valves(source, {duty: DUTIES[duty], beside: BESIDE[beside]})
    assert chosen(proposal)["duty_supply"] == best
    assert chosen(proposal)["duty_exhaust"] == duty.format("Ent")
    assert proposal.complete, proposal.open
    (note,) = [note for note in proposal.notes if note.startswith("duty_supply")]
    assert note.startswith(f"duty_supply: '{best}' is proposed; by name it may also be '{other}' (")


def test_the_same_duty_cycle_in_another_unit_is_no_other_one(source):
    proposal, names = proposed_of_valves(source, {"PWM_{}": ("%", PERCENT), "PWM_{}_norm": ("1", PERCENT / 100)})
    assert proposal.complete, proposal.open
    assert f"'{names[1]}' (the same in 1)" in proposal.notes[0]
    half, _ = proposed_of_valves(source, {"PWM_{}": ("%", PERCENT), "PWM_{}_norm": ("1", PERCENT / 200)})
    assert [line.split(":")[0] for line in half.open] == ["duty_supply", "duty_exhaust"]


@pytest.mark.parametrize("unit", [None, "1"])
def test_flags_alone_have_to_be_confirmed(source, unit):
    proposal, (name,) = proposed_of_valves(source, {"MV_{}_aktiv": (unit, FLAG)})
    assert proposal.open[0].startswith(
        f"duty_supply: '{name}' is called like a flag or a state; write it into a channel map"
    )
    switched, _ = proposed_of_valves(source, {"MV_{}": ("1", FLAG)})
    assert switched.complete, "valves that are only switched have such duty cycles"


def test_a_channel_of_the_other_valve_is_none_of_this_one(source):
    columns = {"Zeit": ("s", TIME), "Kupplungsweg": ("mm", TIME), "Valve_Exhaust_open": ("%", PERCENT)}
    assert "duty_supply" not in chosen(propose(source(columns, clock=False)))
