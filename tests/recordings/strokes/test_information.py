"""The Gram matrix of a stroke: where, which way and how fast the piston moved, and for how long."""

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.recordings.strokes import Section, SectionSummary
from clutchid.recordings.strokes.choice import HATS, SIZE, gram

REACH = 0.02


def moved(speed: float, start: float, stop: float, vented_rest: float = 1.0, level: float = 0.0) -> Section:
    """A stroke that goes straight from a start to a stop in m above the level, at a speed in m/s."""
    t = np.arange(10 * round(abs(stop - start) / speed * 1e2)) * 1e-3  # whole bins of 10 ms
    log = Log(t, {"position": level + start + np.sign(stop - start) * speed * t})
    low, high = sorted((start, stop))
    found = SectionSummary(level + low, level + high, level, REACH, speed, 0.0, vented_rest, 0, 0, 0, 0.0, False)
    return Section("stroke", "ramp", log, 0.0, float(t[-1]), 0.0, 0, found)


def blocks(G: np.ndarray) -> np.ndarray:
    """Seconds in each block: the hats add up to one everywhere, so a block's entries add up to the time in it."""
    return np.array([G[HATS * k : HATS * (k + 1), HATS * k : HATS * (k + 1)].sum() for k in range(4)])


@pytest.mark.parametrize(
    ("speed", "start", "stop", "block"),
    [
        (0.01, 0.0, REACH, 0),
        (0.10, 0.0, REACH, 1),
        (0.01, REACH, 0.0, 2),
        (0.10, REACH, 0.0, 3),
        (0.019, 0.0, REACH, 0),  # a reach a second divides slow from fast
        (0.021, 0.0, REACH, 1),
    ],
)
def test_time_counts_in_the_block_of_its_direction_and_pace(speed, start, stop, block):
    seconds = abs(stop - start) / speed
    found = blocks(gram(moved(speed, start, stop), REACH))
    # a speed needs 20 ms before and after, the last bin ends with its last sample
    assert found[block] == pytest.approx(seconds - 0.04, abs=0.006)
    assert found.sum() == pytest.approx(found[block], rel=1e-12)


def test_a_piston_that_creeps_slower_than_a_twentieth_of_its_reach_a_second_counts_as_standing():
    assert blocks(gram(moved(0.9e-3, 0.005, 0.006), REACH)).sum() == 0.0
    assert blocks(gram(moved(1.1e-3, 0.005, 0.006), REACH)).sum() > 0.8


def test_time_is_shared_between_the_two_hats_around_the_position_above_the_level():
    # from hat 2 to hat 3 of eleven: at u of the way the two get (1 - u)^2, u (1 - u) and u^2
    section = moved(0.002, 0.2 * REACH, 0.3 * REACH, level=5e-3)
    G = gram(section, REACH)
    used = np.flatnonzero(G[:-1, :-1].any(axis=1)).tolist()
    assert used == [2, 3]
    seconds = G[2:4, 2:4].sum()
    # each mean over an even way, but for the 20 ms at its ends and the bins of 10 ms: 3 % of a second
    np.testing.assert_allclose(G[2:4, 2:4] / seconds, [[1 / 3, 1 / 6], [1 / 6, 1 / 3]], atol=0.01)


def test_without_a_vented_rest_before_it_a_stroke_counts_by_half_and_has_no_anchor():
    anchored, cold = (gram(moved(0.01, 0.0, REACH, vented), REACH) for vented in (0.3, 0.0))
    np.testing.assert_allclose(cold[:-1, :-1], 0.5 * anchored[:-1, :-1], rtol=1e-12)
    assert (anchored[-1, -1], cold[-1, -1]) == (0.3, 0.0)
    assert gram(moved(0.01, 0.0, REACH, 100.0), REACH)[-1, -1] == 0.5


def test_the_matrix_is_one_of_a_quadratic_form():
    G = gram(moved(0.013, 0.0, REACH), REACH)
    assert G.shape == (SIZE, SIZE)
    assert np.array_equal(G, G.T)
    # its least eigenvalue is 0 but for the rounding of a matrix of 45 rows of size 1
    assert np.linalg.eigvalsh(G).min() > -45 * 2.3e-16 * 2
