"""Supply pressure and air temperature in files of all formats: proposed, written as a map, and read in Pa and K."""

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat

from clutchid.measurements import read
from clutchid.measurements.look import look
from clutchid.measurements.map.channel_map import read_map, write_map
from clutchid.measurements.map.proposal import propose
from fixtures.air_on_the_bus import AMBIENT, CELSIUS, DBC, PRESSURES, asc_of, blf_of, mdf_of
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_conditions_in_files")

TIME = np.arange(100) / 100
DUTY = (TIME % 0.2 < 0.1) * 1.0
ACTUATOR = {"t": ("s", TIME), "Weg": ("mm", 20 * TIME), "uSup": ("%", 100 * DUTY), "uExh": ("%", 90 * DUTY)}


def always(value):
    return np.full(TIME.size, float(value))


def proposal_of(source, columns):
    return propose(source({**ACTUATOR, **columns}, clock=False))


def chosen(proposal):
    entries = proposal.channels.channels
    return {name: entries[name].channel for name in ("pressure_supply", "temperature_ambient") if name in entries}


@pytest.mark.parametrize("write", [asc_of, blf_of, mdf_of])
def test_air_and_weather_beside_the_frames_of_an_actuator_are_proposed_and_read(tmp_path, write):
    file = write(tmp_path)
    seen = look(file, AMBIENT, dbc=[] if file.suffix == ".mf4" else [tmp_path / "truck.dbc"])
    proposal = seen.proposal
    assert proposal.complete, proposal.open
    assert chosen(proposal) == {"pressure_supply": "AuxEquipmentSupplyPress", "temperature_ambient": "AmbientAirTemp"}
    assert "circuit 4" in " ".join(proposal.notes)
    write_map(proposal.channels, tmp_path / "MAP.toml")
    assert read_map(tmp_path / "MAP.toml").channels["pressure_supply"].unit == "kPa(g)"
    for channels in (None, tmp_path / "MAP.toml"):
        log = read(file, ambient=AMBIENT, channels=channels, dbc=[tmp_path / "truck.dbc"])
        supply, air = (log[name][np.isfinite(log[name])] for name in ("pressure_supply", "temperature_ambient"))
        # 8 kPa a bit, gauge; 1/32 K a bit from -273 degC, not from -273.15
        np.testing.assert_allclose(supply, PRESSURES["AuxEquipmentSupplyPress"] * 1e3 + AMBIENT)
        np.testing.assert_allclose(air, CELSIUS + 273.15)
        assert supply.size > 0.5 * len(log)


@pytest.mark.parametrize("suffix", [".csv", ".mat"])
def test_conditions_in_tables_and_in_matlab_files_are_read_by_their_names(tmp_path, suffix):
    channels = {"t_s": TIME, "Kupplungsweg_mm": 20 * TIME, "uSup_pct": 100 * DUTY, "uExh_pct": 90 * DUTY}
    channels |= {"Vorratsdruck_bar_g": always(8.4), "Aussentemperatur_degC": always(4.0)}
    if suffix == ".mat":
        savemat(tmp_path / "run.mat", channels)
    else:
        pl.DataFrame(channels).write_csv(tmp_path / "run.csv")
    log = read(tmp_path / f"run{suffix}", ambient=AMBIENT)
    assert log["pressure_supply"] == pytest.approx(always(8.4e5 + AMBIENT))
    assert log["temperature_ambient"] == pytest.approx(always(277.15))


def test_a_parameter_of_the_bus_is_known_by_its_place_whatever_its_name(tmp_path):
    file = asc_of(tmp_path)
    text = DBC
    for number, name in enumerate((*PRESSURES, "AmbientAirTemp")):
        text = text.replace(f" {name} ", f" Sig_{number} ")
    (tmp_path / "truck.dbc").write_text(text)
    proposal = look(file, dbc=[tmp_path / "truck.dbc"]).proposal
    assert chosen(proposal) == {"pressure_supply": "Sig_4", "temperature_ambient": f"Sig_{len(PRESSURES)}"}
    # another scale than the standard's: another signal
    (tmp_path / "truck.dbc").write_text(text.replace("(8,0)", "(5,0)"))
    assert "pressure_supply" not in look(file, dbc=[tmp_path / "truck.dbc"]).proposal.channels.channels


SUPPLY = "Vorratsdruck Versorgungsdruck P_Luft SupplyPressure Kreisdruck_4 reservoir_press"
AIR = "Außentemperatur Umgebungstemperatur T_Aussen AmbientTemp Lufttemperatur OutsideAirTemp"


@pytest.mark.parametrize("names", [*zip(SUPPLY.split(), AIR.split(), strict=True)])
@pytest.mark.parametrize(("bar", "celsius"), [("bar", "degC"), ("BAR", "°C"), ("Bar", "C")])
def test_conditions_that_never_change_are_proposed_by_german_and_english_names(source, names, bar, celsius):
    proposal = proposal_of(source, {names[0]: (bar, always(9.4)), names[1]: (celsius, always(17.0))})
    assert chosen(proposal) == dict(zip(("pressure_supply", "temperature_ambient"), names, strict=True))
    assert proposal.complete
    assert f"pressure_supply: '{names[0]}' [bar] is read as absolute" in " ".join(proposal.notes)


def test_of_several_pressures_the_nearest_to_the_clutch_is_proposed_with_a_reason(source):
    pressures = {name: ("kPa", always(value)) for name, value in PRESSURES.items()}
    order = ["PowertrainCircuitAirSupplyPress", "AuxEquipmentSupplyPress", "PneumaticSupplyPress"]
    for name in order:
        proposal = proposal_of(source, pressures)
        assert proposal.channels.channels["pressure_supply"].channel == name
        assert any(f"'{name}' is proposed, because" in note for note in proposal.notes)
        del pressures[name]
    # what is left are the brakes, uncertain, and parking, trailer and suspension, which supply no clutch
    for said in ("'ServiceBrakeCircuit2AirPress' would match as well. It is left out", "in a circuit of the brakes"):
        proposal = proposal_of(source, pressures)
        assert chosen(proposal) == {}
        assert any(said in note for note in proposal.notes)
        assert proposal.complete
        del pressures["ServiceBrakeCircuit1AirPress" if "2" in said else "ServiceBrakeCircuit2AirPress"]


@pytest.mark.parametrize(("name", "unit", "value"), CASES["what_cannot_be_the_supply_or_the_air_is_not_proposed"])
def test_what_cannot_be_the_supply_or_the_air_is_not_proposed(source, name, unit, value):
    proposal = proposal_of(source, {name: (unit, always(value))})
    assert chosen(proposal) == {}
    assert proposal.complete
    assert "pressure_a" not in proposal.channels.channels


def test_a_set_point_is_not_what_is_measured(source):
    columns = {"t": ("s", TIME), "uSup": ("%", 100 * DUTY), "uExh": ("%", 90 * DUTY)}
    for wanted in ("Soll", "Sollwert", "set", "setpoint", "target", "demand", "cmd", "command", "ref", "desired"):
        both = {f"Kupplungsweg_{wanted}": ("mm", 20 * TIME), "Kupplungsweg_Ist": ("mm", 20 * TIME)}
        proposal = propose(source({**columns, **both}, clock=False))
        assert proposal.complete, wanted
        assert proposal.channels.channels["position"].channel == "Kupplungsweg_Ist"
    alone = propose(source({**columns, "WegSoll": ("mm", 20 * TIME)}, clock=False))
    assert "position: only a set point matches by name, 'WegSoll'; add the measured channel to the map." in alone.open
    duties = {**ACTUATOR, "uSup_Soll": ("%", 100 * DUTY), "uExh_Soll": ("%", 90 * DUTY)}
    assert propose(source(duties, clock=False)).channels.channels["duty_supply"].channel == "uSup"
