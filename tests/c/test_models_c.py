"""Generated C of models against their Numba kernels: the paper's, the largest variant, and one of a user's own."""

from __future__ import annotations

import ctypes
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from clutchid.model import Actuator, Load, own_model
from clutchid.model.compiled import kernels, system
from clutchid.model.variants import VARIANTS
from clutchid.simulation.stiffness import stiffness
from fixtures.programs import tried

pytestmark = pytest.mark.slow

N = 3001
FAST = ("-O3", "-march=native", "-ffast-math")
EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "maxwell_slip.py"
PAPER = (9e5, -0.58e5, 0.39e5)

#: Actuator, integration steps a sample, samples that the slowest state remembers, and the functions that C calls. The
#: paper's pressures and velocity forget within 10 ms; the slowest of the energy balance but for the governor, which
#: rests, is the reservoir with tau_S = 0.6 s; of the own model all samples count.
CASES = {
    "paper": (lambda: Actuator(load=Load(PAPER)), 1, 10, {"sqrt"}),
    "energy balance": (
        lambda: Actuator(load=Load.on_b_splines(Load(PAPER)), model="energy-balance-stribeck"), 3, 600,
        {"sqrt", "exp", "pow"},
    ),
    "own": (lambda: Actuator(model=own_model(EXAMPLE, "maxwell_slip")), 2, N, {"sqrt", "pow"}),
}  # fmt: skip


def job_of(name):
    """Three seconds of filling, holding and releasing, against the upper stop too; arguments and the Numba states."""
    make, substeps, remembered, called = CASES[name]
    actuator, random = make(), np.random.default_rng(5)
    equations, q = system(actuator.model), actuator.parameters
    u = np.zeros((N, len(equations.inputs)))
    for start in range(0, N, 500):
        u[start : start + 250, 0] = random.uniform(0.2, 1.0)
        u[start + 300 : start + 450, 1] = random.uniform(0.2, 1.0)
    vented = {"p_A": q.P_0, "p_B": q.P_0, "T_A": q.T_w, "T_B": q.T_w, "p_S": q.P_S, "p_G": q.P_S}
    x0 = np.array([vented.get(state, 0.0) for state in actuator.states])
    p, dt, table = actuator.array(), np.full(N - 1, 1e-3), (actuator.load.breakpoints, actuator.load.combined())
    assert 2.5 * (substeps - 1) < stiffness(actuator) * 1e-3 < 2.5 * substeps, "one step less would be unstable"
    out, never, nothing = np.zeros((N, x0.size)), np.zeros(N, np.uint8), np.zeros((N, 2))
    steps = np.full(N - 1, substeps, np.int32)
    assert kernels(actuator.model).run(x0.copy(), u, p, dt, steps, never, nothing, *table, out) == -1
    assert out[:, 0].max() > 0.025
    return SimpleNamespace(
        system=equations,
        arguments={"x0": x0, "u": u, "p": p, "dt": dt, "table": table, "substeps": substeps},
        expected=out,
        roundings=4 * 100 * substeps * remembered,  # 4 stages of some 100 a step
        deflections=[i for i, state in enumerate(actuator.states) if state.startswith("z")],
        called=called,
    )


@pytest.fixture(scope="module", params=CASES)
def job(request):
    return job_of(request.param)


@pytest.fixture(scope="module")
def paper():
    return job_of("paper")


@pytest.mark.parametrize("flags", [("-O0",), ("-O2",), FAST])
def test_c_in_double_computes_the_states_of_the_numba_kernel_up_to_rounding(build, job, flags):
    status, out, x = build(job.system, "double", flags).run(**job.arguments)
    assert status == -1
    assert (x == out[-1]).all()
    scale = np.abs(job.expected).max(axis=0)
    assert (np.abs(out - job.expected).max(axis=0) <= job.roundings * np.finfo(float).eps * scale).all()


def test_c_in_float_stays_within_float_rounding_of_the_numba_kernel(build, job):
    status, out, _ = build(job.system, "float").run(**job.arguments)
    assert status == -1
    # Half a unit in the last place (2^-24) each, as often up as down, so their sum grows with the root; four standard
    # deviations. At the stop a position error becomes one of velocity at its frequency, sqrt(K_stop / M) = 1732 1/s.
    scale = 4 * np.sqrt(job.roundings) * 2.0**-24 * np.abs(job.expected).max(axis=0)
    scale[1] = scale[0] * np.sqrt(3e7 / 10)
    scale[job.deflections] = scale[0]
    assert (np.abs(out - job.expected).max(axis=0) <= scale).all()


def test_a_piston_at_rest_does_not_creep_in_float(build, paper):
    u = np.zeros((20_001, 2))
    u[:100, 0] = 0.9
    _, out, _ = build(paper.system, "float").run(**{**paper.arguments, "u": u, "dt": np.full(20_000, 1e-3)})
    # One unit in the last place of the position, 2^-24 of 16 mm, is what a hold of 18 s may move.
    assert np.ptp(out[2000:, 0]) <= 2.0**-23 * out[2000, 0]


def without_comments(text):
    return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)


def test_float_code_knows_no_double(build, job):
    built = build(job.system, "float")
    for text in (built.code.header, built.code.source):
        assert "double" not in text
        assert not re.findall(r"\d\.\d+(?:e[-+]?\d+)?(?![\dFe])", without_comments(text))
    if nm := tried("nm").path:
        command = [nm, "-D", "--undefined-only", str(built.file)]
        listed = subprocess.run(command, capture_output=True, text=True, check=True)
        assert not re.findall(r"\b(sqrt|exp|fabs|pow)\b", listed.stdout)


def test_the_code_takes_no_heap_and_calls_nothing_but_mathematics(build, job):
    built = build(job.system)
    called = set(re.findall(r"\b([a-z_A-Z]\w*)\(", without_comments(built.code.source)))
    own = {"lookup", "rhs", "step", *(f"{built.name}_{part}" for part in ("constants", "hold", "rhs", "step", "run"))}
    assert called - own <= {*job.called, "isfinite"}
    assert set(re.findall(r"#include\s+(\S+)", built.code.source)) == {"<math.h>", f'"{built.name}.h"'}


def test_one_step_by_hand_is_the_first_step_of_a_run_and_the_right_hand_side_is_that_of_the_kernels(build, paper):
    built, arguments = build(paper.system), paper.arguments
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
