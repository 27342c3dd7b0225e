"""The reference methods without a filter of the states: the adaptive observer, and least squares on the balance."""

import numpy as np
import pytest

from clutchid.documents.observe import samples_figure
from clutchid.observer import observe, observe_recording, observer, start
from fixtures.changed_logs import spoiled

STROKE = np.linspace(2e-3, 9e-3, 30)


@pytest.fixture(scope="module", params=["adaptive", "rls"])
def joint(request, plant):
    return observer(plant, request.param)


def test_only_the_load_adapts(joint, plant):
    assert {c.base for c in joint.joint.coordinates} == set(plant.load.names)


@pytest.mark.parametrize(
    ("method", "share", "pressure"), [("joint", 0.15, 10e3), ("adaptive", 0.4, 15e3), ("rls", 0.4, 15e3)]
)
def test_a_load_that_has_grown_is_followed(plant, worn, log, method, share, pressure):
    joint = observer(plant, method)
    state, samples = observe(joint, start(joint), log)
    off, before = (np.abs(load.force(STROKE) - worn.load.force(STROKE)) for load in (joint.load(state), plant.load))
    assert off.max() < share * before.max()
    late = slice(len(log) // 2, None)
    error = samples.states[late, plant.states.index("p_A")] - log["pressure_a"][late]
    assert np.sqrt(np.mean(error**2)) < pressure


def test_spikes_gaps_and_a_frozen_sensor_are_survived(joint, plant, worn, log):
    y = log["position"]
    torn = spoiled(spoiled(log, "position", slice(500, None, 400), y[500::400] + 5e-3), "position", slice(1500, 1700))
    torn = spoiled(torn, "position", slice(2600, 2900), y[2600])
    state, samples = observe(joint, start(joint), torn)
    assert np.isfinite(samples.states).all(axis=1).mean() > 0.95, "a spike behind a gap is believed for a moment"
    off = np.abs(joint.load(state).force(STROKE) - worn.load.force(STROKE))
    assert off.max() < 0.6 * np.abs(plant.load.force(STROKE) - worn.load.force(STROKE)).max()


def test_figure_and_table_name_what_an_innovation_compares(joint, log):
    run = observe_recording(joint, log.slice(0, 2000))
    names = {"adaptive": ("innovation", "innovation std"), "rls": ("innovation_force [N]", "innovation_force_std [N]")}
    innovation, deviation = (run.estimates()[name] for name in names[joint.method])
    assert np.array_equal(innovation, run.samples.innovations[:, 0], equal_nan=True)
    assert deviation**2 == pytest.approx(run.samples.innovations[:, 1], rel=1e-12, nan_ok=True)
    figure = samples_figure(run)
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert {"adaptive": "innovation\n[µm]", "rls": "innovation\n[N]"}[joint.method] in labels
