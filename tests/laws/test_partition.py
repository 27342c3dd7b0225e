"""Laws of the resets: where a part starts, and what is left of a measurement that says the same as the simulation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clutchid.errors import ParameterError
from clutchid.simulation import Partition, simulate
from fixtures.cases import case_tables

CASES = case_tables(__file__, "test_partition")


@given(st.integers(1, 500), st.integers(1, 5000))
def test_every_nth_sample_is_a_reset_but_the_first(every, n):
    resets = Partition(every=every).resets(n)
    assert resets.tolist() == [k for k in range(1, n) if k % every == 0]


@given(st.integers(1, 200), st.integers(1, 5000))
def test_parts_are_equal_to_a_sample_and_their_number_is_kept(parts, n):
    resets = Partition(parts=parts).resets(n)
    assert np.abs(resets - np.arange(1, resets.size + 1) * n / min(parts, n)).max(initial=0.0) <= 0.5 * (1 + 1e-12)
    lengths = np.diff([0, *resets, n])
    assert lengths.sum() == n
    assert resets.size == min(parts, n) - 1
    if parts <= n:
        assert lengths.max() - lengths.min() <= 1


@pytest.mark.parametrize(("wrong", "words"), CASES["a_partition_that_is_none_is_refused_in_words"])
def test_a_partition_that_is_none_is_refused_in_words(wrong, words):
    with pytest.raises(ParameterError, match=words):
        Partition(**wrong)


@pytest.mark.parametrize("partition", [Partition(parts=1), Partition(every=10**6), Partition(parts=1, carry="q")])
def test_one_part_is_the_ballistic_simulation_exactly(truth, drive, partition):
    ballistic = simulate(truth, drive, sensitivities=("theta_1", "C_vs"))
    whole = simulate(truth, drive, partition=partition, sensitivities=("theta_1", "C_vs"))
    for name in ("position", "velocity", "pressure_a", "pressure_b", "deflection"):
        assert np.array_equal(ballistic.log[name], whole.log[name])
    for name in ("theta_1", "C_vs"):
        assert np.array_equal(ballistic.sensitivities[name], whole.sensitivities[name])


@pytest.mark.parametrize("carry", ["p", "q"])
def test_resetting_to_what_is_simulated_anyway_changes_nothing(truth, drive, carry):
    never = Partition(every=len(drive), carry=carry)  # the same steps, shorter with q, and no reset
    ballistic = simulate(truth, drive, partition=never).log
    same = drive.with_columns(position=ballistic["position"])
    reset = simulate(truth, same, partition=Partition(every=20, carry=carry)).log
    # 500 resets, each with the rounding of a position of 15 mm and a quotient of volumes
    assert np.abs(ballistic["position"] - reset["position"]).max() < 500 * 4 * 2.3e-16 * 15e-3
