"""The assembled model in its compiled form: rest is rest, and the Jacobian is the derivative of the rates."""

import subprocess
import sys

import numpy as np
import pytest

from clutchid.model import Load
from clutchid.model.compiled import kernels
from clutchid.parameters import Parameters

pytestmark = pytest.mark.slow

THETA = (9e5, -0.3e5, 0.6e5)


def linearised(x: np.ndarray, u: np.ndarray, parameters: Parameters | None = None) -> tuple[np.ndarray, np.ndarray]:
    load, p = Load(THETA), (parameters or Parameters()).array()
    rates, jacobian = np.empty_like(x), np.empty((x.shape[0], 5, 5))
    kernels("isothermal").linearise(x, u, p, load.breakpoints, load.combined(), rates, jacobian)
    return rates, jacobian


@pytest.fixture(scope="module")
def points() -> tuple[np.ndarray, np.ndarray]:
    """Random states inside and just outside the stroke, and duty cycles; seed fixed."""
    generator = np.random.default_rng(31)
    low = np.array([-2e-4, -0.3, 1.15e5, 0.9e5, -2e-4])
    high = np.array([25.2e-3, 0.3, 8.8e5, 1.4e5, 2e-4])
    return generator.uniform(low, high, (500, 5)), generator.uniform(0, 1, (500, 2))


def test_the_jacobian_has_fourteen_entries_at_most(points):
    x, u = points
    _, jacobian = linearised(x, u)
    assert (np.abs(jacobian) > 0).any(axis=0).sum() <= 14


def test_at_equal_pressures_chamber_b_still_feels_that_they_could_differ():
    # the laminar line ends at r = 1, where its slope counts: a start has p_B = P_0 exactly
    _, jacobian = linearised(np.array([[5e-3, 0.0, 3e5, 1.095e5, 0.0]]), np.zeros((1, 2)))
    psi = 0.5 * np.sqrt(1 - 0.999**2) + 0.5 * np.sqrt(1 - ((0.999 - 0.582) / 0.418) ** 2)
    V_B = 1.2e-4 + 11.848e-3 * 20e-3
    assert jacobian[0, 3, 3] == pytest.approx(-288 * 293 / V_B * 1.185 * 5e-8 * psi / 1e-3, rel=1e-9)


def test_simulations_call_the_kernels_with_the_signatures_that_are_compiled_ahead():
    code = (
        "import numpy as np, clutchid\n"
        "from clutchid.model.compiled import compile_ahead, compiled_functions, kernels\n"
        "from clutchid.simulation.stiffness import stiffness\n"
        "compile_ahead(('isothermal',))\n"
        "log = clutchid.Log(np.arange(100) * 1e-3, {'duty_supply': np.ones(100), 'duty_exhaust': np.zeros(100)})\n"
        "spline = clutchid.Actuator(load=clutchid.Load.on_b_splines())\n"
        "for actuator in (clutchid.Actuator(), spline):\n"
        "    clutchid.simulate(actuator, log)\n"
        "    clutchid.simulate(actuator, log, sensitivities=('theta_1',))\n"
        "    clutchid.simulate(actuator, log, sensitivities=('theta_1', 'C_vs'))\n"
        "    stiffness(actuator)\n"
        "module = kernels('isothermal')\n"
        "for kernel in (module.run, module.run_all, module.linearise, module.opening, module.passed_pulses):\n"
        "    assert len(kernel.signatures) == 1, (kernel, kernel.signatures)\n"
    )
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
