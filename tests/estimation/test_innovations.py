"""Innovations of an observer against chi-square, and their colour."""

from dataclasses import replace

import numpy as np
import pytest

from clutchid.documents.innovations import innovation_blocks, innovation_figure
from clutchid.estimation.assess.innovations import chi_square_bounds, innovation_statistics
from clutchid.observer import observe_recording, observer


@pytest.fixture(scope="module")
def run(plant, recorded_by):
    return observe_recording(observer(plant), recorded_by(plant, seconds=6.0))


def with_innovations(run, values):
    """The run with these innovations of variance 1 at every correction."""
    corrected = np.isfinite(run.samples.innovations[:, 0])
    innovations = np.full_like(run.samples.innovations, np.nan)
    innovations[corrected] = np.column_stack([values[: corrected.sum()], np.ones(corrected.sum())])
    return replace(run, samples=run.samples._replace(innovations=innovations))


def test_means_of_squares_of_normal_numbers_lie_within_their_bounds_in_19_of_20_cases():
    for count in (5, 50):
        means = np.mean(np.random.default_rng(count).standard_normal((20_000, count)) ** 2, axis=1)
        low, high = chi_square_bounds(np.array([float(count)]))
        # four standard deviations of a share of 20,000
        assert np.mean((means > low) & (means < high)) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / 20_000))


def test_white_innovations_are_white_and_have_a_nis_of_one(run):
    statistics = innovation_statistics(with_innovations(run, np.random.default_rng(2).standard_normal(600)))
    assert (
        statistics.moving.corrections + statistics.resting.corrections
        == np.isfinite(run.samples.innovations[:, 0]).sum()
    )
    for mean in (statistics.moving, statistics.resting):
        assert mean.low < mean.mean < mean.high
    assert statistics.colour.share_outside < 0.2
    assert statistics.colour.interval == pytest.approx(0.01)


def test_innovations_that_follow_a_valve_are_correlated_with_it(run):
    """The valve has a random duty cycle for every 10 ms, from one correction to the next."""
    random = np.random.default_rng(3)
    duty = random.uniform(size=600)
    log = run.log.with_columns(duty_supply=np.roll(np.repeat(duty, 10), 1))
    late = np.append(np.zeros(3), duty[:-3] - 0.5)  # the first interval ends with the second correction
    statistics = innovation_statistics(
        replace(with_innovations(run, late + 0.1 * random.standard_normal(600)), log=log)
    )
    crossed = statistics.colour.inputs["duty_supply"]
    assert crossed.strongest_lag == pytest.approx(0.02)
    assert crossed.strongest > 3 * crossed.strongest_bound


def test_innovations_three_times_as_large_have_nine_times_the_nis(run):
    values = np.random.default_rng(4).standard_normal(600)
    halved, tripled = (innovation_statistics(with_innovations(run, factor * values)) for factor in (0.5, 1.5))
    assert tripled.resting.mean == pytest.approx(9 * halved.resting.mean, rel=0.05)  # but for those beyond the outliers


def test_the_nis_is_drawn_with_its_bounds_over_the_whole_recording(run):
    statistics = innovation_statistics(run)
    nis = innovation_figure(statistics).axes[0]
    assert nis.lines[0].get_ydata() == pytest.approx(statistics.nis)
    assert nis.get_ylim()[1] > max(statistics.nis.max(), statistics.high.max())
    text, _ = innovation_blocks("log", statistics)
    assert f"in {statistics.moving.corrections:,d} corrections" in text.text


def test_without_a_correction_there_is_nothing_to_say(run):
    none = innovation_statistics(with_innovations(run, np.full(600, np.nan)))
    assert (none.moving.corrections, none.resting.corrections) == (0, 0)
    assert innovation_blocks("log", none) == ()
