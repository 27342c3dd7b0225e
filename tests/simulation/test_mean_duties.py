"""Duty cycles whose edges lie between the samples: what averaged valves take."""

import numpy as np
import pytest

import clutchid
from clutchid.log import INPUTS, Log
from clutchid.simulation.inputs import held_inputs, mean_duties

FINE, EVERY, DELTA, SECONDS = 1e-4, 10, 4e-4, 3.0
OPENING = {"duty_supply": (0.1, 0.9), "duty_exhaust": (0.1, 0.9)}


@pytest.fixture(scope="module")
def actuator():
    return clutchid.Actuator(model="energy-balance-stribeck", load=clutchid.Load.on_b_splines(clutchid.Load()))


@pytest.fixture(scope="module")
def fine():
    """A recording at 10 kHz whose duty cycles change 0.4 ms after every tenth millisecond."""
    inputs = clutchid.bundled_recording()
    time = FINE * np.arange(round(SECONDS / FINE))
    period = np.maximum(np.floor((time - DELTA) / 0.01 + 1e-6).astype(int), 0)
    return Log(time, {**{name: inputs[name][10 * period] for name in INPUTS}, "position": 0.0 * time}, "fine")


def with_edges(fine):
    """Every tenth sample, and where the duty cycles changed in between."""
    every = {name: fine[name][::EVERY] for name in (*INPUTS, "position")}
    changes = {name: np.flatnonzero(np.diff(fine[name], prepend=np.nan)) for name in INPUTS}
    edges = {name: (fine.time[at], fine[name][at]) for name, at in changes.items()}
    return Log(fine.time[::EVERY], every, "edges", edges=edges)


def test_averaged_valves_simulate_as_with_the_edges_on_a_finer_grid(actuator, fine):
    truth = clutchid.simulate(actuator, fine).log["position"][::EVERY]
    log = with_edges(fine)
    held = Log(log.time, log.columns, "held")

    def error(recording):
        return float(np.sqrt(np.mean((clutchid.simulate(actuator, recording).log["position"] - truth) ** 2)))

    assert error(log) < 0.02 * error(held)


def test_the_mean_is_that_of_the_opening(actuator):
    duty = np.array([0.2, 0.2, 0.6, 0.6])
    edges = {"duty_supply": (np.array([0.0, 1.25]), np.array([0.2, 0.6]))}
    log = Log(np.arange(4.0), {"duty_supply": duty, "duty_exhaust": 0.0 * duty, "position": 0.0 * duty}, edges=edges)
    assert mean_duties(log, OPENING)[0] == pytest.approx([0.2, 0.25 * 0.2 + 0.75 * 0.6, 0.6, 0.6])
    # shut, and wide open, however far beyond
    narrow = {**OPENING, "duty_supply": (0.4, 0.5)}
    assert mean_duties(log, narrow)[0] == pytest.approx([0.2, 0.25 * 0.4 + 0.75 * 0.5, 0.6, 0.6])
    assert mean_duties(log, OPENING)[1] is log["duty_exhaust"]


def test_a_stretch_of_a_recording_has_the_means_of_the_whole(actuator, fine):
    log = with_edges(fine)
    whole = held_inputs(log, actuator, 0, len(log))
    # the interval behind the last sample is not part of a stretch
    assert np.array_equal(held_inputs(log, actuator, 700, 900)[:-1], whole[700:899])
