"""Part (g): the same recording read from the same file, by clutchid and by the package that has the format."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from peer import FloatArray, Peer, Result, Row, compare
from problem import Problem

from clutchid import Log, read, write

NAMES = ("position", "duty_supply", "duty_exhaust", "pressure_a")


class File(NamedTuple):
    """A file and the recording that is in it."""

    path: Path
    log: Log


def made(seconds: float, ending: str) -> File:
    """A recording of the paper's actuator at 1 kHz as a file."""
    problem = Problem(seconds)
    d, states = problem.drive, problem.reference
    values = states[:, 0], d.u[:, 0], d.u[:, 1], states[:, 2]
    log = Log(problem.time, dict(zip(NAMES, values, strict=True)))
    path = Path(tempfile.mkdtemp()) / f"recording.{ending}"
    write(log, path)
    return File(path, log)


def clutchid(file: File) -> Callable[[], Result]:
    """`clutchid.read`: finds the format, channels and units, and checks time and values."""

    def run() -> Result:
        log = read(file.path)
        return Result(tuple(log[name] for name in NAMES))

    return run


def alone(file: File, package: str) -> Callable[[], Result]:
    """The columns as arrays, by a package that is given their names."""

    def asammdf() -> Result:
        import asammdf

        with asammdf.MDF(file.path) as mdf:
            return Result(tuple(signal.samples for signal in mdf.select(list(NAMES))))

    def polars() -> Result:
        import polars

        frame = polars.read_csv(file.path) if file.path.suffix == ".csv" else polars.read_parquet(file.path)
        return Result(tuple(_column(frame.columns, name, frame.__getitem__).to_numpy() for name in NAMES))

    def scipy() -> Result:
        from scipy.io import loadmat

        content = loadmat(file.path, squeeze_me=True)
        return Result(tuple(np.asarray(_column(list(content), name, content.__getitem__)) for name in NAMES))

    return {"asammdf": asammdf, "polars": polars, "scipy": scipy}[package]


def _column(names: list[str], name: str, taken: Callable[[str], object]) -> object:
    """The column whose name begins with `name`; a unit may follow."""
    return taken(next(column for column in names if column.startswith(name)))


def error(file: File, values: FloatArray | tuple[FloatArray, ...]) -> str:
    """Largest relative difference of a column."""
    pairs = zip(values, (file.log[name] for name in NAMES), strict=True)
    return f"{max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs):.1g} of the largest value"


#: Packages by the ending of their files.
ENDINGS = {"mf4": "asammdf", "mat": "scipy", "csv": "polars", "parquet": "polars"}


def rows(seconds: float = 600.0, rounds: int = 15, budget: float = 10.0) -> list[Row]:
    """The rows of all formats."""
    rows_of_files = []
    for ending, package in ENDINGS.items():
        peers = (
            Peer("clutchid.read", (package,), clutchid),
            Peer(f"{package} alone", (package,), partial(alone, package=package)),
        )
        file = made(seconds, ending)
        case = f".{ending}, {seconds:g} s at 1000 Hz, {file.path.stat().st_size / 1e6:.3g} MB"
        rows_of_files += compare("g", case, peers, lambda _, file=file: file, seconds, error, rounds, budget)
    return rows_of_files
