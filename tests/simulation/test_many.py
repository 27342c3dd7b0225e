"""`simulate_many` has the numbers of `simulate`, whatever is shared between the simulations."""

import os
import platform
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from clutchid import Load, Partition, simulate, simulate_many
from clutchid.codegen.kernels import kernels_in
from clutchid.errors import DataError, ParameterError, SolveError
from clutchid.log import Log
from clutchid.measurements import write
from clutchid.model import Actuator
from clutchid.model.variants import VARIANTS
from clutchid.parameters import Parameters
from clutchid.simulation.plan import plan
from clutchid.simulation.simulation import PREPARED_BY, prepared_log, states_of
from clutchid.strokes.values import limits

T = 1e-3 * np.arange(400)
STROKE = {"duty_supply": 0.8 * (T > 0.02) * (T < 0.12), "duty_exhaust": 0.9 * (T > 0.2)}


def recorded(shift: int = 0) -> Log:
    """A stroke with its position and pressure, whose samples come some samples later."""
    log = simulate(Actuator(), Log(T, {name: np.roll(duty, shift) for name, duty in STROKE.items()}, "stroke")).log
    position = np.where(np.arange(T.size) % 97 == 50, 0.05, log["position"])  # values that no piston reaches
    return Log(T, {**{name: log[name] for name in ("duty_supply", "duty_exhaust", "pressure_a")}, "position": position})


def assert_as_simulated(simulations, actuators, logs, **options):
    for simulation, actuator, log in zip(simulations, actuators, logs, strict=True):
        alone = simulate(actuator, log, on_failure="return", **options)
        assert (simulation.status, simulation.message, simulation.warnings) == (
            alone.status, alone.message, alone.warnings,
        )  # fmt: skip
        assert simulation.log.columns.keys() == alone.log.columns.keys()
        for name, values in alone.log.columns.items():
            tolerance = 1e-12 * np.ptp(values[np.isfinite(values)])
            np.testing.assert_allclose(simulation.log[name], values, rtol=0, atol=tolerance, err_msg=name)


@pytest.mark.parametrize("carrier", [0.0, 0.01])
@pytest.mark.parametrize("measured", [True, False])
def test_what_a_recording_is_prepared_by_is_what_preparing_reads(monkeypatch, carrier, measured):
    actuator = Actuator(model="energy-balance-stribeck").replace({"T_pwm": carrier})
    log = recorded() if measured else recorded().without("position", "pressure_a")
    stamps = T[:-1] + 3e-4
    log = replace(log, edges={"duty_supply": (stamps, STROKE["duty_supply"][1:])})
    names, used = {*Parameters.names()}, set()
    usual = Parameters.__getattribute__

    def noted(parameters, name):
        used.update({name} & names)
        return usual(parameters, name)

    def limited(*arguments):  # what the limits depend on is asked of the values
        before = {*used}
        result = limits(*arguments)
        used.intersection_update(before)
        return result

    monkeypatch.setattr("clutchid.strokes.values.limits", limited)
    monkeypatch.setattr(Parameters, "__getattribute__", noted)
    prepared_log(actuator, log, Partition(every=50) if measured else None)
    monkeypatch.setattr(Parameters, "__getattribute__", usual)
    assert used <= {*PREPARED_BY}
    assert "R_0vs" in used


@pytest.mark.parametrize("changes", [{"y_max": 0.02}, {"T_pwm": 0.01}, {"P_0": 0.9e5}, {"C_vs": 8e-9}, {"K_z": 3e6}])
def test_actuators_that_differ_in_anything_have_their_own_numbers(changes):
    usual, log = Actuator(model="energy-balance-stribeck"), recorded()
    actuators, partition = [usual, usual.replace(changes), usual], Partition(every=50)
    assert_as_simulated(simulate_many(actuators, log, partition=partition), actuators, [log] * 3, partition=partition)


def test_a_recording_is_planned_once_for_all_actuators_that_prepare_it_alike(monkeypatch):
    planned, log, actuator = [], recorded().without("position", "pressure_a"), Actuator()
    monkeypatch.setattr("clutchid.simulation.simulation.plan", lambda *inputs: planned.append(inputs) or plan(*inputs))
    for actuators in ([actuator], [actuator.replace({"D_v": 1800.0})], [actuator.replace({"y_max": 0.02}), actuator]):
        simulate_many(actuators, log)
        assert_as_simulated(simulate_many(actuators, log), actuators, [log] * len(actuators))
    assert len(planned) == 2
    monkeypatch.setattr("clutchid.simulation.simulation._LONGEST", len(log) - 1)
    simulate(actuator, replace(log, name="longer than any that keeps its plan"))
    simulate(actuator, replace(log, name="longer than any that keeps its plan"))
    assert len(planned) == 4


def test_a_measured_recording_is_judged_once_for_all_actuators_that_move_as_fast(monkeypatch):
    log, judged = simulate(Actuator(), recorded()).log, []
    log = Log(T, {name: log[name] for name in ("duty_supply", "duty_exhaust", "position")})
    monkeypatch.setattr("clutchid.strokes.values.kernels_in", lambda name: judged.append(name) or kernels_in(name))
    actuators = [Actuator().replace(C_vs=conductance) for conductance in (2e-8, 1.8e-8, 1.5e-8)]
    many = simulate_many(actuators, log)
    assert len(judged) == 1
    assert_as_simulated(many, actuators, [replace(log) for _ in actuators])
    short = Actuator().replace(y_max=2e-3)  # of less stroke than is measured
    assert simulate(short, log, force=True).warnings == simulate(short, replace(log), force=True).warnings != ()


def test_actuators_that_differ_in_their_load_have_one_stiffness(monkeypatch):
    log, names, usual = recorded(), [], kernels_in
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.setattr("clutchid.simulation.stiffness.kernels_in", lambda name: names.append(name) or usual(name))
    actuator = Actuator().replace({"M": 7.5})  # of no other test
    actuators = [actuator.replace({"theta_1": 5e5 + 4e3 * i}) for i in range(100)]
    assert_as_simulated(simulate_many(actuators, log), actuators, [log] * 100)
    assert len(names) == 1
    simulate(actuator.replace({"theta_1": 1e7}), log)
    assert len(names) == 3  # of a load that falls as steeply, and of one that rises


def test_one_actuator_on_many_recordings_and_pairs_of_both():
    logs, actuators = [recorded(i) for i in range(3)], [Actuator(load=Load((w, 0.0, 0.0))) for w in (7e5, 9e5, 12e5)]
    assert_as_simulated(simulate_many(actuators[0], logs), actuators[:1] * 3, logs)
    many = simulate_many(actuators, logs)
    assert_as_simulated(many, actuators, logs)
    assert many.column("position").shape == (3, T.size)
    assert np.array_equal(many[1:].column("pressure_a")[0], many[1].log["pressure_a"])


@pytest.fixture
def side_by_side(monkeypatch):
    """Few simulations are run in lanes too; whether one was run alone."""
    alone = []
    monkeypatch.setattr("clutchid.simulation.many._MANY_SAMPLES", 1)
    monkeypatch.setattr("clutchid.simulation.many._PARTS", 1)
    monkeypatch.setattr("clutchid.simulation.many.states_of", lambda *run: alone.append(run) or states_of(*run))
    return alone


def drawn(random: np.random.Generator, model: str) -> Actuator:
    """An actuator within some ten percent of the usual one, with a load on either basis."""
    actuator = Actuator(model=model)
    names = ("C_vs", "C_ve", "D_v", "F_C", "M", "K_z", "V_0A", "R_0vs", "B_vs")
    values = {name: actuator.value(name) * random.uniform(0.9, 1.1) for name in names}
    load = Load((random.uniform(7e5, 11e5), random.uniform(-1e5, 0.0), random.uniform(0.0, 1e5)))
    return replace(actuator.replace(values), load=load)


@pytest.mark.slow
@pytest.mark.parametrize("model", VARIANTS)
@pytest.mark.parametrize("partition", [None, Partition(every=50), Partition(parts=3, carry="q")])
def test_lanes_have_the_numbers_of_single_simulations(side_by_side, model, partition):
    random, log = np.random.default_rng(1), recorded()
    hole = np.where((T > 0.15) & (T < 0.17), np.nan, log["duty_supply"])
    logs = [log, replace(log, columns={**log.columns, "duty_supply": hole}), recorded(7)]
    pairs = [(drawn(random, model), logs[i // 4 % 3]) for i in range(24)]
    pairs += [(replace(a, load=Load.on_b_splines(a.load)), log) for a, log in pairs]
    actuators, logs = zip(*pairs, strict=True)
    many = simulate_many(actuators, logs, partition=partition)
    assert len(side_by_side) < len(pairs) / 2
    assert_as_simulated(many, actuators, logs, partition=partition)


def test_recordings_at_other_times_share_lanes_and_those_with_other_samples_do_not(side_by_side):
    later = [replace(log, time=log.time + 0.1 * i) for i, log in enumerate([recorded()] * 8)]
    short = [log.slice(0, 300) for log in later]
    logs = [log for pair in zip(later, short, strict=True) for log in pair]
    assert_as_simulated(simulate_many(Actuator(), logs), [Actuator()] * 16, logs)
    assert not side_by_side
    assert_as_simulated(simulate_many(Actuator(), logs[:3]), [Actuator()] * 3, logs[:3])
    assert side_by_side


def test_a_simulation_that_diverges_leaves_the_others_of_its_lanes_as_they_are(side_by_side):
    actuators = [Actuator(load=Load((8e5 + 1e4 * i, 0.0, 0.0))) for i in range(8)]
    well = simulate_many(actuators, recorded())
    actuators[2] = Actuator(load=Load((1e300, 0.0, 0.0)))
    many = simulate_many(actuators, recorded())
    assert many.failed == (2,)
    assert len(side_by_side) == 1
    assert_as_simulated(many[2:3], actuators[2:3], [recorded()])
    for i in {*range(8)} - {2}:
        np.testing.assert_array_equal(many[i].log["pressure_a"], well[i].log["pressure_a"])


ELSEWHERE = """
import numpy as np
from clutchid import Actuator, Load, Log, simulate, simulate_many
from clutchid.simulation import many

many._MANY_SAMPLES = 1
t = 1e-3 * np.arange(400)
log = Log(t, {"duty_supply": 0.8 * (t > 0.02) * (t < 0.12), "duty_exhaust": 0.9 * (t > 0.2)})
actuators = [Actuator(load=Load((7e5 + 1e4 * i, 0.0, 1e4 * i))) for i in range(64)]
alone = np.array([simulate(actuator, log).log["pressure_a"] for actuator in actuators])
print(abs(simulate_many(actuators, log).column("pressure_a") / alone - 1.0).max())
"""


@pytest.mark.slow
@pytest.mark.parametrize("processor", ["x86-64-v2", "x86-64-v3"])
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="levels of another processor")
def test_lanes_have_the_numbers_of_single_simulations_on_another_processor(processor):
    environment = os.environ | {"NUMBA_CPU_NAME": processor}
    printed = subprocess.run([sys.executable, "-c", ELSEWHERE], env=environment, check=True, capture_output=True)
    assert float(printed.stdout) < 1e-12


def test_a_file_with_gauge_pressures_counts_from_the_ambient_of_each_actuator(tmp_path):
    log = recorded()
    write(replace(log, metadata={}), tmp_path / "log.csv")
    text = (tmp_path / "log.csv").read_text().replace("pressure_a [Pa]", "pressure_a [Pa(g)]")
    (tmp_path / "log.csv").write_text(text)
    actuators = [Actuator().replace({"P_0": 0.95e5}), Actuator(), Actuator().replace({"P_0": 1.02e5})]
    simulations = simulate_many(actuators, tmp_path / "log.csv")
    assert_as_simulated(simulations, actuators, [tmp_path / "log.csv"] * 3)
    assert "P_0, is" in simulations[1].warnings[0]


def test_a_divergence_is_a_status_or_is_raised():
    wild = (
        Actuator(load=Load((9e5, 0.0, 0.0))).replace({"C_vs": 1e300}) if Parameters.row("C_vs").admits(1e300) else None
    )
    log = recorded()
    actuators = [Actuator(), wild or Actuator(load=Load((1e300, 0.0, 0.0)))]
    simulations = simulate_many(actuators, log)
    assert_as_simulated(simulations, actuators, [log] * 2)
    assert simulations.failed == (1,)
    with pytest.raises(SolveError):
        simulate_many(actuators, log, on_failure="raise")


def test_numbers_that_do_not_go_together_are_said():
    with pytest.raises(ParameterError, match="2 actuators and 3 recordings"):
        simulate_many([Actuator()] * 2, [recorded()] * 3)
    assert len(simulate_many([], recorded())) == 0
    short = Log(T[:100], {name: duty[:100] for name, duty in STROKE.items()})
    many = simulate_many(Actuator(), [recorded(), short])
    with pytest.raises(DataError, match="100 to 400 samples"):
        many.column("position")
    with pytest.raises(DataError, match="no simulated column 'load'"):
        many[:1].column("load")
