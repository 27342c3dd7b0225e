"""Parallel map on threads: the kernels and the linear algebra release Python's lock."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

from clutchid.systems import processors

First = TypeVar("First")
Second = TypeVar("Second")
_Answer = TypeVar("_Answer")

#: Number of parts per thread, and fewest pairs in a part. Several parts balance pieces of different cost; very small
#: ones do not pay, because the transfer of a part takes as long as the simulation of a window.
_PARTS_PER_THREAD, MIN_PAIRS_PER_PART = 4, 4


def map_pairs(
    work: Callable[[First, Second], _Answer],
    first: Iterable[First],
    second: Iterable[Second],
    smallest: int = MIN_PAIRS_PER_PART,
) -> list[_Answer]:
    """``work(a, b)`` for each pair, in order, on as many threads as linear algebra may use (OMP_NUM_THREADS).

    A thread is given at least `smallest` pairs at once.
    """
    pairs = list(zip(first, second, strict=True))
    threads, count = _threads(), len(pairs) // smallest
    if min(threads, count) < 2:
        return [work(a, b) for a, b in pairs]
    count = min(_PARTS_PER_THREAD * threads, count)
    parts = [pairs[len(pairs) * i // count : len(pairs) * (i + 1) // count] for i in range(count)]
    answers = _pool(threads).map(lambda part: [work(a, b) for a, b in part], parts)
    return [answer for part in answers for answer in part]


def _threads() -> int:
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    return int(allowed) if allowed.isdigit() and int(allowed) > 0 else processors()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, "clutchid")
