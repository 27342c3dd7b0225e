"""How much more the scores of the blocks of a recording scatter than their information says."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from clutchid.inference.smoother import residuals
from clutchid.inference.smoother.problem import linearise
from clutchid.inference.smoother.residuals import LOAD_FACTOR, dispersion
from clutchid.inference.smoother.search import settled
from clutchid.numerics.least_squares import Solution
from clutchid.simulation.noise import Noise

NAMES = ("C_vs", "C_ve", "tau_y")
RECORDINGS = 8

#: Noise of the position in m as the problem assumes it.
STD = Noise().measured["position"]

#: Neighbours correlate at 9/11, so that (1 + 9/11) / (1 - 9/11) = 10 samples have the information of one.
MEMORY = 9 / 11


@pytest.fixture(scope="module")
def clean(plant, recorded_by):
    return recorded_by(plant, seed=None, driven=1).without("pressure_a")


@pytest.fixture(scope="module")
def dispersion_of(clean, plant, problem_of, starts_of):
    """Dispersion at the true parameters of a recording with errors of the position; the model has none in between."""

    def of(error, names=NAMES):
        log = clean.slice(0, error.size)
        problem = problem_of([log.with_columns(position=log["position"] + error)], plant, names, ("position",))
        states = {name: 0.01 * row.noise for name, row in plant.state_rows.items()}
        problem = replace(problem, noise=Noise(states=states, flow=2e-4, outlier=1e3))
        x, X = np.zeros(len(names)), tuple(starts_of(problem))
        begin = Solution(x, linearise(problem, x, X), "converged", 1)
        return dispersion(problem, settled(problem, begin, x).at)

    return of


@pytest.fixture(scope="module")
def white(clean):
    return [np.random.default_rng(seed).standard_normal(len(clean)) for seed in range(RECORDINGS)]


@pytest.fixture(scope="module")
def of_white(white, dispersion_of):
    return np.mean([dispersion_of(STD * error) for error in white]) / LOAD_FACTOR


@pytest.mark.slow
def test_white_residuals_scatter_as_their_information_says(of_white):
    # A mean over 8 recordings of a mean of squares of 27 numbers of unequal size, the deviation of each is 0.37. It is
    # below 1 as the state at the start of a block is taken from the whole recording, and counted as unknown.
    assert 0.5 < of_white < 1.0 + 3.0 * 0.37 / np.sqrt(RECORDINGS)


@pytest.mark.slow
def test_residuals_with_a_memory_scatter_as_much_more_as_they_have_less_information(white, of_white, dispersion_of):
    coloured = [lfilter([np.sqrt(1.0 - MEMORY**2)], [1.0, -MEMORY], error) for error in white]
    scatter = np.mean([dispersion_of(STD * error) for error in coloured]) / LOAD_FACTOR
    # ten times where the parameters act slowly, as much as the same white noise with ten times the variance
    assert 6.0 < scatter / of_white < 12.0


@pytest.mark.slow
def test_errors_that_repeat_within_a_block_count_by_their_square(clean, white, dispersion_of):
    blocks = np.repeat(np.where(np.arange(10) % 2, 1.0, -1.0), len(clean) // 10)
    small, large = (dispersion_of(by * STD * blocks) for by in (1.0, 2.0))
    assert large == pytest.approx(4.0 * small, rel=0.05), "slightly less where the model is not linear"
    # the white noise of the same size is a hundredth of that of a mean over the 100 samples of a window and more
    assert small > 5.0 * dispersion_of(STD * white[0])


def test_where_nothing_is_determined_or_there_is_one_block_it_is_1(clean, white, dispersion_of):
    assert dispersion_of(STD * white[0][:3000], ("K_stop",)) == 1.0, "the stop is not reached"
    assert dispersion_of(STD * white[0][:90]) == 1.0


def test_few_blocks_of_white_residuals_scatter_as_their_information_says_in_the_mean(monkeypatch):
    """The mean score is that of the blocks themselves, which takes a degree of freedom: of four, a quarter."""
    rng, blocks, draws = np.random.default_rng(2), 4, 400
    rows = rng.standard_normal((6, 3))
    white = rng.standard_normal((draws, blocks, 6, 1))
    factors = iter([[np.hstack([rows, error]) for error in drawn] for drawn in white])
    monkeypatch.setattr(residuals, "_block_factors", lambda *_: next(factors))
    scatter = [dispersion(None, SimpleNamespace(chains=[None])) / LOAD_FACTOR for _ in range(draws)]
    # each is a mean of 9 squares; three deviations of their mean
    assert np.mean(scatter) == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / 9.0 / draws))
