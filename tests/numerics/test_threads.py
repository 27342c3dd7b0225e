"""Work that is done side by side: in order, and on no more threads than are allowed."""

import threading

import pytest

from clutchid.numerics.threads import MIN_PAIRS_PER_PART, map_pairs


@pytest.mark.parametrize("threads", ["1", "2", "3"])
@pytest.mark.parametrize("count", [0, 1, 2 * MIN_PAIRS_PER_PART, 101])
def test_answers_come_in_the_order_of_the_pieces_whatever_the_number_of_threads(monkeypatch, threads, count):
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    numbers = list(range(count))
    assert map_pairs(lambda a, b: (a, b), numbers, numbers[::-1]) == list(zip(numbers, numbers[::-1], strict=True))


def test_pieces_are_shared_out_and_a_few_stay_where_they_are(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    here, both = threading.get_ident(), threading.Barrier(2, timeout=30)

    def on_two(number, _):
        # the first piece of the first two parts waits for the other: one thread alone would never go on
        if number in (0, 8 * MIN_PAIRS_PER_PART // 8):
            both.wait()
        return threading.get_ident()

    pieces = list(range(8 * MIN_PAIRS_PER_PART))
    assert here not in map_pairs(on_two, pieces, pieces)
    few = pieces[: 2 * MIN_PAIRS_PER_PART - 1]
    assert map_pairs(lambda *_: threading.get_ident(), few, few) == [here] * len(few)
