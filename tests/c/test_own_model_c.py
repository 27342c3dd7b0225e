"""Generated C of a model of one's own against the Numba kernel: the worked example of the documentation."""

from pathlib import Path

import numpy as np
import pytest

from clutchid.model import Actuator, own_model
from clutchid.model.compiled import kernels, system
from clutchid.simulation.stiffness import stiffness

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "maxwell_slip.py"
N, STEPS = 2001, 2


@pytest.fixture(scope="module")
def job():
    """Two seconds of strokes with partial openings."""
    actuator = Actuator(model=own_model(EXAMPLE, "maxwell_slip"))
    random = np.random.default_rng(5)
    u = np.zeros((N, 2))
    for start in range(0, N, 400):
        u[start : start + 100, 0] = random.uniform(0.3, 0.9)
        u[start + 200 : start + 350, 1] = random.uniform(0.3, 0.9)
    p, dt, x0 = actuator.array(), np.full(N - 1, 1e-3), np.array([0.0, 0.0, 1.095e5, 1.095e5, 0.0, 0.0])
    table = (actuator.load.breakpoints, actuator.load.combined())
    assert stiffness(actuator) * 1e-3 < 2.5 * STEPS
    out, never, nothing = np.zeros((N, x0.size)), np.zeros(N, np.uint8), np.zeros((N, 2))
    steps = np.full(N - 1, STEPS, np.int32)
    assert kernels(actuator.model).run(x0.copy(), u, p, dt, steps, never, nothing, *table, out) == -1
    assert out[:, 0].max() > 5e-3
    return system(actuator.model), {"x0": x0, "u": u, "p": p, "dt": dt, "table": table, "substeps": STEPS}, out


def test_c_of_an_own_model_computes_the_states_of_its_kernel_up_to_rounding(build, job):
    equations, arguments, expected = job
    status, out, _ = build(equations, "double").run(**arguments)
    assert status == -1
    # 4 stages, some 100 roundings each, of as many steps as the slowest mode remembers: here all of them
    roundings = 4 * 100 * STEPS * N
    assert (np.abs(out - expected).max(axis=0) <= roundings * 2.0**-52 * np.abs(expected).max(axis=0)).all()


def test_c_in_float_of_an_own_model_compiles_strictly(build, job):
    equations, arguments, expected = job
    status, out, _ = build(equations, "float").run(**arguments)
    assert status == -1
    # as for the variants: roundings add up with their root, four standard deviations
    scale = 4 * np.sqrt(4 * 100 * STEPS * N) * 2.0**-24 * np.abs(expected).max(axis=0)
    assert (np.abs(out - expected)[:, [0, 2, 3]].max(axis=0) <= scale[[0, 2, 3]]).all()
