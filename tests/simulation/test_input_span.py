"""Recordings whose duty cycles begin later, or end earlier, than the position."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.log import INPUTS, Log
from clutchid.simulation import Partition, simulate
from clutchid.simulation.inputs import LONG_END, input_span, with_inputs
from fixtures.changed_logs import spoiled

FIRST, LAST = 3, 5


@pytest.fixture(scope="module")
def late(drive):
    """`drive` without a duty cycle of the supply in its first samples, and without one of the exhaust in its last."""
    return without(drive, duty_supply=slice(FIRST), duty_exhaust=slice(-LAST, None))


def without(log, **gaps):
    """`log` with missing samples."""
    for name, at in gaps.items():
        log = spoiled(log, name, at)
    return log


def test_only_the_ends_without_inputs_are_cut_off(drive, late):
    assert input_span(without(late, duty_supply=slice(4000, 4100))) == slice(FIRST, len(drive) - LAST)
    assert with_inputs(drive) is drive
    assert np.array_equal(with_inputs(late).time, drive.time[FIRST:-LAST])


@pytest.mark.parametrize("partition", [None, Partition(every=700), Partition(parts=9, carry="q")])
def test_a_simulation_is_that_of_the_samples_with_inputs_and_has_a_row_for_every_sample(truth, drive, late, partition):
    whole = simulate(truth, late, partition=partition, sensitivities="theta_1")
    part = simulate(truth, drive.slice(FIRST, len(drive) - LAST), partition=partition, sensitivities="theta_1")
    inside, outside = slice(FIRST, -LAST), np.r_[0:FIRST, -LAST:0]
    assert (whole.status, whole.warnings) == ("ok", ())
    assert np.array_equal(whole.log.time, drive.time)
    for name in set(whole.log.columns) - set(INPUTS):
        assert np.array_equal(whole.log[name][inside], part.log[name])
        assert np.isnan(whole.log[name][outside]).all()
    for name in INPUTS:
        assert np.array_equal(whole.log[name], late[name], equal_nan=True)
    assert np.array_equal(whole.sensitivities["theta_1"][inside], part.sensitivities["theta_1"])


def test_a_recording_at_rest_starts_vented_at_its_first_sample_with_inputs_and_anew_after_a_hole(truth, drive, late):
    simulation = simulate(truth, without(late, duty_exhaust=slice(4200, 4230)))
    assert simulation.log["pressure_a"][FIRST] == truth.parameters.P_0
    assert "2 segments" in simulation.warnings[0]
    assert "4.230 s" in simulation.warnings[0]
    assert simulation.log["position"][4230] == drive["position"][4230]
    assert simulation.log["pressure_a"][4230] > 1.1 * truth.parameters.P_0, "in equilibrium with the load"


@pytest.mark.parametrize(
    "gaps", [{"duty_supply": slice(None)}, {"duty_supply": slice(50), "duty_exhaust": slice(50, None)}]
)
def test_inputs_that_are_never_complete_are_refused_in_a_sentence(truth, drive, gaps):
    with pytest.raises(
        DataError, match=r"drive: no sample has both duty cycles, .*; record duty_supply and duty_exhaust"
    ):
        simulate(truth, without(drive, **gaps))


def test_a_single_sample_with_inputs_is_too_few(truth, drive):
    with pytest.raises(DataError, match="no two neighbouring samples have both duty cycles"):
        simulate(truth, without(drive, duty_supply=slice(50), duty_exhaust=slice(51, None)))


def test_a_recording_in_motion_at_its_first_sample_with_inputs_does_not_start_vented(truth, drive):
    moving = int(np.argmax(drive["position"] > 5e-3))
    simulation = simulate(truth, without(drive, duty_supply=slice(moving)))
    assert simulation.log["position"][moving] == drive["position"][moving]
    assert simulation.log["pressure_a"][moving] > 1.1 * truth.parameters.P_0


def test_half_a_second_without_inputs_at_an_end_is_said(truth, drive):
    samples = round(LONG_END / 1e-3)
    (warning,) = simulate(
        truth, without(drive, duty_supply=slice(samples), duty_exhaust=slice(-samples, None))
    ).warnings
    assert warning.startswith("drive: no duty cycles before 0.500 s and after 9.499 s;")
    shorter = without(drive, duty_supply=slice(samples - 1), duty_exhaust=slice(1 - samples, None))
    assert with_inputs(shorter).warnings == ()


def test_a_model_that_diverges_names_the_time_of_the_recording(truth):
    n = 300
    duty = {"duty_supply": np.r_[np.full(100, np.nan), np.ones(n - 100)], "duty_exhaust": np.zeros(n)}
    pulled = truth.replace({"theta_2": -1e12})
    simulation = simulate(pulled, Log(np.arange(n) * 1e-3, duty, "run"), on_failure="return")
    assert "diverged at 0.1" in simulation.message
