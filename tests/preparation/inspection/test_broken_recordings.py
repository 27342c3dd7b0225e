"""Each fault, put into a sound recording on purpose, is found, and its sentence says what to do."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.measurements.source import VENTED_KEY
from clutchid.model import Actuator, Load
from clutchid.preparation.inspection import inspect
from clutchid.truck import respond, truck
from fixtures.cases import case_tables
from fixtures.changed_logs import spoiled, thinned

CASES = case_tables(__file__, "test_broken_recordings")

TRUCKS = (1, 5, 16)


@pytest.mark.parametrize("number", TRUCKS)
@pytest.mark.parametrize("ms", [-50, -20, 20, 50])
def test_a_shift_of_20_ms_and_more_is_bad(recorded, shifted, check_of, number, ms):
    before, after = (check_of(log, "time shift") for log in (recorded(number), shifted(recorded(number), ms)))
    assert (before.grade, after.grade) == ("good", "bad")
    assert float(after.value.split()[0]) - float(before.value.split()[0]) == pytest.approx(ms, abs=1.0)
    assert f"{-ms:+d}." in after.sentence.replace(f"{-float(after.value.split()[0]):+.1f}", f"{-ms:+d}.")


@pytest.mark.parametrize("number", TRUCKS)
def test_a_shift_of_5_ms_is_found_beside_the_delay_of_valve_and_sensor(recorded, shifted, check_of, number):
    assert check_of(shifted(recorded(number), 5), "time shift").grade in ("suspect", "bad")


def test_a_shift_is_found_at_100_hz_and_undetermined_at_20_hz(recorded, shifted, check_of):
    log = recorded(5)
    assert check_of(thinned(log, 10), "time shift").grade == "good"
    assert check_of(thinned(shifted(log, 50), 10), "time shift").grade == "bad"
    assert check_of(thinned(shifted(log, 50), 50), "time shift").grade == "undetermined"


def test_a_lag_that_the_actuator_knows_is_no_shift(recorded, shifted, check_of):
    late = shifted(recorded(5), 12)
    assert check_of(late, "time shift").grade == "bad"
    assert check_of(late, "time shift", Actuator().replace({"tau_y": 0.013})).grade == "good"


def test_motion_that_never_follows_a_command_is_bad(recorded, check_of):
    log = recorded(5, "strokes")
    still = np.random.default_rng(0).normal(0, 3e-5, len(log))
    seen = check_of(log.with_columns(position=still), "time shift")
    assert seen.grade == "bad"
    assert "no motion" in seen.value


@pytest.mark.parametrize("number", TRUCKS)
def test_a_sign_that_is_wrong_is_bad_and_the_supply_pressure_is_then_undetermined(recorded, check_of, number):
    log = recorded(number)
    for wrong in (
        log.with_columns(position=-log["position"]),
        log.with_columns(position=0.025 - log["position"]),
        log.with_columns(duty_supply=log["duty_exhaust"], duty_exhaust=log["duty_supply"]),
    ):
        assert check_of(wrong, "sign of position").grade == "bad"
        assert check_of(wrong, "supply pressure").grade == "undetermined"
    turned = check_of(log.with_columns(position=0.025 - log["position"]), "sign of position")
    assert "in a channel map sign = -1, and an offset by which the end at 25 mm becomes 0" in turned.sentence


def test_a_position_of_another_time_axis_has_no_sign(recorded, check_of):
    log = recorded(5)
    assert check_of(log.with_columns(position=log["position"][::-1]), "sign of position").grade == "suspect"


@pytest.mark.parametrize(("scale", "zero", "sentence"), CASES["pressures"])
def test_another_unit_and_another_zero_of_the_pressure_are_named(recorded, check_of, scale, zero, sentence):
    log = recorded(5)
    zero = np.quantile(log["pressure_a"], 0.05) if zero == "vented" else zero
    seen = check_of(log.with_columns(pressure_a=(log["pressure_a"] - zero) * scale), "unit of pressure_a")
    assert seen.grade == "bad"
    assert sentence in seen.sentence


@pytest.mark.parametrize(("written", "declared"), [("bar", "bar(g)"), ("kPa", "kPa(g)"), ("Pa", "Pa(g)")])
def test_an_absolute_pressure_under_a_gauge_unit_is_named(recorded, check_of, written, declared):
    log, ambient = recorded(5), 1.013e5
    base = replace(log, metadata={"pressure_a_unit": declared, "ambient_Pa": repr(ambient)})
    seen = check_of(base.with_columns(pressure_a=log["pressure_a"] + ambient), "unit of pressure_a")
    assert seen.grade == "suspect"
    assert "read as gauge pressure with 1.013 bar of ambient added, never comes near ambient" in seen.sentence
    assert f"write {written} in place of {declared} in the column heading" in seen.sentence
    assert check_of(base, "unit of pressure_a").grade == "good"


#: Channel, factor of a wrong unit, the check that names it, and what its sentence says.
FACTORS = CASES["factors"]


@pytest.mark.parametrize(("name", "factor", "check", "sentence"), FACTORS)
def test_a_unit_that_is_wrong_by_a_factor_is_named(recorded, check_of, name, factor, check, sentence):
    log = recorded(5)
    log = log.with_columns(pressure_supply=np.full(len(log), 9.3e5))
    wrong = replace(log, time=log.time * factor) if name == "time" else log.with_columns(**{name: log[name] * factor})
    seen = check_of(wrong, check)
    assert seen.grade == ("suspect" if name == "pressure_supply" else "bad"), "without the supply a fit is possible"
    assert sentence in seen.sentence


def test_gauge_kilopascals_under_pascals_do_not_pass_for_a_pressure(recorded, check_of):
    log = recorded(5)
    small = replace(log, metadata={"pressure_a_unit": "Pa(g)", "ambient_Pa": "109500.0"})
    seen = check_of(small.with_columns(pressure_a=1.095e5 + (log["pressure_a"] - 1.095e5) * 1e-3), "unit of pressure_a")
    assert seen.grade == "bad"
    assert "too little to move the piston as the position says" in seen.sentence
    assert "looks like kPa(g)" in seen.sentence


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("number", TRUCKS)
def test_a_position_that_is_cut_off_is_bad_at_either_end(recorded, check_of, number, every):
    log = thinned(recorded(number), every)
    y = log["position"]
    for cut in (np.minimum(y, 0.8 * y.max()), np.maximum(y, 0.05 * y.max())):
        seen = check_of(log.with_columns(position=cut), "saturation of position")
        assert seen.grade == "bad"
        assert "without noise for" in seen.sentence


def test_a_pressure_that_is_cut_off_is_bad(recorded, check_of):
    log = recorded(5)
    cut = np.minimum(log["pressure_a"], 4e5)
    seen = check_of(log.with_columns(pressure_a=cut), "saturation of pressure_a")
    assert (seen.grade, seen.value.endswith("at 4 bar")) == ("bad", True)
    inside = (log.time >= seen.begin) & (log.time <= seen.end)
    assert inside.sum() > 100
    assert (cut[inside] == 4e5).all()


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("name", ["position", "pressure_a"])
def test_a_column_that_stands_still_while_the_valves_work_is_bad(recorded, frozen, check_of, name, every):
    for number in TRUCKS:
        seen = check_of(frozen(thinned(recorded(number), every), name), f"stuck {name}")
        assert seen.grade == "bad"
        # noise ends the stretch a few samples early at most
        assert float(seen.value.split()[0]) == pytest.approx(2.0, abs=0.05)
        assert seen.end - seen.begin == pytest.approx(2.0, abs=0.05)


def test_a_column_that_stands_still_at_rest_is_suspect(recorded, check_of):
    log = recorded(5)
    passed = np.cumsum((log["duty_supply"] > 0) | (log["duty_exhaust"] > 0))
    start = next(i for i in range(1000, len(log)) if passed[i + 150] == passed[i] and log["position"][i] > 1e-3)
    still = spoiled(log, "position", slice(start, start + 150), log["position"][start])
    assert check_of(still, "stuck position").grade == "suspect"


def test_a_position_without_noise_is_stuck_where_an_open_valve_does_not_move_it():
    time = np.arange(0, 4, 1e-3)
    supply, exhaust = 1.0 * (time % 1 < 0.2), 1.0 * (time % 1 >= 0.5)
    log = Log(time, {"position": np.zeros(time.size), "duty_supply": supply, "duty_exhaust": exhaust})
    (stuck,) = (check for check in inspect(log).checks if check.name == "stuck position")
    assert stuck.grade == "bad"
    assert "leave these samples empty" in stuck.sentence


def coarse(log, step):
    """`log` with a position in steps of so many metres."""
    return log.with_columns(position=step * np.round(log["position"] / step))


def test_steps_count_where_the_noise_does_not_smear_them(recorded, check_of):
    log, check = recorded(5), "quantisation of position"
    verdicts = [check_of(coarse(log, step), check).grade for step in (10e-6, 100e-6, 200e-6, 600e-6)]
    assert verdicts == ["good", "suspect", "suspect", "bad"]
    # with narrower pieces of the load curve the same step is too coarse
    assert check_of(coarse(log, 2e-4), check, Actuator(load=Load.on_b_splines())).grade == "bad"


def test_steps_that_hide_the_noise_leave_saturation_undetermined(recorded, check_of):
    assert check_of(coarse(recorded(5), 2e-4), "saturation of position").grade == "undetermined"


@pytest.mark.parametrize(("every", "verdict"), [(1, "good"), (2, "suspect"), (20, "suspect"), (21, "bad")])
def test_the_rate_must_let_the_edges_of_the_valves_and_then_the_stroke_be_seen(recorded, check_of, every, verdict):
    # 0.3 m/s passes a quarter of the stroke, 6.25 mm, in 20.8 ms
    check = check_of(thinned(recorded(5), every), "sample rate")
    assert check.grade == verdict
    assert ("'with care' at best; record at 1000 Hz or more" in check.sentence) == (verdict == "suspect")


@pytest.mark.parametrize(("every", "stated"), [(6, False), (7, True)])
def test_a_piece_of_the_load_curve_that_is_passed_between_two_samples_is_stated(recorded, check_of, every, stated):
    # 0.3 m/s passes the narrowest piece, 2 mm, in 6.7 ms
    assert ("narrowest knot interval" in check_of(thinned(recorded(5), every), "sample rate").sentence) == stated


def test_the_rate_is_compared_with_the_stiffness_of_the_actuator(recorded, check_of):
    stiff = Actuator().replace({"M": 1e-4})
    assert "integration step" in check_of(recorded(5), "sample rate").sentence
    assert check_of(recorded(5), "sample rate", stiff).grade == "bad"


@pytest.fixture(scope="module")
def filled():
    """A truck whose supply valve stays open for 0.9 s, three times, with its pressure."""
    time = np.arange(6000)
    supply = 1.0 * ((time % 1900 > 300) & (time % 1900 < 1200))
    return respond(truck(4), supply, 1.0 * (time % 1900 > 1250)).log


def test_a_plateau_shows_the_supply_pressure(filled, check_of):
    supply = truck(4).P_S
    seen = check_of(filled, "supply pressure")
    # the governor keeps the reservoir within its saw-tooth of 0.35 bar about the set pressure, and a fill takes 0.2 bar
    assert float(seen.value.split()[0]) * 1e5 == pytest.approx(supply, abs=0.5e5)
    assert seen.grade == "suspect"
    assert "free it" in seen.sentence
    supplied = Actuator().replace({"P_S": float(seen.value.split()[0]) * 1e5})
    assert check_of(filled, "supply pressure", supplied).grade == "good"


def test_a_zero_of_the_pressure_sensor_is_said_once_and_is_no_supply_pressure(check_of):
    """0.25 bar are more than the 2 % of the supply pressure that its check allows."""
    time = np.arange(6000) % 3000
    vented = respond(truck(4), 1.0 * ((time > 300) & (time < 1200)), 1.0 * (time > 1250)).log
    sound, zero = replace(vented, metadata={VENTED_KEY: repr(truck(4).P_0)}), 2.5e4
    off = sound.with_columns(pressure_a=sound["pressure_a"] + zero)
    assert check_of(sound, "vented pressure").grade == "good"
    seen = check_of(off, "vented pressure")
    assert seen.grade == "suspect"
    assert ": the zero of the sensor is off by +0.25" in seen.sentence
    supplied = Actuator().replace({"P_S": truck(4).P_S})
    bar = [float(check_of(log, "supply pressure", supplied).value.split()[0]) for log in (sound, off)]
    assert bar[1] == pytest.approx(bar[0], abs=0.03)


def test_low_air_of_an_absolute_sensor_is_altitude_or_its_zero(recorded, check_of):
    log, words = recorded(5), "because of altitude or a zero error; give --ambient to tell which"
    by_pressure = {
        bar: check_of(log.with_columns(pressure_a=log["pressure_a"] + 1e5 * bar - truck(5).P_0), "vented pressure")
        for bar in (1.02, 0.93, 0.8)
    }
    assert [check.grade for check in by_pressure.values()] == ["good", "good", "suspect"]
    assert [words in check.sentence for check in by_pressure.values()] == [False, True, False]
    assert "altitude, as a calibration assumes, or the zero of the sensor is off by -0.2" in by_pressure[0.8].sentence


def test_more_pressure_than_the_supply_has_is_bad(recorded, check_of):
    log = recorded(5)
    weak = Actuator().replace({"P_S": 4e5})
    seen = check_of(log, "supply pressure", weak)
    assert seen.grade == "bad"
    assert seen.value.startswith("at least 5.")


def test_without_pressure_no_supply_pressure_is_invented(recorded, check_of):
    log = recorded(5)
    seen = check_of(log.without("pressure_a"), "supply pressure")
    assert seen.grade == "undetermined"
    assert seen.sentence.startswith("without the chamber pressure ")
    undriven = check_of(log.without("duty_exhaust"), "supply pressure")
    assert undriven.sentence.startswith("without both duty cycles the supply pressure cannot be checked")


def test_a_position_outside_the_stroke_is_reported_in_the_words_of_the_simulation(recorded, check_of):
    log = recorded(5)
    seen = check_of(log.with_columns(position=log["position"] * 1e3), "range of position")
    assert (seen.grade, "outside the stroke" in seen.sentence) == ("bad", True)
    assert check_of(log.with_columns(position=log["position"] + 5e-3), "range of position").grade == "suspect"
