"""``--free auto``: what a calibration frees, where it starts, and what it needs of the recordings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import clutchid
from clutchid.app import tasks
from clutchid.app.records import File, FitRecordings
from clutchid.cli.fit import FitOptions, run_fit
from clutchid.errors import DataError, SolveError
from clutchid.estimation.automatic import (
    AUTOMATIC,
    CLOSED_STD,
    DECAY,
    ON_OFF_DELAY,
    START_LAG,
    WITH_CARRIER,
    ambient_priors,
    automatic,
)
from clutchid.estimation.calibrate import fit_with, free_parameters
from clutchid.estimation.parameter_file import ParameterFile
from clutchid.estimation.request import FitRequest
from clutchid.estimation.shooting import SHOOTING
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.measurements import read, write
from clutchid.model import Actuator, Load
from clutchid.model.equipment import Equipment
from clutchid.model.variants import VARIANTS
from clutchid.preparation.pulses import centred
from clutchid.simulation import simulate
from clutchid.simulation.sensors import lagged
from clutchid.strokes.duty_cycle import duty_grid
from clutchid.strokes.vented_pressure import ABSOLUTE, without_zeros
from clutchid.truck import drive, truck
from clutchid.verbs import fitting
from clutchid.verbs.commands import FitCommand
from fixtures.changed_logs import spoiled, thinned

PAPER = (
    "C_vs", "C_ve", "R_0vs", "R_0ve", "R_1vs", "R_1ve", "V_0A", "P_S", "P_0", "F_C", "D_v", "K_z", "D_zdot", "C_r",
    "y_max", "tau_y", "tau_p", "M",
)  # fmt: skip
SHAPES = ("B_vs", "B_ve")
BALANCE = ("mu_h", "K_h", "b_vs", "m_vs", "b_ve", "m_ve", "T_w", "h_A", "V_S", "tau_S", "gamma")
STRIBECK = ("c_F", "R_S", "v_S")
CARRIER = ("s_vs", "s_ve", "a_0vs", "a_0ve", "t_vs", "t_ve")
EXPONENTS = ("n_vs", "n_ve")
AVERAGED = (*EXPONENTS, "tau_vs", "tau_ve")

FREED = {
    "isothermal": {*PAPER, *SHAPES},
    "isothermal-stribeck": {*PAPER, *SHAPES, *STRIBECK},
    "energy-balance": {*PAPER, *BALANCE, *EXPONENTS},
    "energy-balance-stribeck": {*PAPER, *BALANCE, *EXPONENTS, *STRIBECK},
    "energy-balance-stribeck-proportional": {*PAPER, *BALANCE, *AVERAGED, *STRIBECK},
}


@pytest.mark.slow
@pytest.mark.parametrize("model", VARIANTS)
def test_each_variant_frees_what_it_knows(drive_log, model):
    begin, free, _ = automatic([drive_log], Actuator(model=model))
    assert set(free) - set(begin.load.names) == FREED[model]
    assert free[:22] == begin.load.names, "the load is free on B-splines"
    assert len(free) == len(set(free))
    assert begin.model == model
    assert (begin.value("tau_y"), begin.value("tau_p")) == (START_LAG, START_LAG), "what sensors have"


@pytest.mark.slow
def test_a_calibration_finds_the_mass_that_moves(plant, recorded_by):
    """A mass that stays at its default is made up for by friction and lags, which warm strokes show as another load."""
    heavy = plant.replace({"M": 12.5})
    begin = replace(heavy, load=Load((7e5, 0.0, 0.0))).replace({"M": 10.0, "tau_y": 0.0, "tau_p": 0.0})
    result = fit_with(SHOOTING, [recorded_by(heavy)], begin, FitRequest(("position", "pressure_a"), ("auto",)))
    mass = result.parameters["M"]
    assert mass.std < 0.1 * 12.5, "the strokes of 8 s determine it better than its prior of 15 %"
    assert abs(mass.value - 12.5) < 2.0 * mass.std


def test_the_load_starts_as_near_as_splines_come_to_the_one_given(drive_log):
    load = Load((8e5, -1e4, 2e4))
    begin, _, _ = automatic([drive_log], Actuator(load=load))
    y = np.linspace(0, 0.02, 50)
    # the paper's splines have jumps of the second derivative at their knots, between those of the B-splines
    assert begin.load.force(y) == pytest.approx(load.force(y), abs=0.005 * load.force(y).max())
    own = Load.on_b_splines(load, (0.0, 0.01, 0.025))
    begin, free, _ = automatic([drive_log], Actuator(load=own))
    assert begin.load == own, "splines that are given stay"
    assert free[:5] == own.names


def test_a_recording_that_starts_in_a_stroke_reads_the_ambient_pressure_off_its_later_rests():
    log = drive(truck(0), seconds=20, seed=5, name="log").log
    inside = int(np.argmax(log["position"] > 8e-3))
    whole, cut = (automatic([part], Actuator())[2]["P_0"] for part in (log, log.slice(inside, len(log))))
    assert abs(cut.mean - whole.mean) < 3.0 * np.hypot(cut.std, whole.std)
    assert cut.std < 1.5e3, "the exhaust valve of this truck stays open until it has vented"


@pytest.mark.parametrize(("family", "number", "period"), [("A", 0, 0.005), ("B", 0, 0.01), ("B", 5, 0.0)])
def test_a_calibration_sees_whether_duty_cycles_are_latched(family, number, period):
    log = drive(truck(number, family), seconds=8, seed=5, name="log").log
    assert automatic([log], Actuator())[0].duty_period == pytest.approx(period)
    slow = thinned(log, 10)
    assert automatic([slow], Actuator())[0].duty_period is None, "a slow recording does not show it"
    assert automatic([slow], Actuator(duty_period=0.02))[0].duty_period == 0.02


def test_the_ambient_pressure_is_read_off_the_vented_rest(drive_log, plant):
    shifted = drive_log.with_columns(pressure_a=drive_log["pressure_a"] - 7e3)
    begin, free, priors = automatic([shifted], plant)
    ambient = priors["P_0"]
    assert ambient.mean == pytest.approx(109500.0 - 7e3, abs=600.0)
    assert ambient.std == CLOSED_STD
    assert begin.value("P_0") == ambient.mean
    assert "P_0" in free


@pytest.mark.parametrize("zero", [-8e3, 8.5e3, 30e3])
def test_a_zero_of_the_pressure_sensor_changes_no_load(drive_log, plant, zero):
    gauge = drive_log.with_columns(pressure_a=drive_log["pressure_a"] - 109500.0 + 101300.0)
    gauge = replace(gauge, metadata={"pressure_a_unit": "bar(g)", "ambient_Pa": "101300.0"})
    off = gauge.with_columns(pressure_a=gauge["pressure_a"] + zero)
    ((before, sound), (now, taken)) = (
        (fit.load_curve.force[:80], fit.recordings["log"].measured["pressure_a"])
        for fit in (clutchid.fit(log, plant, measure=("position", "pressure_a")) for log in (gauge, off))
    )
    # over the reach; the rest is read to some 0.1 kPa of noise, and 1 kPa is 12 N
    assert now == pytest.approx(before, abs=5.0)
    assert taken == pytest.approx(sound, abs=400.0)
    (rest,) = ambient_priors(without_zeros([off])).values()
    assert (rest.mean, rest.std) == (pytest.approx(101300.0), CLOSED_STD)


def shifted(log, pascal, name, start=0):
    """The recording with another offset of its pressure sensor, from a sample on."""
    cut = log.slice(start, len(log))
    return replace(cut.with_columns(pressure_a=cut["pressure_a"] + pascal), name=name)


def test_recordings_of_one_ambient_pressure_share_it(drive_log):
    (first,), several = (
        ambient_priors([shifted(drive_log, pascal, f"log{pascal}") for pascal in offsets]).items()
        for offsets in ((100.0,), (0.0, 200.0))
    )
    ((name, prior),) = several
    assert (name, prior.mean) == ("P_0", pytest.approx(first[1].mean))
    assert prior.std == first[1].std == CLOSED_STD


def test_recordings_of_another_ambient_pressure_have_their_own(drive_log, plant):
    logs = [shifted(drive_log, pascal, name) for name, pascal in (("valley", 0.0), ("hill", -9e3))]
    _, free, priors = automatic(logs, plant)
    assert {"P_0@valley", "P_0@hill"} <= {*free}
    assert "P_0" not in free
    assert priors["P_0@valley"].mean - priors["P_0@hill"].mean == pytest.approx(9e3)


@pytest.mark.parametrize("conditions", [{"priors": {"P_0": Prior(1.05e5, 5e3)}}, {"bounds": {"P_0": (0.9e5, 1.2e5)}}])
def test_recordings_share_an_ambient_pressure_that_a_prior_or_bounds_are_given_for(drive_log, plant, conditions):
    logs = [shifted(drive_log, pascal, name) for name, pascal in (("valley", 0.0), ("hill", -9e3))]
    _, free = free_parameters(logs, plant, FitRequest(("position", "pressure_a"), ("auto",), **conditions))
    assert [name for name in free.names if name.startswith("P_0")] == ["P_0"]
    assert free.priors["P_0"] == conditions.get("priors", {}).get("P_0", free.priors["P_0"])
    assert free.priors["P_0"].std >= 5e3, "the rests differ by 9 kPa"


def test_a_recording_without_a_rest_counts_for_nothing_beside_one_with_a_rest(drive_log):
    rising = int(np.argmax(drive_log["duty_supply"] > 0.0)) + 50
    never = drive_log.with_columns(duty_exhaust=np.zeros(len(drive_log)))
    whole, cut = shifted(drive_log, 0.0, "whole"), shifted(never, 0.0, "cut", rising)
    assert ambient_priors([whole, cut]) == ambient_priors([whole]), "its lowest pressure is that of a decay"
    assert ambient_priors([cut])["P_0"].std == ABSOLUTE.std
    low = ambient_priors([whole, shifted(never, -9e3, "low", rising)])
    assert {*low} == {"P_0@whole", "P_0@low"}, "a pressure below that of the rest is not of its weather"
    assert low["P_0@low"].mean < 1.03e5


@pytest.fixture
def unsettled(drive_log, tmp_path):
    """The file of a recording of absolute pressure that begins in a stroke and never vents."""
    rising = int(np.argmax(drive_log["duty_supply"] > 0.0)) + 50
    never = drive_log.with_columns(duty_exhaust=np.zeros(len(drive_log)))
    write(never.slice(rising, len(never)), tmp_path / "cut.csv")
    return tmp_path / "cut.csv"


@pytest.mark.parametrize("door", ["python", "cli", "app"])
def test_a_calibration_that_is_started_from_one_does_not_know_its_ambient_pressure(
    unsettled, door, monkeypatch, tmp_path
):
    """P_0 of a calibration without a rest is a guess, and stays one."""
    guess, logs = Actuator().replace(P_0=1.035e5), []
    stop = SolveError("no fit is needed")

    def fit_request(recordings, *_, **__):
        logs.extend(recordings)
        raise stop

    monkeypatch.setattr(fitting, "fit_request", fit_request)
    start = tmp_path / "guess.toml"
    clutchid.write_parameters(ParameterFile(guess), start)
    with pytest.raises(SolveError):  # noqa: PT012
        if door == "python":
            clutchid.calibrate(unsettled, guess, force=True)
        elif door == "cli":
            options = FitOptions(start=start, force=True)
            run_fit(options.command("calibrate", (unsettled,)), options)
        else:
            asked = FitCommand(verb="calibrate", logs=(unsettled,), force=True)
            task = FitRecordings(asked, "", (File(unsettled),), tmp_path, start=start)
            tasks.fit(task, SimpleNamespace(progress=lambda *_: None))
    assert ambient_priors(logs)["P_0"].std == ABSOLUTE.std


@pytest.mark.parametrize("number", [2, 3])
def test_an_exhaust_valve_that_closes_too_early_shows_no_ambient_pressure(shared, number):
    """Behind its dead zone the chamber of these trucks stays 0.07 and 0.14 bar above the 1.095 bar outside."""
    log = read(shared / "data" / "trucks" / f"truck{number}" / "calibration.csv")
    whole, late = replace(log.slice(0, 15000), name="whole"), replace(log.slice(15000, 30000), name="late")
    prior = automatic([late], Actuator())[2]["P_0"]
    assert (prior.mean, prior.std) == ABSOLUTE[:2]
    together = automatic([whole, late], Actuator())[2]["P_0"]
    assert together.mean == pytest.approx(1.095e5, abs=300.0)
    assert together.std < 300.0


def test_missing_pressure_at_the_rest_is_left_out(drive_log, plant):
    _, _, priors = automatic([spoiled(drive_log, "pressure_a", slice(0, 40, 2))], plant)
    assert priors["P_0"].mean == pytest.approx(109500.0, abs=1e3)


def test_the_default_model_is_proportional_where_there_is_no_carrier(drive_log):
    begin, free, _ = automatic([drive_log], Actuator(model=AUTOMATIC))
    assert begin.model == AUTOMATIC == "energy-balance-stribeck-proportional"
    assert set(AVERAGED) <= set(free)


@pytest.mark.slow
def test_with_a_carrier_the_valves_are_switched_and_their_phases_free(plant, recorded_by):
    switched = {"T_pwm": 0.01, "s_pwm": 0.3, "s_vs": 0.07, "s_ve": 0.07, "tau_p": 0.0}
    log = recorded_by(plant.replace(switched), seconds=6.0)
    for start in (plant, Actuator(model=AUTOMATIC)):
        begin, free, _ = automatic([log], start)
        assert begin.model == WITH_CARRIER == "energy-balance-stribeck"
        assert [begin.value(name) for name in ("T_pwm", "s_vs", "s_ve")] == [0.01, 0.07, 0.07]
        assert (begin.value("a_0vs"), begin.value("a_0ve")) == (DECAY, DECAY)
        assert set(CARRIER) <= set(free)
        assert not set(AVERAGED) & set(free), "an exponent bends the mean over a period only"
    # the paper's valves know no carrier, so nothing of it is freed
    isothermal, free, _ = automatic([log], replace(plant, model="isothermal"))
    assert isothermal.value("T_pwm") == 0.0
    assert not {*CARRIER, *AVERAGED} & set(free)


def on_grid(log, shift):
    """The duty cycles of `log`, taken over once in 10 ms, at `shift` samples of it."""
    at = np.maximum(10 * ((np.arange(len(log)) - shift) // 10) + shift, 0)
    return log.with_columns(**{name: log[name][at] for name in ("duty_supply", "duty_exhaust")})


def recorded_on_grid(plant, duties_of, shift):
    """6 s of a switched unit that takes new duty cycles over where a period begins; its valves open 2 ms later."""
    inputs = on_grid(duties_of(5).slice(0, 6000), shift)
    begun = {"T_pwm": 0.01, "s_pwm": centred(shift / 10), "s_vs": 0.2, "s_ve": 0.2, "t_vs": 0.01, "t_ve": 0.01}
    pressure = lagged(simulate(plant.replace(begun), inputs).log["pressure_a"], START_LAG, 1e-3)
    pressure = pressure + 2e3 * np.random.default_rng(3).standard_normal(pressure.size)
    return inputs.with_columns(pressure_a=pressure)


@pytest.mark.parametrize("shift", [0, 4])
def test_on_a_grid_the_search_begins_with_the_delay_of_the_valves_that_the_pressure_shows(plant, duties_of, shift):
    log = recorded_on_grid(plant, duties_of, shift)
    period, phase = duty_grid(log)
    assert period == pytest.approx(0.01)
    assert centred(phase - shift / 10) == pytest.approx(0.0, abs=1e-6)
    begin, free, _ = automatic([log], plant)
    assert begin.value("T_pwm") == pytest.approx(0.01)
    # the phase is tried in steps of a twentieth of a period; a lag to first order is not a shift by all of it
    assert (begin.value("s_vs"), begin.value("s_ve")) == (pytest.approx(0.2, abs=0.1), pytest.approx(0.2, abs=0.1))
    assert begin.value("s_vs") - begin.value("s_ve") == begin.value("R_0vs") - begin.value("R_0ve")
    assert (begin.value("a_0vs"), begin.value("a_0ve")) == (DECAY, DECAY)
    assert set(CARRIER) <= set(free)


def on_off(log, hold):
    """`log` with commands fully on or off that change every so many samples, or stay."""
    command = np.repeat(np.random.default_rng(2).integers(0, 3, len(log) // hold), hold)
    # the chamber vents at the start, as it was recorded
    command[:50] = 0
    return log.with_columns(duty_supply=1.0 * (command == 1), duty_exhaust=1.0 * (command == 2))


def test_an_on_off_unit_has_the_grid_of_its_commands_as_carrier(drive_log, plant):
    begin, free, _ = automatic([on_off(drive_log, 2)], plant)
    assert begin.value("T_pwm") == pytest.approx(2e-3)
    assert (begin.value("s_vs"), begin.value("s_ve")) == (ON_OFF_DELAY, ON_OFF_DELAY)
    assert (begin.value("a_0vs"), begin.value("a_0ve")) == (plant.value("a_0vs"), plant.value("a_0ve"))
    assert set(CARRIER) <= set(free)


def test_an_on_off_unit_whose_commands_change_at_any_time_has_no_carrier(drive_log, plant):
    begin, free, _ = automatic([on_off(drive_log, 1)], plant)
    assert begin.value("T_pwm") == 0.0
    assert not set(CARRIER) & set(free)


def test_a_recording_without_pressure_is_one_sentence_that_says_what_to_do(drive_log, plant):
    sentence = "log: no pressure_a; 'auto' needs a recording with pressure"
    with pytest.raises(DataError, match=sentence) as caught:
        automatic([drive_log.without("pressure_a")], plant)
    assert "clutchid estimate LOG --start CAL.toml" in str(caught.value)
    nothing = drive_log.with_columns(pressure_a=np.full(len(drive_log), np.nan))
    with pytest.raises(DataError, match=sentence):
        automatic([nothing], plant)


def test_a_recording_that_never_vents_is_one_sentence_with_its_lowest_pressure(drive_log, plant):
    pressurised = drive_log.with_columns(pressure_a=np.maximum(drive_log["pressure_a"], 2.5e5))
    with pytest.raises(DataError, match=r"^log: the chamber never vents, its lowest pressure is 2\.50 bar; ") as caught:
        automatic([pressurised], plant)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "equipment",
    [Equipment(chamber_b=False), *(Equipment(valves=valves) for valves in ("supply", "exhaust", "3/2"))],
    ids=lambda case: f"{case.valves}, chamber B: {case.chamber_b}",
)
def test_a_calibration_frees_and_sets_nothing_that_its_actuator_lacks(drive_log, equipment):
    actuator = Actuator(model=AUTOMATIC, equipment=equipment)
    begin, free, _ = automatic([drive_log], actuator)
    assert not [name for name in free if equipment.missing(name)]
    assert begin.equipment == equipment
    assert {"C_r", "C_vs", "C_ve"} & set(free), "what there is, is freed"


def test_an_absolute_pressure_that_was_read_as_gauge_is_a_unit_not_a_lack_of_a_vented_rest(drive_log, plant):
    gauge = replace(drive_log, metadata={"pressure_a_unit": "bar(g)", "ambient_Pa": "101300.0"})
    with pytest.raises(
        DataError, match=r"^log: pressure_a, read as gauge pressure with 1\.013 bar .* write bar in place"
    ):
        automatic([gauge.with_columns(pressure_a=drive_log["pressure_a"] + 1.013e5)], plant)


def test_all_recordings_with_a_problem_are_named(drive_log, plant):
    pressurised = replace(drive_log.with_columns(pressure_a=np.full(len(drive_log), 3e5)), name="pressurised")
    with pytest.raises(DataError) as caught:
        automatic([pressurised, drive_log, replace(drive_log.without("pressure_a"), name="bare")], plant)
    lines = str(caught.value).splitlines()
    assert [line.partition(":")[0] for line in lines] == ["pressurised", "bare"]
