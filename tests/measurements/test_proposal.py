"""Channel maps proposed from names, units and ranges."""

import numpy as np
import pytest

from clutchid.measurements.columns import REQUIRED
from clutchid.measurements.map.proposal import map_for, propose
from fixtures.cases import case_tables, cases

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


def samples(low, high, switched=""):
    return low + (high - low) * (DUTY if switched else np.arange(100) / 99)


@pytest.mark.parametrize("case", cases(__file__, "proposals"))
def test_a_map_is_proposed_from_names_units_and_ranges(source, case):
    columns = {name: (unit or None, samples(*values)) for name, unit, *values in case["channels"]}
    proposal = propose(source(columns, clock=case.get("clock", False)), tuple(case.get("required", REQUIRED)))
    assert chosen(proposal) == case.get("chosen", chosen(proposal))
    entries = proposal.channels.channels
    assert {name: entries[name].unit for name in case.get("units", {})} == case.get("units", {})
    assert proposal.complete == case.get("complete", proposal.complete), proposal.open
    for said, sentences in (("open", proposal.open), ("notes", proposal.notes)):
        assert [part for part in case.get(said, []) if not any(part in sentence for sentence in sentences)] == []


def test_the_same_name_in_two_groups_gets_its_group(source):
    raster = {"t": ("s", TIME), "ClutchPos": ("mm", TIME)}
    proposal = propose(source(raster, {"t": ("s", TIME), "ClutchPos": ("V", TIME)}))
    assert proposal.channels.channels["position"].group == "group 0"


def test_a_channel_that_rests_for_its_first_samples_only_is_not_constant(source):
    late = np.r_[np.zeros(70_000), np.ones(10)]
    proposal = propose(source({"t": ("s", np.arange(late.size) / 1000), "ClutchPos": ("mm", late)}), ("position",))
    assert proposal.channels.channels["position"].channel == "ClutchPos"


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


def test_standard_names_need_no_warning_that_they_were_identified(source):
    columns = {"time": ("s", TIME), "position": ("mm", TIME), "force": ("N", TIME)}
    assert map_for(source(columns), ("time", "position", "force")).comment == ""
    other = {"time": ("s", TIME), "Weg": ("mm", TIME), "force": ("N", TIME)}
    assert "were identified by their names" in map_for(source(other), ("position", "force")).comment


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


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("duty", DUTIES)
def test_a_duty_cycle_with_a_unit_is_proposed_before_what_lies_beside_it_which_is_named(source, duty, beside):
    columns = {"Zeit": ("s", TIME), "Kupplungsweg": ("mm", 20 * TIME)}
    for valve in ("Be", "Ent"):
        columns |= {duty.format(valve): DUTIES[duty], beside.format(valve): BESIDE[beside]}
    proposal, best, other = propose(source(columns, clock=False)), duty.format("Be"), beside.format("Be")
    assert chosen(proposal)["duty_supply"] == best
    assert chosen(proposal)["duty_exhaust"] == duty.format("Ent")
    assert proposal.complete, proposal.open
    (note,) = [note for note in proposal.notes if note.startswith("duty_supply")]
    assert note.startswith(f"duty_supply: '{best}' is proposed; by name it may also be '{other}'")
