"""One step with its derivatives in C: the text as it is kept, and the same numbers as the Numba kernel.

Where another text is meant, write the files anew and look at the difference before keeping them:

    CLUTCHID_WRITE_GOLDEN=1 python -m pytest tests/c/test_columns_c.py && git diff tests/c/golden
"""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from clutchid.codegen.c99 import c99_source
from clutchid.codegen.cache import load_module
from clutchid.codegen.numba_source import numba_source
from clutchid.codegen.system import System, TabulatedFunction
from clutchid.model import Actuator, Load
from clutchid.model.compiled import kernels, system
from clutchid.parameters import Parameters
from fixtures.programs import path_of

pytestmark = pytest.mark.slow

GOLDEN = Path(__file__).parent / "golden"
EPS = {"double": np.finfo(np.float64).eps, "float": np.finfo(np.float32).eps}

#: Parameters with a column in C, by system.
FREE = {"pendulum": ("g_l", "d"), "isothermal": ("P_S", "C_vs", "F_C")}


def pendulum() -> System:
    """A pendulum on a spring whose moment f(phi) is known to the table only, with drag, driven by a moment."""
    phi, omega, m, g_l, d, f, drag = sp.symbols("phi omega m g_l d f drag", real=True)
    definitions = ((drag, d * sp.Abs(omega) * omega),)
    rates = (omega, m - g_l * sp.sin(phi) - drag - f)
    return System("pendulum", (phi, omega), (m,), (g_l, d), definitions, rates, TabulatedFunction(f, phi))


SYSTEMS = {"pendulum": pendulum, "isothermal": lambda: system("isothermal")}


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", list(SYSTEMS))
def test_the_text_is_as_it_was(name, real):
    code = c99_source(SYSTEMS[name](), real=real, derivatives=FREE[name])
    for text, file in ((code.header, GOLDEN / real / f"{name}.h"), (code.source, GOLDEN / real / f"{name}.c")):
        if os.environ.get("CLUTCHID_WRITE_GOLDEN"):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        assert text == file.read_text(), f"{file.name} in {real} has changed"


#: Breakpoints of the pendulum's spring, and two functions: linear, and cubic beyond 0.5.
SPRING = (
    np.array([0.0, 0.5]),
    np.array(
        [[[0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.5, 1.0, 0.0, 0.0]],
         [[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.3, -0.2]]]
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def swing(tmp_path_factory):
    """The pendulum's kernels."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CLUTCHID_CACHE", str(tmp_path_factory.mktemp("kernels")))
        return load_module("pendulum", [Path(__file__)], lambda: numba_source(pendulum()))


def columns_of(module, names, free):
    """Where the columns of C stand for the kernel: parameters first, then two weights or three."""
    slots = [(k, row, free.index(names[q])) for k, (row, q) in enumerate(module.SLOTS) if names[q] in free]
    return [np.ascontiguousarray(column) for column in np.array(slots, np.int64).reshape(-1, 3).T]


def stepped(module, x, S, u, p, h, substeps, table, fill, weights):
    """x and S after one interval, by the Numba kernel."""
    x, S, work = x.copy(), S.copy(), np.empty(module.work_size(S.shape[1]))
    basis = np.arange(weights)
    free = S.shape[1] - weights - x.size
    module.prepare(p, fill[0], work)
    assert module.step(x, S, u, p, h, substeps, *table, basis, basis + free, *fill, work)
    return x, S


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("real", ["double", "float"])
def test_the_pendulum_swings_alike_with_its_derivatives(build, swing, real, substeps):
    breakpoints, basis = SPRING
    theta, p, generator = np.array([2.0, 1.5]), np.array([9.0, 0.3]), np.random.default_rng(5)
    table, module = (breakpoints, np.tensordot(theta, basis, 1)), build(pendulum(), real, derivatives=FREE["pendulum"])
    fill = columns_of(swing, ("g_l", "d"), FREE["pendulum"])
    for _ in range(50):
        x, S, u = generator.uniform(-1, 1, 2), generator.uniform(-1, 1, (2, 6)), generator.uniform(-1, 1, 1)
        if real == "float":  # numbers that float holds, so that only its steps round
            x, S, u = (part.astype(np.float32).astype(np.float64) for part in (x, S, u))
        exact = stepped(swing, x, S, u, p, 0.01, substeps, (*table, basis), fill, 2)
        of_c = module.step(x, S, u, p, 0.01, substeps, (*table, basis))
        # Rates are sums of ten terms of at most 20, so ten roundings of 20 h; what is added to is rounded once a stage.
        # p and theta are rounded to float as well. All of it four times a step.
        bound = 4 * substeps * EPS[real] * (1.0 + 10 * 20 * 0.01)
        np.testing.assert_allclose(of_c[0], exact[0], rtol=0, atol=bound * np.abs(exact[0]).max(initial=1.0))
        np.testing.assert_allclose(of_c[1], exact[1], rtol=0, atol=bound * np.abs(exact[1]).max(initial=1.0))


#: Largest terms in the rates of the paper's model, in its states: m/s, m/s², Pa/s, Pa/s, m/s. Forces are 8 bar on
#: 123 cm² and a bristle of 1e-4 m under 1e7 N/m over 10 kg; the pressure in an empty chamber rises by 12 MPa/s.
LARGEST = np.array([0.3, 1200.0, 2e7, 5e6, 0.3])

#: How far a state goes in the cases below; a column of derivatives to the logarithm of a parameter is as large.
SCALE = np.array([0.02, 0.2, 5e5, 1.2e5, 1e-4])

#: The fastest mode decays with 2436 1/s: a step of 1 ms multiplies a rounding by 1 + 2.4 + 2.4²/2 + 2.4³/6 + 2.4⁴/24.
GROWTH = 10.0


def sizes(actuator):
    """Values of what the columns belong to: parameters, load weights, and 1 for what the states started with."""
    return np.array([*(actuator.value(name) for name in FREE["isothermal"]), *np.abs(actuator.load.theta), *[1.0] * 5])


def actuator_case(real):
    """States, columns, duty cycles, parameters, and tables of the paper's model, from a fixed seed."""
    generator, actuator = np.random.default_rng(8), Actuator(load=Load((9e5, -0.3e5, 0.6e5)))
    load = actuator.load
    table = (load.breakpoints, load.combined(), np.ascontiguousarray(load.coefficients))
    for _ in range(60):
        x = np.array([0.01, 0.0, 4e5, 1.1e5, 0.0]) + SCALE * generator.uniform(-0.4, 0.4, 5)
        S = SCALE[:, None] * generator.uniform(-1, 1, (5, 3 + 3 + 5)) / sizes(actuator)
        u = generator.choice([0.0, 0.5, 1.0], 2)
        if real == "float":
            x, S, u = (part.astype(np.float32).astype(np.float64) for part in (x, S, u))
        yield x, S, u, actuator.parameters.array(), table


@pytest.mark.parametrize("real", ["double", "float"])
def test_the_papers_model_takes_the_same_step_with_its_derivatives(build, real):
    module, compiled = kernels("isothermal"), build(system("isothermal"), real, derivatives=FREE["isothermal"])
    fill, h = columns_of(module, Parameters.names(), FREE["isothermal"]), 1e-3
    for x, S, u, p, table in actuator_case(real):
        exact = stepped(module, x, S, u, p, h, 1, table, fill, 3)
        of_c = compiled.step(x, S, u, p, h, 1, table)
        # Some 30 operations from the states to a rate, four stages, each rounds what is largest in it.
        bound = 4 * 30 * EPS[real] * (SCALE + h * LARGEST)
        np.testing.assert_array_less(np.abs(of_c[0] - exact[0]), bound)
        wrong = np.abs(of_c[1] - exact[1]) * sizes(Actuator(load=Load((9e5, -0.3e5, 0.6e5))))
        assert (wrong < GROWTH * bound[:, None]).all()


def test_a_compiled_step_needs_nothing_but_mathematics(build):
    """No heap and no input or output: what the object asks for from outside is the mathematical library alone."""
    file = build(system("isothermal"), derivatives=FREE["isothermal"]).file.with_name("c.o")
    asked = subprocess.run([path_of("nm"), "-u", str(file)], capture_output=True, text=True, check=True).stdout.split()
    assert {name for name in asked if name != "U"} <= {"sqrt", "pow", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}


def test_without_free_parameters_states_and_weights_keep_their_columns(build):
    x, k = sp.symbols("x k", real=True)
    module = build(System("decay", (x,), (), (k,), (), (-k * x,)), derivatives=())
    stepped = module.step([2.0], [[1.0, 3.0]], [], [0.5], 0.1, 1)
    shrinks = sum((-0.05) ** i / float(sp.factorial(i)) for i in range(5))
    np.testing.assert_allclose(stepped[0], 2.0 * shrinks, rtol=4 * EPS["double"])
    np.testing.assert_allclose(stepped[1], [[shrinks, 3.0 * shrinks]], rtol=4 * EPS["double"])


@pytest.mark.parametrize("real", ["double", "float"])
def test_a_state_that_changes_by_less_than_its_rounding_does_not_stand_still(build, real):
    x, k = sp.symbols("x k", real=True)
    module, eps = build(System("growth", (x,), (), (k,), (), (k * x,)), real, derivatives=()), EPS[real]
    end, _ = module.step([1.0], [[1.0]], [], [0.1 * eps], 1000.0, 1000)  # a tenth of the last place, a thousand times
    assert float(end[0]) - 1.0 == pytest.approx(100 * float(eps), abs=float(eps))


def test_a_derivative_to_no_parameter_is_refused():
    with pytest.raises(ValueError, match=r"pendulum has no parameter length, so no derivatives to it\."):
        c99_source(pendulum(), derivatives=("g_l", "length"))
