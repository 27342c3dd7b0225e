"""Windows are simulated side by side: the kernels and the linear algebra leave Python's lock."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

First = TypeVar("First")
Second = TypeVar("Second")
Answer = TypeVar("Answer")

#: Each thread takes this many parts of the work one after another, of so many pieces at least: windows differ in what
#: they cost, and to hand over a part takes as long as to simulate a window.
PARTS, LEAST = 4, 4


def each(work: Callable[[First, Second], Answer], first: Iterable[First], second: Iterable[Second]) -> list[Answer]:
    """``work(a, b)`` for each pair, in order, on as many threads as linear algebra may take (OMP_NUM_THREADS)."""
    pairs = list(zip(first, second, strict=True))
    threads, count = _threads(), len(pairs) // LEAST
    if min(threads, count) < 2:
        return [work(a, b) for a, b in pairs]
    count = min(PARTS * threads, count)
    parts = [pairs[len(pairs) * i // count : len(pairs) * (i + 1) // count] for i in range(count)]
    done = _pool(threads).map(lambda part: [work(a, b) for a, b in part], parts)
    return [answer for part in done for answer in part]


def _threads() -> int:
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    return int(allowed) if allowed.isdigit() and int(allowed) > 0 else len(os.sched_getaffinity(0))


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, "clutchid")
