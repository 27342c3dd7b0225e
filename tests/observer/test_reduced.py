"""The reduced joint filter: the calibrated load plus modes of it that adapt, against the filter with all weights."""

import numpy as np
import pytest

from clutchid.documents.observe_rows import observe_json
from clutchid.inference.filter.joint_filter import drifted
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.observer import curve, estimates_of, observe, observe_recording, observer, start
from clutchid.observer.methods import MODES
from clutchid.observer.observer import DRIFT

ORIGIN = Origin("cal.toml", "0" * 64, "0")

#: Positions in m over which the load is compared.
STROKE = np.arange(1e-3, 15.1e-3, 0.5e-3)


@pytest.fixture(scope="module")
def reduced(plant):
    return observer(plant, "joint-reduced")


@pytest.fixture(scope="module")
def run(reduced, log):
    return observe_recording(reduced, log)


def load_deviations(estimator, state):
    """What the filter knows of the load, without the parts of a band that no recording makes smaller."""
    return np.linalg.norm(estimator.actuator.load.phi(STROKE) @ estimator.prior.weights @ state.T, axis=1)


@pytest.mark.parametrize("method", ["joint", "joint-reduced"])
def test_a_stroke_widens_every_standard_deviation_of_the_prior_by_the_same_share(plant, method):
    estimator = observer(plant, method)
    T = start(estimator).T
    before, after = (np.linalg.norm(root, axis=1) for root in (T, drifted(estimator.joint, T, np.array([len(T)]))))
    assert after == pytest.approx(np.sqrt(1.0 + DRIFT) * before, rel=1e-12)


def test_it_starts_from_the_calibrated_load_with_nearly_all_of_the_prior_of_the_load(reduced, joint, plant):
    assert len(reduced.joint.coordinates) == len(joint.joint.coordinates) - len(plant.load.theta) + MODES
    assert reduced.load(start(reduced)) == plant.load
    filtered = reduced.joint.actuator(start(reduced).theta).load
    assert filtered.force(STROKE) == pytest.approx(plant.load.force(STROKE), rel=1e-12)
    few, whole = (load_deviations(estimator, start(estimator)) for estimator in (reduced, joint))
    assert np.all(few < whole)
    assert np.all(few > 0.98 * whole)


@pytest.mark.slow
def test_its_standard_deviations_are_those_of_the_filter_with_all_weights(run, reduced, joint, log):
    """Within the 10 % that the method promises."""
    full, _ = observe(joint, start(joint), log)
    few, whole = (estimates_of(estimator, state) for estimator, state in ((reduced, run.after), (joint, full)))
    for name in reduced.adapting:
        if name not in reduced.actuator.load.names:
            assert few[name].std == pytest.approx(whole[name].std, rel=0.1)
    determined = load_deviations(joint, full) < 0.5 * load_deviations(joint, start(joint))
    assert determined.sum() > 10
    ratio = load_deviations(reduced, run.after) / load_deviations(joint, full)
    assert np.abs(ratio[determined] - 1.0).max() < 0.1


def test_the_load_is_reported_in_the_basis_of_the_calibration(run, reduced, joint, plant):
    estimates = estimates_of(reduced, run.after)
    assert set(estimates) == set(estimates_of(joint, start(joint)))
    assert [estimates[name].value for name in plant.load.names] == list(reduced.load(run.after).theta)
    assert all(estimates[name].std > 0.0 for name in plant.load.names)
    assert set(observe_json(run, ORIGIN)["parameters"]) == set(estimates)
    assert not [name for name in run.load_by_stroke().columns if name.startswith("mode")]
    filtered = reduced.joint.actuator(run.after.theta).load
    assert curve(reduced, run.after, STROKE).force == pytest.approx(filtered.force(STROKE), rel=1e-9)
