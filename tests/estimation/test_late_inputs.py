"""Duty cycles with time stamps of their own, between those of the position."""

from dataclasses import replace

import numpy as np
import pytest

import clutchid
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.log import INPUTS, Log
from clutchid.preparation.pulses import pulsed
from clutchid.simulation.sensors import lagged

EXACT = Calibration((), np.zeros((0, 0)))
PERIOD, FINE, SECONDS = 0.01, 1e-4, 5.0

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def calibrated():
    """A calibrated actuator by its valves: switched by a carrier, or averaged."""
    load = clutchid.Load.on_b_splines(clutchid.Load())
    averaged = clutchid.Actuator(model="energy-balance-stribeck", load=load, duty_period=PERIOD).replace(tau_y=1e-3)
    return {"switched": averaged.replace(T_pwm=PERIOD, s_vs=0.07, s_ve=0.07, t_vs=0.1, t_ve=0.1), "averaged": averaged}


def late(actuator, delta, edges=True):
    """A recording of a worn clutch whose periods start `delta` s after a sample, simulated on a grid of 0.1 ms."""
    inputs = clutchid.bundled_recording().slice(0, round(SECONDS * 1e3))
    time = FINE * np.arange(round(SECONDS / FINE))
    period = np.maximum(np.floor((time - delta) / PERIOD + 1e-6).astype(int), 0)
    duty = {name: inputs[name][10 * period] for name in INPUTS}
    worn = actuator.replace({name: 1.1 * actuator.value(name) for name in actuator.load.names})
    # by the clock of the periods: the carrier starts with them
    driven = Log(time - delta + PERIOD, {**duty, "position": 0.0 * time})
    motion = clutchid.simulate(worn, driven).log["position"]
    position = lagged(motion, actuator.value("tau_y"), FINE)[::10]
    position = position + 3e-5 * np.random.default_rng(1).standard_normal(position.size)
    stamps = PERIOD * np.arange(period.max() + 1) + delta
    own = {name: (stamps, inputs[name][:: round(PERIOD * 1e3)][: stamps.size]) for name in INPUTS}
    sampled = {name: values[::10] for name, values in duty.items()}
    return Log(time[::10], {"position": position, **sampled}, "late", edges=own if edges else {})


@pytest.mark.parametrize("valves", ["switched", "averaged"])
def test_late_edges_do_not_move_the_load(calibrated, valves):
    actuator, y = calibrated[valves], np.linspace(0.5e-3, 15e-3, 40)
    peak = 1.1 * actuator.load.force(y).max()

    def load(delta, edges=True):
        fit = clutchid.fit(
            late(actuator, delta, edges), actuator, free=("load",), request=clutchid.FitRequest(calibration=EXACT)
        )
        return fit.actuator.load.force(y)

    def apart(reading, reference):
        return float(np.sqrt(np.mean((reading - reference) ** 2))) / peak

    prompt = load(0.0)
    assert apart(load(3e-4), prompt) < 0.005
    assert apart(load(3e-4, edges=False), prompt) > 0.01  # held until the next sample: the reason for the edges


def test_the_phase_of_a_carrier_is_that_of_the_edges(calibrated):
    log = late(calibrated["switched"], 3e-4)
    assert pulsed(log, calibrated["switched"], False).actuator.value("s_pwm") == pytest.approx(0.03)
    assert pulsed(replace(log, edges={}), calibrated["switched"], False).actuator.value("s_pwm") == pytest.approx(0.1)
