"""Generated C of the paper's model against the Numba kernel."""

import ctypes
import re
import shutil
import subprocess

import numpy as np
import pytest

from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.model.isothermal import isothermal

pytestmark = pytest.mark.slow

N = 3001
FAST = ("-O3", "-march=native", "-ffast-math")


@pytest.fixture(scope="module")
def job():
    """Three seconds of filling, holding and releasing, against the upper stop too; arguments and the Numba states."""
    actuator = Actuator().replace({"theta_2": -0.58e5, "theta_3": 0.39e5})
    random = np.random.default_rng(5)
    u = np.zeros((N, 2))
    for start in range(0, N, 500):
        u[start : start + 250, 0] = random.uniform(0.2, 1.0)
        u[start + 300 : start + 450, 1] = random.uniform(0.2, 1.0)
    p, dt = actuator.parameters.array(), np.full(N - 1, 1e-3)
    x0 = np.array([0.0, 0.0, 1.095e5, 1.095e5, 0.0])
    table = (actuator.load.breakpoints, actuator.load.combined())
    out = np.zeros((N, 5))
    never, nothing = np.zeros(N, np.uint8), np.zeros((N, 2))
    status = kernels("isothermal").run(x0.copy(), u, p, dt, np.ones(N - 1, np.int32), never, nothing, *table, out)
    assert status == -1
    assert out[:, 0].max() > 0.025
    return {"x0": x0, "u": u, "p": p, "dt": dt, "table": table}, out


@pytest.mark.parametrize("flags", [("-O0",), ("-O2",)])
def test_c_in_double_computes_the_states_of_the_numba_kernel_up_to_rounding(build, job, flags):
    arguments, expected = job
    status, out, x = build(isothermal(), "double", flags).run(**arguments)
    assert status == -1
    assert (x == out[-1]).all()
    # Both round, in another order: 4 stages of some 100 roundings a step. The model forgets: pressures and velocity
    # within 10 ms (10 steps), so 4 * 100 * 10 roundings of the largest value remain, 9e-13.
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(out - expected).max(axis=0) <= 4 * 100 * 10 * np.finfo(float).eps * scale).all()


def test_c_in_float_stays_within_float_rounding_of_the_numba_kernel(build, job):
    arguments, expected = job
    status, out, _ = build(isothermal(), "float").run(**arguments)
    assert status == -1
    # The same 4000 roundings, half a unit in the last place (2^-24) each, are as often up as down: their sum has a
    # standard deviation of sqrt(4000) 2^-24 = 4e-6 of the range, 94 nm or 3 Pa. Four of them are allowed. At the stop a
    # position error becomes one of velocity at the stop's natural frequency, sqrt(K_stop / M) = 1732 1/s.
    y, _, p_A, p_B, _ = 4 * np.sqrt(4000) * 2.0**-24 * np.abs(expected).max(axis=0)
    assert (np.abs(out - expected).max(axis=0) <= [y, y * np.sqrt(3e7 / 10), p_A, p_B, y]).all()


def test_a_piston_at_rest_does_not_creep_in_float(build, job):
    arguments, _ = job
    u = np.zeros((20_001, 2))
    u[:100, 0] = 0.9
    _, out, _ = build(isothermal(), "float").run(**{**arguments, "u": u, "dt": np.full(20_000, 1e-3)})
    # One unit in the last place of the position, 2^-24 of 16 mm, is what a hold of 18 s may move.
    assert np.ptp(out[2000:, 0]) <= 2.0**-23 * out[2000, 0]


def test_fast_arithmetic_changes_rounding_only(build, job):
    arguments, expected = job
    _, out, _ = build(isothermal(), "double", FAST).run(**arguments)
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(out - expected).max(axis=0) <= 4 * 100 * 10 * np.finfo(float).eps * scale).all()


def test_float_code_knows_no_double(build):
    built = build(isothermal(), "float")
    for text in (built.code.header, built.code.source):
        assert "double" not in text
        code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        assert not re.findall(r"\d\.\d+(?:e[-+]?\d+)?(?![\dFe])", code)
    if shutil.which("nm"):
        listed = subprocess.run(
            ["nm", "-D", "--undefined-only", str(built.file)], capture_output=True, text=True, check=True
        )
        assert not re.findall(r"\b(sqrt|fabs|pow)\b", listed.stdout)


def test_the_code_takes_no_heap_and_calls_nothing_but_mathematics(build):
    code = build(isothermal()).code.source
    called = set(re.findall(r"\b([a-z_A-Z]\w*)\(", re.sub(r"/\*.*?\*/", "", code, flags=re.DOTALL)))
    own = {"lookup", "rhs", "step", *(f"isothermal_{part}" for part in ("constants", "hold", "rhs", "step", "run"))}
    assert called - own <= {"sqrt", "isfinite"}
    assert set(re.findall(r"#include\s+(\S+)", code)) == {"<math.h>", '"isothermal.h"'}


def test_one_step_by_hand_is_the_first_step_of_a_run_and_the_right_hand_side_is_that_of_the_kernels(build, job):
    arguments, _ = job
    built = build(isothermal())
    library = built.library()
    constants, held, memory = (ctypes.create_string_buffer(4096) for _ in range(3))
    u, p = built.array([0.8, 0.3]), built.array(arguments["p"])
    table = ctypes.byref(built.table(*arguments["table"]))
    state = [0.003, 0.1, 4e5, 1.2e5, 1e-4]

    def address(array):
        return ctypes.c_void_p(array.ctypes.data)

    library.isothermal_constants(address(p), constants)
    library.isothermal_hold(address(u), address(p), constants, held)
    dx = np.zeros(5)
    library.isothermal_rhs(address(built.array(state)), address(p), constants, held, table, memory, address(dx))
    rates, jacobian = np.zeros((1, 5)), np.zeros((1, 5, 5))
    kernels("isothermal").linearise(np.array([state]), u[None], p, *arguments["table"], rates, jacobian)
    # The acceleration is a difference of forces of 5 kN over 10 kg, of which a few dozen roundings remain.
    np.testing.assert_allclose(dx, rates[0], rtol=50 * np.finfo(float).eps, atol=50 * np.finfo(float).eps * 500)

    x = built.array(state)
    library.isothermal_step(address(x), address(p), constants, held, table, memory, ctypes.c_double(1e-3))
    _, out, _ = built.run(state, [u, u], p, [1e-3], table=arguments["table"])
    assert (x == out[1]).all()
