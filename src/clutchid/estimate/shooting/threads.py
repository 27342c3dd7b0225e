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


def each(work: Callable[[First, Second], Answer], first: Iterable[First], second: Iterable[Second]) -> list[Answer]:
    """``work(a, b)`` for each pair, in order, on as many threads as linear algebra may take (OMP_NUM_THREADS)."""
    pairs = list(zip(first, second, strict=True))
    threads = min(_threads(), len(pairs))
    if threads < 2:
        return [work(a, b) for a, b in pairs]
    parts = [pairs[len(pairs) * i // threads : len(pairs) * (i + 1) // threads] for i in range(threads)]
    done = _pool(threads).map(lambda part: [work(a, b) for a, b in part], parts)
    return [answer for part in done for answer in part]


def _threads() -> int:
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    return int(allowed) if allowed.isdigit() and int(allowed) > 0 else len(os.sched_getaffinity(0))


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, "clutchid")
