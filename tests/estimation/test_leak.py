"""A leak of chamber A that began after the calibration: found from position alone, and not taken for another load."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.estimation import shooting as module
from clutchid.estimation.assess.reasons import departs
from clutchid.estimation.calibrate import fit_with
from clutchid.estimation.request import FitRequest, FreeParameters
from clutchid.estimation.shooting import SHOOTING, shoot
from clutchid.inference.smoother.search import USUAL_EFFORT
from clutchid.inference.uncertainty.change_prior import changeable
from clutchid.model import Actuator, Load
from clutchid.wear.history import leak_of

LEAK = 4e-11
Y = np.linspace(0.5e-3, 20e-3, 40)


@pytest.fixture(scope="module")
def leaking_log(worn, recorded_by):
    leaking = worn.replace({"C_A0": LEAK})
    return recorded_by(leaking, seconds=6.0, seed=5, name="worn", driven=1).without("pressure_a")


def read(log, calibrated):
    request = FitRequest(("position",), ("load",), calibration=calibrated.calibration)
    return fit_with(SHOOTING, [log], calibrated.actuator, request)


@pytest.fixture(scope="module")
def reading(leaking_log, calibrated):
    return read(leaking_log, calibrated)


def test_a_leak_is_found_with_its_size(reading):
    leak = leak_of(reading)
    assert leak.probability > 0.999
    assert leak.conductance == pytest.approx(LEAK, abs=3 * leak.std)
    assert leak.std < 0.2 * LEAK
    assert not departs(reading)


def test_the_load_of_an_actuator_that_leaks_is_read_as_without_the_leak(reading, adapted, worn):
    true = worn.load.force(Y)
    error, without = ((fit.actuator.load.force(Y) - true) / true.max() for fit in (reading, adapted))
    assert np.sqrt(np.mean(error**2)) < np.sqrt(np.mean(without**2)) + 0.01


def test_without_a_leak_none_is_found(adapted):
    assert leak_of(adapted) is None


def test_only_a_model_with_the_energy_balance_has_a_leak(calibrated):
    assert "C_A0" in changeable(calibrated.actuator)
    assert "C_A0" not in changeable(Actuator(model="isothermal"))


def test_a_search_that_gets_nowhere_ends_after_its_patience(leaking_log, calibrated, monkeypatch):
    # as if nothing could ever explain the recording: every cost is hopeless
    monkeypatch.setattr(module, "HOPELESS", 0.0)
    monkeypatch.setattr(module, "_PATIENCE", 5)
    free = FreeParameters(calibrated.actuator.load.names, ("position",))
    search = shoot([leaking_log], calibrated.actuator, free, calibrated.calibration)
    assert search.solution.status == "limit"
    again = SHOOTING.changes.refine(search, search.problem, search.solution.x)
    assert again.solution.status == "converged", "with a change the search goes on"
    assert again.solution.at.cost < search.solution.at.cost


@pytest.mark.slow
def test_only_the_search_of_a_load_from_position_alone_ends_early(calibrated, worn, recorded_by, leaking_log):
    names, with_pressure = calibrated.actuator.load.names, recorded_by(worn, seconds=3.0, seed=5, name="worn", driven=1)
    both = FreeParameters(names, ("position", "pressure_a"))
    search = shoot([with_pressure], calibrated.actuator, both, calibrated.calibration)
    assert search.effort == USUAL_EFFORT
    alone = shoot([leaking_log], calibrated.actuator, FreeParameters(names, ("position",)), calibrated.calibration)
    assert alone.effort.most == module.MOST_EVALUATIONS


def test_another_shape_of_the_load_is_no_leak(calibrated, recorded_by, plant):
    bent = replace(plant, load=Load.on_b_splines(Load((8.6e5, 0.1e5, 0.3e5))))
    log = recorded_by(bent, seconds=6.0, seed=5, name="worn", driven=1).without("pressure_a")
    leak = leak_of(read(log, calibrated))
    assert leak is None or leak.probability < 0.5


@pytest.mark.slow
def test_the_band_of_an_actuator_that_leaks_holds_beside_two_other_changes(worn, recorded_by, calibrated):
    kelvin = 30.0 / worn.value("T_0")
    colder, flow = 1.0 - kelvin, 1.0 + kelvin / 2.0
    by = {"P_S": 0.95, "D_v": 2.0, "T_0": colder, "T_w": colder, "C_vs": flow, "C_ve": flow}
    changed = {name: share * worn.value(name) for name, share in by.items()}
    leaking = worn.replace(changed | {"C_A0": 1e-10})
    log = recorded_by(leaking, seconds=6.0, seed=5, name="worn", driven=1).without("pressure_a")
    curve, true = read(log, calibrated).load_curve, worn.load.force(Y)
    low, high = (np.interp(Y, curve.position, end) for end in (curve.low, curve.high))
    # without a hypothesis of all three 25 % of the points were inside
    assert np.mean((low <= true) & (true <= high)) > 0.9
