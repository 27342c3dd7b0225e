"""A recording followed by the joint filter in C, prediction and correction, against the filter in Python."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from clutchid.exports.filter import filter_c99
from clutchid.inference.filter import joint_filter as joint_module
from clutchid.inference.filter.joint_filter import JointSettings, follow, init, inputs, joint_filter
from clutchid.log import Log
from clutchid.model.compiled import system
from clutchid.observer.prior import online_prior
from clutchid.preparation.prepare import prepare
from clutchid.simulation.noise import Noise
from clutchid.simulation.windows import tracks
from fixtures.filter_c import FilterC, JointC, as_written, size_of

pytestmark = pytest.mark.slow

#: Parameters of the model that adapt, which have a column in C before the load weights; then the lag of the sensor.
FREE = ("F_C", "V_0A", "y_max", "D_v")
EXACT = ("-O2", "-ffp-contract=off")
SAMPLES = 6000


class Case(NamedTuple):
    """A filter, its first state, a recording for it, standard deviations of the prior, and what the kernels found."""

    made: object
    state: object
    inputs: object
    prior: np.ndarray
    outputs: object


@pytest.fixture(scope="module")
def case(plant, worn, recorded_by):
    """From the load of the plant, the load of the worn one is followed from position alone."""
    log: Log = recorded_by(worn, seconds=SAMPLES * 1e-3, driven=1)
    free, root, _ = online_prior(plant, (*plant.load.names, *FREE, "tau_y"))
    bases = [c.base for c in free]
    order = [bases.index(name) for name in (*FREE, *plant.load.names, "tau_y")]
    T = np.linalg.cholesky((root @ root.T)[np.ix_(order, order)])
    limits = 5.0 * np.ones(len(free))
    noise = Noise(states={name: row.noise for name, row in plant.state_rows.items()}, memory=0.01)
    made = joint_filter(plant, [free[i] for i in order], (-limits, limits), ("position",), noise, JointSettings())
    track = tracks([prepare(log, plant, ("position",))])[0]
    state, samples = init(made, track.segment, np.zeros(len(free)), T), inputs(made, track)
    outputs = follow(made, state, samples, (0, SAMPLES))
    return Case(made, state, samples, np.linalg.norm(T, axis=1), outputs)


@pytest.fixture(scope="module")
def model_of(plant, build):
    """The model in C: model_of(real)."""
    return cache(lambda real: build(system(plant.model), real, EXACT, FREE))


@pytest.fixture(scope="module")
def filter_of(case, model_of, compiled):
    """The filter of the case in C: filter_of(real)."""
    made, size = case.made, size_of(case.made)
    library_of = cache(lambda real: compiled(filter_c99(size, real), "joint", EXACT))
    return lambda real: FilterC(JointC(library_of(real), size, real), model_of(real), made)


def plainly_followed(case, c, count, patch):
    """As `follow`, by the text of the kernels in plain Python, with the model's step and constants in C."""
    carry, written = np.zeros(c.c.size.states), as_written()

    def step(x, moved, u, p, h, substeps, _, load, basis, window, *__):
        c.p[:], c.load[:] = p, load.ravel()
        c.place(int(window[0]))
        packed = np.ascontiguousarray(moved.T)
        c.step((x.ctypes.data, carry.ctypes.data, packed.ctypes.data), packed.shape[0], u, h, substeps)
        moved[:] = packed.T
        return bool(np.isfinite(x).all())

    def constants(p, *_):
        c.p[:] = p
        c.prepare()

    patch.setattr(joint_module, "kernels_in", lambda _: written)
    patch.setattr(joint_module, "calls", lambda _: (step, constants))
    return follow(case.made, case.state, case.inputs, (0, count))


def test_in_double_a_recording_is_followed_bit_by_bit_as_the_text_says(case, filter_of, monkeypatch):
    count = 1500
    state, outputs = filter_of("double").follow(tuple(case.state), case.inputs, count)
    expected, *others = plainly_followed(case, filter_of("double"), count, monkeypatch)
    for value, other in zip((*state, *outputs), (*expected[:7], *others), strict=True):
        np.testing.assert_array_equal(value, other)


#: Roundings of a state: 4 stages of some 100, over 1800 steps, in which the slowest state forgets, see
#: `test_models_c`.
ROUNDINGS = 4 * 100 * 1800


def test_in_double_a_recording_is_followed_as_by_the_compiled_kernels_up_to_rounding(case, filter_of):
    state, (errors, states, deviations) = filter_of("double").follow(tuple(case.state), case.inputs, SAMPLES)
    of_kernels, bound = case.outputs, ROUNDINGS * 2.0**-52
    assert np.abs((state[2] - of_kernels.state.theta) / case.prior).max() < bound
    assert (np.abs(states - of_kernels.states).max(axis=0) < bound * np.abs(of_kernels.states).max(axis=0)).all()
    assert np.array_equal(np.isnan(errors), np.isnan(of_kernels.errors))
    np.testing.assert_allclose(deviations, of_kernels.deviations, rtol=bound)


def test_in_float_weights_and_pressure_are_those_of_double(case, filter_of):
    """The bounds of a prototype that kept covariance, gains, weights and states in float, and moved them in double."""
    state, (_, states, deviations) = filter_of("float").follow(tuple(case.state), case.inputs, SAMPLES)
    of_kernels, p_A = case.outputs, case.made.mapped.actuator.states.index("p_A")
    assert np.abs((state[2] - of_kernels.state.theta) / case.prior).max() < 3e-4
    assert np.sqrt(np.mean((states - of_kernels.states)[:, p_A] ** 2)) < 5.0
    np.testing.assert_allclose(deviations[:, p_A], of_kernels.deviations[:, p_A], rtol=1e-2)
