"""Generated C of the largest variant, ten states, against the Numba kernel."""

import re

import numpy as np
import pytest

from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels, system
from clutchid.model.variants import VARIANTS
from clutchid.model.weighted_load import Load
from clutchid.simulation.stiffness import stiffness

pytestmark = pytest.mark.slow

VARIANT = "energy-balance-stribeck"
N = 3001
FAST = ("-O3", "-march=native", "-ffast-math")
#: Steps a sample. The bearing without load is the fastest, K_h / F_h |v|.
STEPS = 3
#: The slowest thing that the model forgets but for the governor, which rests: the reservoir, tau_S = 0.6 s or 1800
#: steps; 4 stages, some 100 roundings.
ROUNDINGS = 4 * 100 * 600 * STEPS


@pytest.fixture(scope="module")
def job():
    """Three seconds of filling, holding and releasing on a B-spline load, against the upper stop too."""
    actuator = Actuator(load=Load.on_b_splines(Load((9e5, -0.58e5, 0.39e5))), model=VARIANT)
    random = np.random.default_rng(5)
    u = np.zeros((N, len(system(VARIANT).inputs)))
    for start in range(0, N, 500):
        u[start : start + 250, 0] = random.uniform(0.2, 1.0)
        u[start + 300 : start + 450, 1] = random.uniform(0.2, 1.0)
    p, dt = actuator.parameters.array(), np.full(N - 1, 1e-3)
    x0 = np.array([0.0, 0.0, 1.095e5, 1.095e5, 0.0, 293.0, 293.0, 9e5, 9e5, 0.0])
    table = (actuator.load.breakpoints, actuator.load.combined())
    out = np.zeros((N, x0.size))
    rate = stiffness(actuator)
    assert 2.5 * (STEPS - 1) < rate * 1e-3 < 2.5 * STEPS  # one step less a millisecond would be unstable
    steps = np.full(N - 1, STEPS, np.int32)
    never, nothing = np.zeros(N, np.uint8), np.zeros((N, 2))
    status = kernels(VARIANT).run(x0.copy(), u, p, dt, steps, never, nothing, *table, out)
    assert status == -1
    assert out[:, 0].max() > 0.025
    assert np.ptp(out[:, 5]) > 50
    return {"x0": x0, "u": u, "p": p, "dt": dt, "table": table, "substeps": STEPS}, out


@pytest.mark.parametrize("flags", [("-O0",), ("-O2",), FAST])
def test_c_in_double_computes_the_ten_states_of_the_numba_kernel_up_to_rounding(build, job, flags):
    arguments, expected = job
    status, out, x = build(system(VARIANT), "double", flags).run(**arguments)
    assert status == -1
    assert (x == out[-1]).all()
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(out - expected).max(axis=0) <= ROUNDINGS * np.finfo(float).eps * scale).all()


def test_c_in_float_stays_within_float_rounding_of_the_ten_states(build, job):
    arguments, expected = job
    status, out, _ = build(system(VARIANT), "float").run(**arguments)
    assert status == -1
    # Half a unit in the last place each, as often up as down, so their sum grows with the root; four standard
    # deviations: 2e-4 of the range. A position error becomes one of velocity at the stop's frequency, 1732 1/s.
    scale = 4 * np.sqrt(ROUNDINGS) * 2.0**-24 * np.abs(expected).max(axis=0)
    scale[1] = scale[0] * np.sqrt(3e7 / 10)
    scale[[4, 9]] = scale[0]
    assert (np.abs(out - expected).max(axis=0) <= scale).all()


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_c_of_every_variant_compiles_strictly_and_has_the_rates_of_its_kernel(build, variant):
    actuator = Actuator(load=Load.on_b_splines(), model=variant)
    random = np.random.default_rng(7)
    state = np.array([3e-3, 4e-3, 4e5, 1.2e5, 1e-4, 320.0, 280.0, 8.5e5, 8.8e5, 2e-5, 0.3, 0.2])[
        : len(VARIANTS[variant])
    ]
    u, p = np.zeros(len(system(variant).inputs)), actuator.parameters.array()
    u[:2] = random.uniform(0.2, 0.9, 2)
    table = (actuator.load.breakpoints, actuator.load.combined())
    for real in ("double", "float"):
        _, out, _ = build(system(variant), real).run(state, [u, u], p, [1e-3], table=table)
        expected = np.empty((2, state.size))
        arguments = (np.array([1e-3]), np.ones(1, np.int32), np.zeros(2, np.uint8), np.zeros((2, 2)))
        kernels(variant).run(state.copy(), np.array([u, u]), p, *arguments, *table, expected)
        eps = np.finfo(np.float64 if real == "double" else np.float32).eps
        # One step of 4 stages, a hundred roundings each; the acceleration is a difference of forces of 5 kN over 10 kg.
        scale = np.abs(expected).max(axis=0)
        scale[1] = 5e3 / 10 * 1e-3
        assert np.all(np.abs(out[1] - expected[1]) <= 4 * 100 * eps * scale)


def test_the_code_of_the_energy_balance_takes_no_heap_and_float_knows_no_double(build):
    built = build(system(VARIANT), "float")
    name = "energy_balance_stribeck"
    called = set(re.findall(r"\b([a-z_A-Z]\w*)\(", re.sub(r"/\*.*?\*/", "", built.code.source, flags=re.DOTALL)))
    own = {"lookup", "rhs", "step", *(f"{name}_{part}" for part in ("constants", "hold", "rhs", "step", "run"))}
    assert called - own <= {"sqrtf", "expf", "powf", "isfinite"}
    for text in (built.code.header, built.code.source):
        assert "double" not in text
