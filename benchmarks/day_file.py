"""A day's recording read from a file, cut, and fitted: ``python benchmarks/day_file.py [--format mf4] [--hours 24]``.

A virtual truck drives for an hour at 1 kHz, and the file repeats that hour. `clutchid cut` then chooses the strokes
that tell most, and `clutchid fit` fits them; both are processes of their own, whose time and highest memory, that of
the reader process with it, are printed. Formats: csv and mf4.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil

from clutchid.log import COLUMNS, Log

PIECE = 600_000


def hours(count: float, truck: int) -> Iterator[Log]:
    """An hour of a truck's driving, again and again, in pieces of ten minutes."""
    from clutchid import truck as virtual

    log = virtual.drive(virtual.truck(truck), manoeuvre="mix", seconds=3600, seed=1, name="day").log
    for start in range(0, round(count * 3_600_000), PIECE):
        first = start % len(log)
        piece = log.slice(first, min(first + PIECE, len(log)))
        yield Log((start + np.arange(len(piece))) / 1000, piece.columns, "day")


def write_csv(pieces: Iterator[Log], path: Path) -> None:
    """A CSV, piece by piece."""
    from clutchid.measurements.source import to_frame

    with path.open("wb") as file:
        for number, piece in enumerate(pieces):
            to_frame(piece).write_csv(file, include_header=number == 0)


def write_mf4(pieces: Iterator[Log], path: Path) -> None:
    """An MDF with deflated data, piece by piece, as a logger writes it."""
    import asammdf

    with asammdf.MDF(version="4.10") as mdf:
        for number, piece in enumerate(pieces):
            if number == 0:
                signals = [asammdf.Signal(v, piece.time, unit=COLUMNS[n], name=n) for n, v in piece.columns.items()]
                mdf.append(signals, common_timebase=True)
            else:
                mdf.extend(0, [(values, None) for values in (piece.time, *piece.columns.values())])
        mdf.save(path, compression=2, overwrite=True)


def made(kind: str, count: float, truck: int, path: Path) -> None:
    """Write the day."""
    (write_csv if kind == "csv" else write_mf4)(hours(count, truck), path)


def measured(*arguments: str) -> str:
    """Run a command of clutchid; its time and highest memory in words."""
    begun = time.monotonic()
    command = [sys.executable, "-c", "from clutchid.cli import main; main()", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    peaks: list[int] = []
    watch = threading.Thread(target=watched, args=(process.pid, peaks))
    watch.start()
    said = process.stdout.read().strip().splitlines()
    process.wait()
    watch.join()
    return (
        f"{arguments[0]}: exit {process.returncode}, {time.monotonic() - begun:.1f} s, "
        f"peak {max(peaks) / 1e9:.2f} GB with its reader process | {said[0] if said else ''}"
    )


def watched(pid: int, peaks: list[int]) -> None:
    """Append the memory in bytes of a process with all its children, until it ends."""
    with contextlib.suppress(psutil.NoSuchProcess):
        parent = psutil.Process(pid)
        while parent.status() != psutil.STATUS_ZOMBIE:
            with contextlib.suppress(psutil.NoSuchProcess):  # a reader process that has just ended
                peaks.append(sum(process.memory_info().rss for process in (parent, *parent.children(recursive=True))))
            time.sleep(0.05)


def main() -> None:
    """Write the day, cut it, fit what was chosen."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--format", choices=("csv", "mf4"), default="mf4")
    options.add_argument("--hours", type=float, default=24.0)
    options.add_argument("--truck", type=int, default=3)
    options.add_argument("--seconds", type=float, default=30.0, help="length of what is chosen")
    asked = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        day, best, table = (Path(folder) / name for name in (f"day.{asked.format}", "best.parquet", "strokes.csv"))
        # in a process of its own, whose memory would else be counted as that of the commands
        writer = multiprocessing.get_context("spawn").Process(
            target=made, args=(asked.format, asked.hours, asked.truck, day)
        )
        writer.start()
        writer.join()
        print(f"{asked.hours:g} h at 1 kHz as {asked.format}: {day.stat().st_size / 1e9:.2f} GB", flush=True)
        print(measured("cut", str(day), "--out", str(best), "--table", str(table), "--seconds", str(asked.seconds)))
        with table.open() as lines:
            print(f"{sum(1 for _ in lines) - 1:,} sections")
        print(measured("fit", str(best)))


if __name__ == "__main__":
    main()
