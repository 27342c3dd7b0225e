"""A peer, the runs of all peers in turn, and the rows that come out."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Result(NamedTuple):
    """What a run gives; `seconds` where the peer measures itself, because it is a process of its own."""

    value: FloatArray | tuple[FloatArray, ...]
    seconds: float | None = None


class Peer(NamedTuple):
    """Something a user would take instead.

    `needs` are modules, programs, and packages of Octave; `prepare` takes a problem and returns the run that is timed,
    so that compiling is not timed with it. A problem longer than `longest` s is shortened to that, and its time scaled.
    """

    name: str
    needs: tuple[str, ...]
    prepare: Callable[[Any], Callable[[], Result]]
    longest: float = np.inf

    def missing(self) -> list[str]:
        """Those of `needs` that are not installed."""
        return [name for name in self.needs if not installed(name)]


@cache
def installed(name: str) -> bool:
    """Whether a module, a program or, as `octave-NAME`, a package of Octave is on this machine."""
    package = name.removeprefix("octave-")
    if package not in (name, "cli"):
        if shutil.which("octave-cli") is None:
            return False
        load = ["octave-cli", "--norc", "--quiet", "--eval", f"pkg load {package}"]
        return subprocess.run(load, check=False, capture_output=True).returncode == 0
    return importlib.util.find_spec(name) is not None or shutil.which(name) is not None


class Row(NamedTuple):
    """A line of the table: seconds, quartiles and runs; `ratio` is the time over that of the first peer, by round.

    `more` are further times in s, for which the part has titles.
    """

    part: str
    case: str
    peer: str
    median: float = np.nan
    low: float = np.nan
    high: float = np.nan
    runs: int = 0
    ratio: float = np.nan
    prepared: float = np.nan
    error: str = ""
    note: str = ""
    more: tuple[float, ...] = ()


#: Runs of a turn, and s after which there is no further one.
REPEATS, ENOUGH = 5, 0.1


def least_seconds(run: Callable[[], Result]) -> float:
    """The least of up to `REPEATS` runs: where a machine is shared, a run after a long one may have to wait."""
    times: list[float] = []
    while len(times) < REPEATS and sum(times) < ENOUGH:
        begin = time.perf_counter()
        inside = run().seconds
        times.append(time.perf_counter() - begin if inside is None else inside)
    return min(times)


def compare(
    part: str,
    case: str,
    peers: Sequence[Peer],
    problem: Callable[[float], Any],
    seconds: float,
    error: Callable[[Any, FloatArray], str],
    rounds: int = 15,
    budget: float = 12.0,
) -> list[Row]:
    """Rows of all peers, run in turn round after round, so that what else the machine does hits them alike.

    Parameters
    ----------
    part, case
        Names for the rows.
    peers
        The first is that to which the others are compared.
    problem
        The problem of a length in s.
    seconds : s
        The length that is asked for.
    error
        The error of a value, in words.
    rounds
        Of every peer; a peer that has used `budget` s takes part in no further round.
    """
    rows, ready = {}, []
    for peer in peers:
        if lacking := peer.missing():
            rows[peer.name] = Row(part, case, peer.name, note=f"absent: {', '.join(lacking)} not installed")
            continue
        length = min(seconds, peer.longest)
        own = problem(length)
        begin = time.perf_counter()
        try:
            run = peer.prepare(own)
            value = run().value
        except Exception as failure:  # a peer that fails is a row, not the end of the others
            rows[peer.name] = Row(part, case, peer.name, note=f"failed: {type(failure).__name__}: {failure}"[:200])
            continue
        prepared = time.perf_counter() - begin
        note = f"timed on {length:g} s and scaled" if length < seconds else ""
        rows[peer.name] = Row(part, case, peer.name, prepared=prepared, error=error(own, value), note=note)
        ready.append((peer, run, seconds / length))
    times: dict[str, list[float]] = {peer.name: [] for peer, _, _ in ready}
    for _ in range(rounds):
        for peer, run, scale in ready:
            if sum(times[peer.name]) / scale < budget:
                times[peer.name].append(least_seconds(run) * scale)
    for name, durations in times.items():
        low, middle, high = np.quantile(durations, [0.25, 0.5, 0.75])
        ratio = float(np.median([a / b for a, b in zip(durations, times[ready[0][0].name], strict=False)]))
        rows[name] = rows[name]._replace(median=middle, low=low, high=high, runs=len(durations), ratio=ratio)
    return [rows[peer.name] for peer in peers]
