"""A truck at rest, and the numbers with which the loop runs: each valve and each sensor has its own."""

from itertools import pairwise

import numpy as np
import pytest

from clutchid.truck import Truck, aged, drive, load_curve, respond
from clutchid.truck.assembly import at_rest
from clutchid.truck.law import lag_output
from clutchid.truck.load_table import rest_position
from clutchid.truck.settings import SAMPLE, TICK

STATES = Truck.parts.structure.states


def test_at_rest_both_chambers_hold_ambient_air_of_the_walls_and_the_reservoir_air_of_the_ambience():
    t = aged(Truck(i_w=0.5, T_0=280.0, dT_w=25.0), wear=2e-3)
    x = dict(zip(STATES, at_rest(t, load_curve(t), 8.6e5), strict=True))
    volume = {"A": t.V_0A + t.A_A * x["y"], "B": t.V_0B + t.A_B * (t.y_max - x["y"]), "S": t.V_S}
    air = {"A": (t.P_0, 305.0), "B": (t.P_0, 305.0), "S": (8.6e5, 280.0)}
    for name, (p, kelvin) in air.items():
        assert (t.gamma - 1) * x[f"U_{name}"] / volume[name] == pytest.approx(p, rel=1e-12)
        assert p * volume[name] / (t.R * x[f"m_{name}"]) == pytest.approx(kelvin, rel=1e-12)
    assert x["p_G"] == 8.6e5
    assert [x[name] for name in ("v", "z", "z_h", "x_s", "x_e")] == [0.0] * 5
    assert dict(zip(STATES, at_rest(t, load_curve(t)), strict=True))["p_G"] == t.P_S


def test_the_rest_is_where_the_stop_holds_the_return_spring():
    t = aged(Truck(i_w=0.5), wear=2e-3)
    y = rest_position(t, load_curve(t))
    depth = -1e-3 - y
    assert t.K_stop * depth**1.5 == pytest.approx(t.F_r + t.k_r * y, rel=1e-9)


def ramps(times: tuple[float, float, float, float], duty: float, n: int) -> np.ndarray:
    """Lift at every millisecond of a valve that is switched on at 0, from its four times; it is open in between."""
    t_1, t_2, t_3, t_4 = times
    t, off = np.arange(n) * SAMPLE, duty * 0.01
    return np.interp(t, [t_1 + TICK, t_1 + t_2 + TICK, off + t_3 + TICK, off + t_3 + t_4 + TICK], [0.0, 1.0, 1.0, 0.0])


def test_each_valve_has_its_own_four_times():
    supply, exhaust = (0.7e-3, 1.1e-3, 0.8e-3, 1.3e-3), (1.2e-3, 0.6e-3, 1.5e-3, 2.1e-3)
    named = {f"t_{k + 1}{valve}": times[k] for valve, times in (("s", supply), ("e", exhaust)) for k in range(4)}
    on, off = np.full(10, 0.5), np.zeros(10)
    truck = Truck(T_pwm=0.01, **named)
    opened = respond(truck, on, off).truth.states
    vented = respond(truck, off, on).truth.states
    # a ramp begins with the tick after the one that ends the dead time, or with that one: one tick of the rise
    tolerance = TICK / min(supply[1], exhaust[1]) * 1.01
    assert opened["lift_supply"] == pytest.approx(ramps(supply, 0.5, 10), abs=tolerance)
    assert vented["lift_exhaust"] == pytest.approx(ramps(exhaust, 0.5, 10), abs=tolerance)
    assert not opened["lift_exhaust"].any()
    assert not vented["lift_supply"].any()


def test_each_sensor_has_its_own_lag():
    supply = np.zeros(200)
    supply[:60] = 1.0
    response = respond(Truck(tau_y=1e-3, tau_p=6e-3), supply, np.zeros(200))
    for name, true, tau in (
        ("position", response.truth.states["position"], 1e-3),
        ("pressure_a", response.truth.states["pressure_a"], 6e-3),
    ):
        out = [true[0]]
        for before, now in pairwise(true):
            out.append(lag_output(out[-1], before, now, tau, SAMPLE))
        # the sensor is fed tick by tick, the twin with straight lines over a millisecond
        rate = np.abs(np.diff(true)).max() / SAMPLE
        assert np.abs(response.log[name] - out).max() < 2 * TICK * rate
        assert np.abs(response.log[name] - true).max() > 5 * TICK * rate


def test_the_controller_gives_each_valve_its_own_dead_zone():
    driven = drive(Truck(T_pwm=0.01, t_1s=1e-3, t_1e=4e-3), manoeuvre="creep", seconds=6.0)
    for name, dead in (("duty_supply", 0.1), ("duty_exhaust", 0.4)):
        duty = driven.log[name]
        # a timer of 100 steps
        assert dead - 0.006 <= duty[duty > 0].min() < dead + 0.1


def test_a_morning_begins_anywhere_on_the_saw_tooth_and_mostly_on_its_longer_side():
    t = Truck(r_up=0.9e5, r_down=0.1e5, dP_G=0.2e5)
    starts = [drive(t, seconds=0.5, seed=seed).truth.states["pressure_governor"] for seed in range(16)]
    first = np.array([p[0] - t.P_S for p in starts]) / t.dP_G
    assert np.abs(first).max() <= 0.95
    # 16 draws over 1.9: none below -0.3, or none above 0.3, once in 400 times
    assert first.min() < -0.3
    assert first.max() > 0.3
    # it rises a tenth of the time: of 16 six and more once in 300 times
    assert sum(p[1] > p[0] for p in starts) < 6


@pytest.mark.parametrize("wear", [0.0, 2e-3])
def test_the_transmission_goes_up_to_two_millimetres_before_the_far_stop(wear):
    driven = drive(Truck(i_w=0.5), manoeuvre="strokes", seconds=2.0, wear=wear)
    # the rest of a worn clutch lies nearer to the cylinder
    assert driven.wanted.max() == pytest.approx(25e-3 + 0.5 * wear - 2e-3, rel=1e-12)


def test_the_truth_says_where_the_clutch_takes_hold_in_the_zero_of_the_sensor():
    truth = drive(Truck(i_w=0.5, e_y=3e-5), seconds=0.5, wear=2e-3).truth
    at = np.array([truth.touch])
    assert truth.load(at) == pytest.approx(truth.curve.force(np.array([truth.curve.touch])), rel=1e-12)
