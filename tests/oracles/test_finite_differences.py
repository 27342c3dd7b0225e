"""The sensitivities that a simulation carries against central finite differences of the simulation itself."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.simulation import Partition, simulate
from clutchid.simulation.simulation import STATE_COLUMNS

STEPS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


def stack(log: Log) -> np.ndarray:
    return np.column_stack([log[name] for name in STATE_COLUMNS])


def mistaken(actuator: Actuator, log: Log, starts=None, partition: Partition | None = None) -> dict[str, float]:
    """For every name the largest error of a sensitivity at the best step, in units of what is allowed.

    Both carry the same integration steps, so the derivative of the numbers themselves is exact. Allowed is what a
    central difference cannot do better: the rounding of 3000 steps (1e-13 of the largest state) over the step, and
    1e-5 of the largest sensitivity for stages that lie on the other side of a kink (knot, |v|, r_lam, stop) in one of
    the two runs.
    """
    whole = simulate(actuator, log, partition=partition, starts=starts, sensitivities=actuator.names)
    rounding = 1e-13 * np.abs(stack(whole.log)).max(axis=0)
    worst = {}
    for name in actuator.names:
        value, exact = actuator.value(name), whole.sensitivities[name]
        errors = []
        for step in STEPS:
            h = step * abs(value)
            up, down = (
                stack(simulate(actuator.replace({name: value + d}), log, partition=partition, starts=starts).log)
                for d in (h, -h)
            )
            allowed = 1e-5 * np.abs(exact).max(axis=0) + rounding / h
            errors.append(float((np.abs((up - down) / (2 * h) - exact).max(axis=0) / allowed).max()))
        worst[name] = min(errors)
    return worst


@pytest.fixture(scope="module")
def rough(driven) -> Log:
    """3 s that reach the end stop, and a position that differs from the simulated one by a slow millimetre."""
    log = driven(seconds=3.0)
    t = log.time
    supply = np.where((t > 1.0) & (t < 1.3), 1.0, log["duty_supply"])
    exhaust = np.where((t > 1.0) & (t < 1.3), 0.0, log["duty_exhaust"])
    return log.with_columns(duty_supply=supply, duty_exhaust=exhaust)


@pytest.fixture(scope="module")
def off(driven) -> Log:
    """3 s whose position differs from the simulated one by a slow millimetre, so that every reset moves something."""
    log = driven(seconds=3.0)
    wrong = 1e-3 * (np.cos(2 * np.pi * log.time / 0.7) - 1) * (log.time > 0.1)
    return log.with_columns(position=np.maximum(log["position"] + wrong, 0.0))


def test_ballistic_sensitivities_to_every_parameter_are_exact_even_through_the_end_stop(truth, rough):
    assert simulate(truth, rough).log["position"].max() > 25.1e-3
    worst = mistaken(truth, rough)
    assert len(worst) == 34
    assert {name: error for name, error in worst.items() if error > 1} == {}


@pytest.mark.parametrize("partition", [Partition(every=50), Partition(parts=7)], ids=["every", "parts"])
def test_partitioned_sensitivities_that_carry_the_pressures_are_exact(truth, off, partition):
    worst = mistaken(truth, off, partition=partition)
    assert {name: error for name, error in worst.items() if error > 1} == {}


@pytest.mark.parametrize("partition", [Partition(every=50, carry="q"), Partition(parts=7, carry="q")])
def test_partitioned_sensitivities_that_carry_the_masses_of_air_are_exact(truth, off, partition):
    worst = mistaken(truth, off, partition=partition)
    assert {name: error for name, error in worst.items() if error > 1} == {}


def test_sensitivities_of_a_start_under_a_known_pressure_are_exact(truth, driven):
    log = driven(seconds=3.0).slice(1000, 3000)
    worst = mistaken(truth, log, starts=[(14.2e-3, 4.6e5)])
    assert {name: error for name, error in worst.items() if error > 1} == {}


def test_sensitivities_of_a_start_under_pressure_include_the_load_that_the_start_rests_on(truth, driven):
    log = driven(seconds=3.0).slice(1000, 3000)
    worst = mistaken(truth, log)
    assert {name: error for name, error in worst.items() if error > 1} == {}
