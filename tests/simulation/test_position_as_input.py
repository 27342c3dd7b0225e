"""The measured position as an input: only the air is simulated."""

from __future__ import annotations

import numpy as np

from clutchid import FitRequest, fit
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters
from clutchid.simulation import Partition, simulate
from clutchid.simulation.stiffness import TOP_SPEED, stiffness
from clutchid.strokes.stroke import QUICKEST

INPUT = Partition(every=1, carry="q", take="position")


def within_a_sample(actuator: Actuator) -> float:
    """Part of the pressure that wrong forces cost within a sample: 1 ms at 0.3 m/s of the shortest column of air."""
    return 1e-3 * 0.3 / (actuator.value("V_0A") / actuator.value("A_A"))


def test_the_pressure_follows_the_position_and_not_the_forces(truth, drive):
    # another load and friction would move the piston elsewhere; its position is given, so the air does not notice
    heavy = Actuator(truth.parameters.replace({"F_C": 400.0, "D_v": 9000.0}), Load((1.2e6, 0.0, 0.0)))
    air = simulate(heavy, drive, partition=INPUT).log["pressure_a"]
    wrong = within_a_sample(truth)
    assert np.abs(air / drive["pressure_a"] - 1).max() < wrong
    assert np.abs(simulate(heavy, drive).log["pressure_a"] / drive["pressure_a"] - 1).max() > 10 * wrong


def test_a_sealed_chamber_keeps_its_air_along_any_position(truth):
    lost = []
    for dt in (1e-3, 1e-4):
        t = np.arange(round(0.5 / dt)) * dt
        closed = {"duty_supply": np.zeros(t.size), "duty_exhaust": np.zeros(t.size)}
        moved = Log(t, {**closed, "position": 5e-3 * (1 - np.cos(20 * t))})
        simulated = simulate(truth, moved, partition=INPUT).log
        air = simulated["pressure_a"] * (truth.value("V_0A") + truth.value("A_A") * simulated["position"])
        lost.append(float(np.ptp(air) / air[0]))
    # what is lost is the integration's: of first order at least, where friction has a kink, so 10 times less
    assert lost[1] < 0.1 * lost[0]
    # a reset that carried the pressure would lose as much as the column of air is moved in one sample
    assert lost[0] < 1e-3 * within_a_sample(truth)


def test_a_fit_finds_the_conductance_without_knowing_the_load(truth, drive):
    start = Actuator(truth.parameters.replace({"C_vs": 15e-9}), Load((6e5, 0.0, 0.0)))
    result = fit(drive, start, measure=("pressure_a",), free=("C_vs",), request=FitRequest(partition=INPUT))
    # a flow follows its pressure
    assert abs(result.parameters["C_vs"].value / truth.value("C_vs") - 1) < within_a_sample(truth)


def test_the_steps_follow_a_piston_that_makes_a_long_stroke_in_a_tenth_of_a_second():
    soft = {"K_z": 1e6, "F_C": 200.0}
    short, long = (Actuator(Parameters(y_max=y_max, **soft)) for y_max in (0.025, 0.125))
    # at speed the seal forgets its deflection with K_z |v| / F_C, here 5 times as fast
    assert stiffness(long) > 0.9 * soft["K_z"] * 0.125 / QUICKEST / soft["F_C"]
    assert stiffness(short) == stiffness(short, max(TOP_SPEED, 0.025 / QUICKEST))
