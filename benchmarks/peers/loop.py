"""A user's loop over recordings, a process of its own: ``python loop.py KIND PREPARED FOLDER WORKERS OUT``.

A pool of `multiprocessing` estimates the load weights of every CSV file below FOLDER and writes them as JSON. What the
estimation needs was prepared by `recordings.py`, so that only the kinds that use clutchid import it. An error of a
recording is caught and written in its place.
"""

from __future__ import annotations

import json
import pickle
import sys
import time
from collections.abc import Callable
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import numpy as np
from plain import FloatArray, casadi_search, scipy_position, searched

#: The paper's weights, from which every search starts, N/m.
START = (9e5, 0.0, 0.0)

Recording = Callable[[Path], FloatArray]


def read(path: Path) -> dict[str, FloatArray]:
    """Columns of a file by polars, by the first word of their names; all of them, although only one is fitted."""
    import polars

    return {column.name.partition(" ")[0]: column.to_numpy() for column in polars.read_csv(path)}


def of_file(estimate: Callable[[FloatArray, FloatArray], FloatArray]) -> Recording:
    """The estimation of a file by a search on its position."""
    return lambda path: estimate(read(path)["position"], np.array(START))


def casadi(prepared: dict[str, Any]) -> Recording:
    """`least_squares` on CasADi's C."""
    return of_file(casadi_search(prepared["noise"], *prepared["libraries"]))


def scipy(prepared: dict[str, Any]) -> Recording:
    """`least_squares` with differences on SciPy's LSODA."""
    return of_file(searched(prepared["noise"], scipy_position(prepared["text"], prepared["given"], "LSODA")))


def clutchid(prepared: dict[str, Any]) -> Recording:
    """`clutchid.read` and `clutchid.fit`."""
    import clutchid

    del prepared

    def weights(path: Path) -> FloatArray:
        estimates = clutchid.fit(clutchid.read(path), free="load").parameters
        return np.array([estimates[name].value for name in clutchid.Load().names])

    return weights


KINDS = {way.__name__: way for way in (casadi, scipy, clutchid)}


class Worker:
    """What a worker keeps from recording to recording."""

    estimate: Recording


def begin(kind: str, prepared: str) -> None:
    """In a new worker: make ready."""
    Worker.estimate = KINDS[kind](pickle.loads(Path(prepared).read_bytes()))


def estimated(path: Path) -> dict[str, Any]:
    """The weights of a recording, or why there are none, and the seconds that it took."""
    start, theta, failure = time.perf_counter(), np.full(3, np.nan), ""
    try:
        theta = Worker.estimate(path)
    except Exception as error:
        failure = f"{type(error).__name__}: {error}"
    return {"name": path.stem, "theta": theta.tolist(), "failure": failure, "seconds": time.perf_counter() - start}


def main(kind: str, prepared: str, folder: str, workers: str, out: str) -> None:
    """Estimate all, and write what came of it."""
    paths = sorted(Path(folder).rglob("*.csv"))
    with Pool(int(workers), begin, (kind, prepared)) as pool:
        outcomes = list(pool.imap_unordered(estimated, paths))
    Path(out).write_text(json.dumps(outcomes), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
