"""The message of a failed simulation: state, time, and the term of the equations that went first."""

import re
import subprocess
import sys

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.model.compiled import kernels
from clutchid.model.variants import VARIANTS
from clutchid.simulation import simulate
from clutchid.simulation.divergence import failing_term
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_divergence")

pytestmark = pytest.mark.slow

ENGAGED = {
    "y": 5e-3, "v": 0.1, "p_A": 4e5, "p_B": 1.2e5, "z": 1e-6, "T_A": 300.0, "T_B": 290.0, "p_S": 9e5, "p_G": 9.1e5,
    "z_h": 1e-5, "x_vs": 0.6, "x_ve": 0.3,
}  # fmt: skip


def at(actuator: Actuator, duty=(1.0, 0.0), **changes) -> str:
    """What is wrong at a state, both valves at `duty`."""
    state = np.array([{**ENGAGED, **changes}[name] for name in VARIANTS[actuator.model]])
    inputs = np.zeros(len(kernels(actuator.model).INPUTS))
    inputs[:2] = duty
    return failing_term(actuator, state, inputs)


def opened() -> Log:
    return Log(np.arange(100) * 1e-3, {"duty_supply": np.ones(100), "duty_exhaust": np.zeros(100)}, "run")


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_terms_are_those_of_the_kernels(variant):
    actuator, module = Actuator(model=variant), kernels(variant)
    state = np.array([ENGAGED[name] for name in VARIANTS[variant]])
    inputs = np.array([1.0, 0.2, 0.3, 0.1, 1.0, 0.2])[: len(module.INPUTS)]
    rates, jacobian = np.empty((1, state.size)), np.empty((1, state.size, state.size))
    load, p = actuator.load, actuator.parameters.array()
    module.linearise(state[None], inputs[None], p, load.breakpoints, load.combined(), rates, jacobian)
    force = float(load.force(state[:1])[0])
    values = dict(zip((row[0] for row in module.TERMS), module.terms(state, inputs, p, force), strict=True))
    # the same operations, but for what the compiler reorders: some hundred roundings
    for name, rate in zip(VARIANTS[variant], rates[0], strict=True):
        assert values[f"d_{name}"] == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize(("variant", "changes", "words"), CASES["terms"])
def test_the_first_term_that_is_not_finite_is_named_with_its_parameters(variant, changes, words):
    actuator = Actuator(model=variant)
    if "y" in changes and changes["y"] > 1:
        actuator = actuator.replace({"theta_2": 1e200})
    message = at(actuator, (1.0, 1.0), **changes)
    for word in words:
        assert word in message


@pytest.mark.parametrize(("theta", "by", "force"), [(-1e9, "", "-"), (1e9, "-", "")], ids=["rises", "falls"])
def test_where_all_terms_are_finite_the_fastest_state_is_named_with_what_drives_it(theta, by, force):
    message = at(Actuator().replace({"theta_1": theta}))
    # 5 mm of 1e9 N/m, flattened by the spline: an acceleration of some 1e5 m/s² of 10 kg
    assert re.match(rf"all terms are finite and v changes fastest, by {by}\d.* f_l = {force}\d.* M = 10 kg$", message)


def test_a_pressure_in_next_to_no_volume_changes_fastest():
    assert at(Actuator().replace({"V_0A": 1e-9}), y=0.0).startswith("all terms are finite and p_A changes fastest")


def test_a_failed_simulation_says_state_time_term_and_parameters_in_one_sentence():
    failed = simulate(Actuator().replace({"theta_2": -1e9}), opened(), on_failure="return")
    assert failed.status == "failed"
    position = failed.log["position"]
    last = int(np.flatnonzero(np.isfinite(position))[-1])
    assert f"diverged at {(last + 1) * 1e-3:.3f} s in y, " in failed.message
    assert f"; at {last * 1e-3:.3f} s " in failed.message
    assert " f_l = -" in failed.message
    assert " M = 10 kg" in failed.message
    assert failed.message.count(".\n") == 0
    assert failed.message.endswith("; try other start values or check the units of the recording.")


def test_a_failure_at_the_first_sample_has_no_term():
    failed = simulate(Actuator(), opened(), starts=[(np.nan, 1e5)], on_failure="return")
    assert "at 0.000 s in y; try other" in failed.message


def test_to_name_the_term_sympy_is_not_needed():
    code = (
        "import sys, numpy as np, clutchid\n"
        "log = clutchid.Log(np.arange(100) * 1e-3, {'duty_supply': np.ones(100), 'duty_exhaust': np.zeros(100)})\n"
        "bad = clutchid.Actuator().replace({'theta_2': -1e9})\n"
        "assert 'changes fastest' in clutchid.simulate(bad, log, on_failure='return').message\n"
        "assert 'sympy' not in sys.modules"
    )
    # on a new machine the first process makes the kernels, which takes SymPy
    assert any(subprocess.run([sys.executable, "-c", code], check=False).returncode == 0 for _ in range(2))
