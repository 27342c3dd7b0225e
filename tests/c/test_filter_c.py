"""The joint filter in C: each function against its kernel, and a recording followed in C and in Python.

In double C computes bit by bit what the text of the kernels says. The compiled kernels reorder sums and contract
products with them, so they agree with it up to rounding.
"""

import subprocess
from copy import deepcopy
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from clutchid.codegen.kernels import kernels_in
from clutchid.exports.filter import FilterSize, filter_c99
from clutchid.inference.filter.setup import (
    BOUND_LOW,
    LEAST,
    MEAN,
    MOST,
    Derived,
    FilterArrays,
    FilterState,
    FreeArrays,
    ModelArrays,
    SettingsArrays,
    Window,
    scratch,
)
from clutchid.simulation.stiffness import AS_PLANNED
from fixtures.filter_c import FACTOR, JointC, as_written
from fixtures.filters import callbacks, nothing
from fixtures.programs import path_of

pytestmark = pytest.mark.slow

EXACT = ("-O2", "-ffp-contract=off")
SIZE = FilterSize(
    states=4, sensors=2, parameters=6, of_model=2, of_sensors=2, drifts=6, model_parameters=4, weights=3, pieces=4,
    window=1,
)  # fmt: skip
N, M, K, ROWS, RESPONSES = 4, 2, 6, 6, 5
DT = 1e-3

#: Outputs and states of two sensors; the first has a free lag, the second a free offset.
SENSORS = np.array([[4, 0, 3, -1], [5, 2, -1, 5]])
PLACES = np.array([[-1, 0, -1, -1], [-1, 1, -1, -1], [1, -1, -1, -1], [2, -1, -1, -1], [-1, 2, 0, -1], [-1, 3, -1, 1]])
PIECES, BREAKPOINTS = np.array([[0, 2], [0, 1], [2, 3]]), np.array([-0.5, -0.1, 0.4])

#: No rows are wanted, as for an observer.
NO_ROWS = np.zeros((0, M, 1))


@dataclass
class Drawn:
    """Arguments of the kernels, drawn at random and held by a float as well."""

    state: tuple
    numbers: np.ndarray
    derived: tuple
    p: np.ndarray
    load: np.ndarray
    basis: np.ndarray
    drifts: np.ndarray
    sigma: np.ndarray
    h: np.ndarray
    values: np.ndarray
    later: np.ndarray
    seed: int
    settings: tuple

    breakpoints = BREAKPOINTS

    @property
    def free(self):
        return FreeArrays(self.numbers, PLACES, PIECES)

    @property
    def room(self):
        """Scratch arrays of the kernels."""
        return scratch(ROWS, K + ROWS, np.zeros((K, K)), N, M)

    @property
    def model(self):
        none = np.zeros(0, np.int64)
        fixed = BREAKPOINTS.copy(), self.basis.copy()
        for array in fixed:
            array.flags.writeable = False
        return ModelArrays(self.p, fixed[0], self.load, fixed[1], *[none] * 5, np.zeros(N))


def drawn(seed):
    random = np.random.default_rng(seed)

    def single(*shape):
        return random.uniform(-1, 1, shape).astype(np.float32).astype(np.float64)

    endless, ones = np.full(K, np.inf), np.ones(K)
    positive = np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0])
    numbers = np.column_stack([1.5 + single(K), 0.25 * single(K), positive, -endless, endless, -1.5 * ones, 1.5 * ones])
    numbers[3, [LEAST, MOST]] = -0.5, 0.5
    numbers[2, BOUND_LOW] = 1.0
    numbers[4, MEAN] = 2.0**-20 if seed % 3 == 0 else 2.0**-10  # below a hundredth of an interval, the lag is a shift
    T, L = np.tril(single(K, K)) + np.eye(K), single(ROWS, ROWS) + 2.0 * np.eye(ROWS)
    outlier, speed, ahead = 1.5, 0.25, 0.125
    drifts, x, moved, none = np.tril(single(K, K)), single(ROWS), single(ROWS, RESPONSES + ROWS), np.zeros((3, 1), int)
    return Drawn(
        state=FilterState(
            x, np.hstack([single(ROWS, K), L]), single(K), T, np.abs(single(ROWS)), moved, np.array([seed % 2]),
            np.zeros((ROWS, 0)), np.zeros((K, 0)), np.zeros(ROWS), np.zeros_like(moved), np.zeros(ROWS), none[0],
            np.zeros(M), none[1], none[2] + seed % 9,
        ),
        numbers=numbers,
        derived=Derived(single(3), np.array([numbers[4, MEAN], 2.0**-11]), 1.0 + np.abs(single(M, 2)), single(K)),
        p=single(4),
        load=single(4, 4),
        basis=single(3, 4, 4),
        drifts=drifts,
        sigma=np.abs(single(N)),
        h=single(K + ROWS),
        values=np.array([20.0 * single(1)[0], np.nan if seed % 4 == 0 else 1.0]),
        later=single(ROWS, RESPONSES + ROWS),
        seed=seed,
        settings=SettingsArrays(1, outlier, speed, 1, 0, -1, np.zeros((ROWS, 0)), drifts, ahead),
    )  # fmt: skip


def rest(x, S, u, p, h, substeps, breakpoints, load, basis, b, c, slot, row, column, work):
    """A model whose states stay as they are."""
    return bool(h > 0.0)


class InPython:
    """Arguments as the kernels `m` take them."""

    def __init__(self, m, calls, g):
        self.m, self.g, self.room, self.model = m, g, g.room, g.model
        self.step, self.prepare = calls
        self.x, self.S, self.theta, self.T, _, self.moved, *_ = self.state = g.state
        columns, at_weights = np.array([0, 1, 2 + g.seed % 2, 4, 5]), np.array([2, 3])
        self.window = Window(np.ones(1, np.int64), columns, columns[2:3], np.array([1, 2]), at_weights)
        self.weights, self.lags, self.of_sensor, self.slopes = self.derived = g.derived
        self.gains = np.zeros((M, ROWS + 1))
        self.arrays = FilterArrays(
            self.model, g.free, self.derived, SENSORS, g.settings, AS_PLANNED, self.window, self.room
        )

    def after(self, extra):
        """All that a function may change, and what it returns."""
        return flat(self.state[:7], self.derived, self.g.p, self.g.load, extra)


class InC:
    """The same arguments as C takes them."""

    def __init__(self, c, g):
        names = ("breakpoints", "basis", "sigma", "h", "values")
        self.breakpoints, self.basis, self.sigma, self.h, self.values = (c.array(getattr(g, name)) for name in names)
        self.c, self.call, self.g, self.room = c, c.call, g, c.scratch
        self.state, self.derived = c.state(g.state), c.derived(g.derived, g.p, g.load)
        self.motion, self.columns, self.belief = self.state
        self.p, self.load = (np.ctypeslib.as_array(getattr(self.derived, name)) for name in ("p", "load"))
        self.fixed = c.filter(g.free, SENSORS, self.breakpoints, self.basis, g.drifts, g.settings)
        self.weights, _, _, self.slopes = map(c.array, g.derived)

    def corrected(self):
        """The errors of a correction, which has moved on since."""
        wear, correction = int(self.g.state.wear[0]), self.c.correction
        drift = (K - wear % K) % K if wear > 0 else -1
        self.call("begin_correction", correction, self.motion, self.fixed, self.values, 1, drift)
        np.ctypeslib.as_array(self.motion.moved)[:] = self.g.later.T
        self.c.correct(self.state, self.derived, self.fixed)
        self.call("end_correction", correction, self.motion)
        return np.ctypeslib.as_array(correction.errors)

    def zeros(self, *shape):
        return self.c.array(np.zeros(shape))

    def after(self, extra):
        d = self.derived
        derived = d.weights, d.lags, np.column_stack([d.offsets, d.sigmas]), d.slopes
        return flat(self.c.arrays(self.state), derived, self.p, self.load, extra)


def flat(state, derived, p, load, extra):
    return [np.array(part, dtype=np.float64).ravel() for part in (*state, *derived, p, load, extra)]


def filled(array, function, *arguments):
    """`array`, which a function fills that has it as its last argument but for those after it."""
    function(*arguments)
    return array


def lag_in_python(a, tau):
    return filled(coefficients := np.zeros((1, 6)), a.m.lag_coefficients, tau, np.array([DT]), coefficients)


def predicted_in_python(a):
    interval = np.zeros(1), np.array([DT]), 1, a.g.sigma, np.vstack([lag_in_python(a, tau) for tau in a.lags])
    a.m.move_wide_columns(a.step, a.state, a.moved, interval, a.arrays)


def predicted_in_c(c):
    moving = len(c.motion.moved)
    c.call("add_noise", c.motion, c.sigma)
    c.call("begin_interval", c.motion, c.fixed, c.derived, DT, moving, c.room)
    c.call("end_interval", c.motion, c.fixed, moving, c.room)


def corrected_in_python(a):
    errors = np.zeros((M, 2))
    a.m.begin_correction(a.state, a.arrays, a.g.values)
    a.moved[:] = a.g.later
    a.m.end_correction(a.prepare, a.state, a.arrays, (errors, a.gains, NO_ROWS))
    return errors


#: How each function is called in Python and in C; what it returns or fills besides state, model and W.
FUNCTIONS = {
    "value_in_si": (
        lambda a: [a.m.value_in_si(row, at) for row, at in zip(a.g.numbers, a.theta, strict=True)],
        lambda c: [c.call("value_in_si", c.fixed.parameters[j], FACTOR, float(c.g.state[2][j])) for j in range(K)],
    ),
    "combine_load": (
        lambda a: a.m.combine_load(a.g.load, a.g.basis, PIECES, a.weights),
        lambda c: c.call("combine_load", c.load, c.fixed, c.weights),
    ),
    "refresh": (
        lambda a: a.m.refresh(a.prepare, a.theta, a.g.free, a.derived, a.model),
        lambda c: c.call("refresh", c.belief, c.fixed, c.derived),
    ),
    "lag_coefficients": (
        lambda a: lag_in_python(a, a.lags[0]),
        lambda c: filled(lag := c.zeros(6), c.call, "lag_coefficients", float(c.g.derived[1][0]), DT, lag),
    ),
    "predict": (predicted_in_python, predicted_in_c),
    "project_parameters": (
        lambda a: [a.m.project_parameters(a.T, a.g.h, a.slopes, a.room.w), *a.room.w],
        lambda c: [c.call("project_parameters", c.belief, c.h, c.slopes, w := c.zeros(K)), *w],
    ),
    "correction": (corrected_in_python, lambda c: c.corrected()),
    "state_deviations": (
        lambda a: filled(deviations := np.zeros(N), a.m.first_deviations, a.S, a.T, a.slopes, deviations, a.room.w),
        lambda c: [
            c.call("state_deviation", c.columns, c.belief, c.derived, row, c.zeros(K)) for row in range(N)
        ],
    ),
}  # fmt: skip

#: Those whose result in C is a number or nothing, but no result of theirs.
PROCEDURES = {"combine_load", "refresh"}


def in_python(m, calls, g, name):
    arguments = InPython(m, calls, deepcopy(g))
    result = FUNCTIONS[name][0](arguments)
    return arguments.after([] if result is None else result)


def in_c(c, g, name):
    arguments = InC(c, deepcopy(g))
    result = FUNCTIONS[name][1](arguments)
    return arguments.after([] if result is None or name in PROCEDURES else result)


@pytest.fixture(scope="module")
def plain():
    return as_written()


@pytest.fixture(scope="module")
def kernels():
    return kernels_in("clutchid.inference.filter.recursion")


@pytest.fixture(scope="module")
def calls():
    return callbacks(rest)


@pytest.fixture(scope="module")
def joint_of(compiled):
    """The library of a size: joint_of(size, real, flags)."""

    @cache
    def make(size, real="double", flags=EXACT):
        return JointC(compiled(filter_c99(size, real), "joint", flags), size, real)

    return make


@pytest.mark.parametrize("name", FUNCTIONS)
def test_in_double_c_computes_bit_by_bit_what_the_text_of_a_kernel_says(joint_of, plain, name):
    c, changed = joint_of(SIZE), False
    for seed in range(24):
        g = drawn(seed)
        expected = in_python(plain, (rest, nothing), g, name)
        before = flat(g.state[:7], g.derived, g.p, g.load, np.zeros_like(expected[-1]))
        for of_c, value in zip(in_c(c, g, name), expected, strict=True):
            np.testing.assert_array_equal(of_c, value)
        changed |= any(not np.array_equal(*both) for both in zip(before, expected, strict=True))
    assert changed


#: Roundings of a result: sums of at most 12 terms through at most 8 stages, one after the other. They are divided by
#: the variance of a sensor at the least, 1, or by a pivot of a matrix near 2 or 3 times the unit matrix.
ROUNDINGS = 12 * 8


def assert_close(values, expected, eps):
    """Within roundings of what is largest in what they are made from, at most 20² (an outlier times its gain)."""
    for value, other in zip(values, expected, strict=True):
        np.testing.assert_allclose(
            value, other, rtol=ROUNDINGS * eps, atol=ROUNDINGS * eps * np.nanmax(np.abs(other), initial=1.0)
        )


@pytest.mark.parametrize(("real", "flags", "eps"), [("double", EXACT, 2.0**-52), ("float", ("-O2",), 2.0**-23)])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_c_is_its_compiled_kernel_up_to_rounding_and_the_order_of_sums(
    joint_of, kernels, calls, name, real, flags, eps
):
    c = joint_of(SIZE, real, flags)
    for seed in range(24):
        g = drawn(seed)
        assert_close(in_c(c, g, name), in_python(kernels, calls, g, name), eps)


@pytest.mark.parametrize("real", ["double", "float"])
def test_a_filter_of_the_states_alone_compiles_strictly_and_corrects_them(joint_of, plain, real):
    size = FilterSize(N, M, 0, 0, 0, 0, 4, 3, 4, 0)
    c, g = joint_of(size, real, EXACT), drawn(1)
    x, S, _, _, waiting, moved, first, *_ = deepcopy(g.state)
    S, moved, empty = np.ascontiguousarray(S[:, K:]), np.ascontiguousarray(moved[:, RESPONSES:]), np.zeros((0, 0))
    state = g.state._replace(
        x=x, S=S, theta=np.zeros(0), T=empty, waiting=waiting, moved=moved, first=0 * first,
        at_moved=np.zeros_like(moved), wear=0 * first,
    )  # fmt: skip
    nowhere = np.zeros(0, np.int64)
    window = Window(nowhere, nowhere, nowhere, nowhere, nowhere)
    sensors = SENSORS * [1, 1, 0, 0] - [0, 0, 1, 1]
    free, basis = FreeArrays(np.zeros((0, 7)), np.zeros((0, 4), np.int64), PIECES), c.array(g.basis)
    derived, breakpoints = g.derived._replace(slopes=np.zeros(0)), c.array(g.breakpoints)
    in_c, expected = c.state(state), np.zeros((M, 2))
    fixed = c.filter(free, sensors, breakpoints, basis, empty, g.settings)
    c.call("begin_correction", c.correction, in_c.motion, fixed, c.array(g.values), 1, -1)
    c.correct(in_c, c.derived(derived, g.p, g.load), fixed)
    c.call("end_correction", c.correction, in_c.motion)
    room = scratch(ROWS, ROWS, empty, N, M)
    arrays = FilterArrays(g.model, free, derived, sensors, g.settings, AS_PLANNED, window, room)
    plain.begin_correction(state, arrays, g.values)
    plain.end_correction(nothing, state, arrays, (expected, np.zeros((M, ROWS + 1)), NO_ROWS))
    of_c = *c.arrays(in_c), np.array(c.correction.errors)
    if real == "double":
        for value, other in zip(of_c, (*state[:7], expected), strict=True):
            np.testing.assert_array_equal(value, other)
    assert_close(of_c, (*state[:7], expected), 2.0**-52 if real == "double" else 2.0**-23)


def test_what_is_neither_a_number_nor_finite_is_left_out(joint_of):
    c, g = joint_of(SIZE), drawn(1)
    for value in (np.nan, np.inf, -np.inf):
        g.values[:], g.state.wear[:] = value, 0
        arguments = InC(c, deepcopy(g))
        assert np.isnan(arguments.corrected()).all()
        after = c.arrays(arguments.state)
        assert np.array_equal(after[0], g.state.x)
        assert np.array_equal(after[2], g.state.theta)
        assert np.array_equal(after[3], g.state.T)


def test_parameters_move_only_while_the_piston_is_fast(joint_of):
    c, g = joint_of(SIZE), drawn(1)
    for speed, moves in ((0.2, False), (-0.3, True), (0.3, True)):
        g.state[0][1] = speed
        arguments = InC(c, deepcopy(g))
        arguments.corrected()
        assert np.array_equal(c.arrays(arguments.state)[2], g.state[2]) is not moves


@pytest.mark.parametrize("real", ["double", "float"])
def test_the_compiled_filter_needs_nothing_but_mathematics_and_float_knows_no_double(compiled, real):
    code = filter_c99(SIZE, real)
    file = compiled(code, "joint", ("-O2",)).with_name("c.o")
    asked = subprocess.run([path_of("nm"), "-u", str(file)], capture_output=True, text=True, check=True).stdout.split()
    allowed = {"double": {"sqrt", "exp"}, "float": {"sqrtf", "expf"}}[real]
    extra = {"memset", "memcpy", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}  # of the compiler
    assert {name for name in asked if name != "U"} <= allowed | extra
    if real == "float":
        assert "double" not in code.header + code.source
