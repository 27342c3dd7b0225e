"""In lanes, expressions and runs have the numbers that they have one by one."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from clutchid.codegen.cache import load_module
from clutchid.codegen.kernels import LANES
from clutchid.codegen.language import FUNCTIONS
from clutchid.codegen.llvm import ArrayElement, Interface, function
from clutchid.codegen.numba_source import lanes_source, module_head
from clutchid.codegen.program import lower

pytestmark = pytest.mark.slow

x, y = sp.symbols("x y", real=True)


@pytest.fixture(scope="module", params=LANES)
def computed(request, tmp_path_factory) -> Callable[..., np.ndarray]:
    """Values of expressions in x and y for arrays of both, by compiled code."""
    lanes = request.param
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CLUTCHID_CACHE", str(tmp_path_factory.mktemp("kernels")))

        def compute(values, first, second):
            symbols = [sp.Symbol(f"result_{i}", real=True) for i, _ in enumerate(values)]
            statements = [part for pair in zip(symbols, values, strict=True) for part in lower(*pair)]
            stores = [(ArrayElement("out", i), symbol) for i, symbol in enumerate(symbols)]
            loads = {x: ArrayElement("a", 0), y: ArrayElement("b", 0)}
            printed = function("f", Interface(("out", "a", "b")), statements, loads, stores, lanes)
            name = f"f_{printed.name}"
            text = (
                module_head(name)
                + f"""
f = linked("{printed.name}", {printed.arguments}, \'\'\'
{printed.text}\'\'\')

@generated
def run(out, a, b):
    for k in range(a.shape[0]):
        f(out[k], a[k], b[k])
"""
            )
            module = load_module(name, [Path(__file__)], lambda: text)
            count = -(-len(first) // lanes) * lanes
            a, b = (np.resize(np.asarray(of, float), count).reshape(-1, lanes) for of in (first, second))
            out = np.empty((len(a), len(values), lanes))
            module.run(out, a, b)
            return np.moveaxis(out, 1, 0).reshape(len(values), -1)[:, : len(first)]

        yield compute


def test_every_function_gives_what_the_library_gives(computed):
    a = np.random.default_rng(1).uniform(0.01, 0.99, 64)
    values = [x**y if name == "pow" else getattr(sp, name)(x) for name in FUNCTIONS]
    for name, got in zip(FUNCTIONS, computed(values, a, 1 - a), strict=True):
        expected = a ** (1 - a) if name == "pow" else [getattr(math, name)(value) for value in a]
        np.testing.assert_allclose(got, expected, rtol=4e-16 * 4, err_msg=name)


def test_exponentials_logarithms_and_powers_hold_over_the_whole_range(computed):
    random, numbers = np.random.default_rng(1), 4000
    special = [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf, math.nan, 5e-324, 1e308, 709.7, 709.8, -745.0, -746.0, 2.0]
    a = np.concatenate([random.uniform(-750, 750, numbers), 10 ** random.uniform(-320, 308, numbers), special * 4])
    b = np.concatenate([random.uniform(-3, 3, 2 * numbers), np.repeat([0.0, 0.5, -2.0, 800.0], len(special))])
    with np.errstate(all="ignore"):
        expected = np.exp(a), np.log(a), a**b
    got = computed([sp.exp(x), sp.log(x), x**y], a, b)
    for name, values, true in zip(("exp", "log", "pow"), got, expected, strict=True):
        np.testing.assert_array_equal(np.isfinite(values), np.isfinite(true), err_msg=name)
        # an error of the logarithm counts as often as the logarithm of the power
        np.testing.assert_allclose(values, true, rtol=2e-13 if name == "pow" else 1.4e-15, atol=5e-324, err_msg=name)


def test_each_lane_takes_its_own_arm(computed):
    long = sum((x + i) ** -1 for i in range(9))  # is jumped over where no lane needs it
    inner = sp.Piecewise((sp.sqrt(x), x > 1), (long, x > 0), (sp.Integer(7), True))
    value = sp.Piecewise((inner, sp.Or(y > 0, sp.And(x > 2, y < -1))), (sp.Piecewise((x**y, x > 1), (y, True)), True))
    random = np.random.default_rng(2)
    for a, b in ((random.uniform(-1, 3, 400), random.uniform(-2, 2, 400)), (np.full(16, 2.5), np.full(16, 1.0))):
        expected = [float(value.subs({x: u, y: v})) for u, v in zip(a[:40], b[:40], strict=True)]
        np.testing.assert_allclose(computed([value], a, b)[0][:40], expected, rtol=1e-14)


@pytest.mark.parametrize("lanes", LANES)
def test_runs_side_by_side_have_the_states_of_single_ones(assorted, compiled, tmp_path, monkeypatch, lanes):
    monkeypatch.setenv("CLUTCHID_CACHE", str(tmp_path))
    module = load_module(f"lanes_{lanes}", [Path(__file__)], lambda: lanes_source(assorted, lanes))
    kernels, random, n, count = compiled(assorted), np.random.default_rng(3), 200, 3 * lanes
    x0 = random.uniform([-1, 0, 0, -0.5], [1, 1, 1, 3.5], (count, 4))
    p, theta = random.uniform(0.5, 2, (count, 2)), random.uniform(-1, 1, (count, 2))
    dt, u = random.uniform(0.005, 0.01, (count, n - 1)), random.uniform(-1, 1, (count, n, 1))
    x0[4] = np.nan
    jump, substeps = np.zeros(n, np.uint8), np.full(n - 1, 2, np.int32)
    jump[[50, 120]] = 1, 2

    def by_lane(values):
        return np.ascontiguousarray(np.moveaxis(values.reshape(3, lanes, *values.shape[1:]), 1, -1))

    ends = np.broadcast_to(np.append(kernels.breakpoints, np.inf), (count, 4))
    loads = np.array([np.tensordot(weights, kernels.basis, 1) for weights in theta])
    out, failed = np.full((3, 4, n, lanes), np.nan), np.zeros((3, lanes), np.bool_)
    measured = by_lane(np.full((count, n, 1), 0.3))
    arrays = by_lane(x0), by_lane(u), by_lane(p), by_lane(dt), substeps, jump, measured, by_lane(ends), by_lane(loads)
    module.run_lanes(*arrays, out, 0, failed)
    for run in range(count):
        jumps = {50: 1, 120: 2}
        status, alone, _ = kernels.run(
            x0[run], p[run], dt[run], u=u[run], substeps=2, jump=jumps, measured=0.3, theta=theta[run]
        )
        assert failed[run // lanes, run % lanes] == (status >= 0)
        if status < 0:
            np.testing.assert_allclose(out[run // lanes, :, :, run % lanes].T, alone, rtol=0, atol=1e-14)
