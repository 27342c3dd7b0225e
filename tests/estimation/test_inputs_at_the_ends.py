"""Recordings without duty cycles in their first and last samples: every method uses the samples between these."""

from dataclasses import replace

import numpy as np
import pytest

import clutchid
from clutchid import FitRequest, fit
from clutchid.estimation.verification import starts_of as estimated_starts
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.observer import observe_recording, observer
from clutchid.simulation import Partition
from fixtures.changed_logs import spoiled, thinned

EXACT = Calibration((), np.zeros((0, 0)))
FIRST, LAST = 2, 3
INSIDE = slice(FIRST, -LAST)


def late(log):
    """`log` with duty cycles that begin some samples later, and end earlier."""
    return spoiled(spoiled(log, "duty_supply", slice(FIRST)), "duty_exhaust", slice(-LAST, None))


def ends_cut(log):
    """`log` without the samples that lack a duty cycle in `late`."""
    return log.slice(FIRST, len(log) - LAST)


def assert_same(late_result, cut_result, log):
    """Two fits are equal, the first with a row for every sample of `log`."""
    assert {name: e.value for name, e in late_result.parameters.items()} == {
        n: e.value for n, e in cut_result.parameters.items()
    }
    assert late_result.errors == cut_result.errors
    whole, part = late_result.recordings[log.name], cut_result.recordings[log.name]
    assert whole.starts == part.starts
    assert np.array_equal(whole.measured["position"], log["position"])
    assert np.array_equal(whole.simulated.time, log.time)
    assert np.array_equal(whole.simulated["position"][INSIDE], part.simulated["position"])
    assert np.isnan(whole.simulated["position"]).sum() == FIRST + LAST


@pytest.mark.parametrize("partition", [None, Partition(parts=4), Partition(every=300, carry="q")])
def test_a_fit_by_simulation_error_is_that_of_the_samples_with_inputs(worn_log, partition):
    log = worn_log.slice(0, 3000)
    late_result, cut_result = (
        fit(part, free=("theta_1",), request=FitRequest(partition=partition)) for part in (late(log), ends_cut(log))
    )
    assert_same(late_result, cut_result, log)
    # the errors are those of a simulation of the same recording
    again = clutchid.simulate(late_result.actuator, late(log), partition=partition).log
    assert np.array_equal(again["position"], late_result.recordings[log.name].simulated["position"], equal_nan=True)


@pytest.mark.slow
@pytest.mark.parametrize(("every", "free"), [(1, "load"), (10, "D_v")], ids=["1 kHz", "100 Hz"])
@pytest.mark.parametrize("method", ["shooting", "prediction-error"])
def test_a_reading_is_that_of_the_samples_with_inputs(plant, worn_log, method, every, free):
    actuator = replace(plant, duty_period=0.01)
    log = thinned(worn_log.slice(0, 4000), every)
    late_result, cut_result = (
        fit(part, actuator, free=free, request=FitRequest(calibration=EXACT), method=method)
        for part in (late(log), ends_cut(log))
    )
    assert_same(late_result, cut_result, log)


def test_a_verification_has_a_row_for_every_sample(truth, driven):
    log = driven(seconds=2.0)
    result = fit(log, truth, free=("theta_1",), verify=late(replace(log, name="other")))
    assert np.isnan(result.verification["other"].simulated["position"]).sum() == FIRST + LAST
    assert len(estimated_starts(late(log), truth)) == 1


def test_an_observer_follows_the_samples_with_inputs(plant, worn_log):
    log = worn_log.slice(0, 2000)
    joint = observer(plant)
    late_result, cut_result = (observe_recording(joint, part) for part in (late(log), ends_cut(log)))
    assert np.array_equal(late_result.samples.states[INSIDE], cut_result.samples.states)
    assert np.array_equal(late_result.after.theta, cut_result.after.theta)
    assert late_result.health["duty_missing"] == pytest.approx(1e-3 * (FIRST + LAST))
