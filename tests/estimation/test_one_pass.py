"""A load read in one pass of the joint filter."""

from dataclasses import replace

import numpy as np
import pytest

import clutchid
from clutchid.estimation.free import FreeParameters
from clutchid.estimation.one_pass import one_pass
from clutchid.estimation.problem import fit_problem
from clutchid.numerics.failure import Failure
from clutchid.uncertainty.calibration import Calibration

EXACT = Calibration((), np.zeros((0, 0)))


@pytest.fixture(scope="module")
def known():
    return clutchid.Actuator(model="energy-balance-stribeck", load=clutchid.Load.on_b_splines(clutchid.Load()))


@pytest.fixture(scope="module")
def problem(known):
    """Ten seconds of a clutch with a tenth more load."""
    duty = clutchid.bundled_recording().slice(0, 10000).without("pressure_a").without("position")
    worn = known.replace({name: 1.1 * known.value(name) for name in known.load.names})
    noise = 3e-5 * np.random.default_rng(2).standard_normal(len(duty))
    log = duty.with_columns(position=clutchid.simulate(worn, duty).log["position"] + noise)
    made, _ = fit_problem([log], known, FreeParameters(known.load.names, ("position",)), EXACT)
    return made


def test_one_pass_reads_a_load_that_has_grown(problem, known):
    found = one_pass(problem)
    y = np.linspace(2e-3, 9e-3, 30)
    read = problem.actuator_of(found.x, problem.stems[0]).load.force(y)
    truth = 1.1 * known.load.force(y)
    assert np.sqrt(np.mean((read - truth) ** 2)) < 0.015 * truth.max()
    assert np.linalg.eigvalsh(found.covariance).min() > -1e-12


def test_one_pass_gives_the_states_at_the_start_of_every_window(problem):
    found = one_pass(problem)
    (track,) = problem.tracks
    starts = np.array([window.start for window in track.windows])
    assert found.X[0].shape == (len(track.windows), len(problem.actuator.states))
    assert found.X[0][:, 0] == pytest.approx(track.measured["position"][starts], abs=5e-4)


def test_a_recording_that_cannot_be_followed_is_a_failure(problem):
    (track,) = problem.tracks
    dt = track.segment.dt.copy()
    dt[500] = np.nan
    broken = replace(problem, tracks=(replace(track, segment=replace(track.segment, dt=dt)),))
    assert isinstance(one_pass(broken), Failure)
