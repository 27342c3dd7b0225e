"""The tables of the recordings of a fleet: results, times and loads."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clutchid.fleets.jobs import Fleet, Job
from clutchid.fleets.reading import Read, counted_as, without_file
from clutchid.fleets.store import Kept, Store
from clutchid.recordings.files import make_folder, write_frame
from clutchid.wear.life import Curve
from clutchid.wear.measurement import Reading

if TYPE_CHECKING:
    import polars as pl

#: Files of a run, beside the store.
RESULTS, TIMINGS, CURVES = "results.parquet", "timings.parquet", "curves"

#: Recordings in one file of loads.
PART = 1000


class Row(NamedTuple):
    """A recording of a fleet with its result."""

    job: Job
    read: Read
    seconds: float


def rows_of(fleet: Fleet, kept: Store) -> Iterator[Row]:
    """Every recording of a fleet in the order of vehicle and name; one that was sent twice counts once."""
    done, first = _merged(fleet.jobs, kept.results()), dict[str, Job]()
    for job, result in done:
        if result is None:
            yield Row(job, _without_result(job), float("nan"))
            continue
        read = result.read
        other = first.setdefault(read.sha256, job) if read.sha256 and read.reading.has_result else job
        if other is not job:
            read = counted_as(read, f"{other.recording} of {other.vehicle}")
        yield Row(job, read, result.seconds)


def _without_result(job: Job) -> Read:
    if job.path is None:
        return without_file(job.recording)
    message = job.problem or "was not read; run the same command again to go on."
    return Read(job.path, Reading("bad_input" if job.problem else "failed", message, "none", None))


def _merged(jobs: Iterable[Job], results: Iterator[Kept]) -> Iterator[tuple[Job, Kept | None]]:
    """Jobs with their results, both in the same order; results of recordings that are gone are passed over."""
    following = next(results, None)
    for job in jobs:
        key = job.vehicle, job.recording
        while following is not None and (following.vehicle, following.recording) < key:
            following = next(results, None)
        same = following is not None and (following.vehicle, following.recording) == key
        yield job, following if same and not job.problem else None


def write_results(fleet: Fleet, kept: Store, out: Path) -> Counter[str]:
    """Write results, times and loads of all recordings; how many there are by status.

    Raises
    ------
    ExportError
        If a file cannot be written; an existing one is then unchanged.
    """
    import polars as pl

    statuses: Counter[str] = Counter()
    results: list[Mapping[str, object]] = []
    timings: list[tuple[str, str, float]] = []
    make_folder(out / CURVES)
    rows, part = rows_of(fleet, kept), 0
    while some := list(islice(rows, PART)):
        statuses.update(row.read.reading.status for row in some)
        results += map(_result, some)
        timings += [(row.job.recording, row.job.vehicle, row.seconds) for row in some]
        write_frame(_curves(some), out / CURVES / f"part-{part:05d}.parquet")
        part += 1
    for old in sorted((out / CURVES).glob("part-*.parquet"))[part:]:
        old.unlink()
    write_frame(
        pl.DataFrame(results, schema_overrides=dict.fromkeys(_TEXT, pl.String), infer_schema_length=None), out / RESULTS
    )
    write_frame(pl.DataFrame(timings, ["recording", "vehicle", "seconds"], orient="row"), out / TIMINGS)
    return statuses


#: Columns of text that may be empty throughout.
_TEXT = ("changes", "sha256", "message", "reason")


def _result(row: Row) -> Mapping[str, object]:
    read, nothing = row.read, (float("nan"),) * 3
    peak = _peak(read.curve) if read.curve else nothing
    half = tuple(1e3 * value for value in read.half_load)
    measured = read.reading.measurement
    shift, load = (measured[0:2], measured[2:4]) if measured else (nothing, nothing)
    return {
        "recording": row.job.recording, "vehicle": row.job.vehicle, "type": row.job.type,
        "status": read.reading.status, "message": read.reading.message, "trust": read.reading.trust,
        "peak_N": peak[0], "peak_low_N": peak[1], "peak_high_N": peak[2],
        "half_load_mm": half[0], "half_load_low_mm": half[1], "half_load_high_mm": half[2],
        "shift_mm": 1e3 * shift[0], "shift_std_mm": 1e3 * shift[1],
        "load_change": load[0], "load_change_std": load[1],
        "temperature_K": measured.temperature if measured else float("nan"),
        "changes": ", ".join(read.changes), "sha256": read.sha256, "reason": read.reading.unmeasured,
    }  # fmt: skip


def _peak(curve: Curve) -> tuple[float, float, float]:
    """Largest load in N, with the band there."""
    if not np.isfinite(curve.force).any():
        return (float("nan"),) * 3
    at = int(np.nanargmax(curve.force))
    return float(curve.force[at]), float(curve.low[at]), float(curve.high[at])


def _curves(rows: Iterable[Row]) -> pl.DataFrame:
    import polars as pl

    known = [(row.job, row.read.curve) for row in rows if row.read.curve is not None]
    values = np.concatenate([np.column_stack(curve) for _, curve in known]) if known else np.zeros((0, 4))
    named = {
        what: pl.Series(
            [getattr(job, what) for job, curve in known for _ in range(curve.position.size)], dtype=pl.String
        )
        for what in ("recording", "vehicle")
    }
    heads = ("position [m]", "force [N]", "force low [N]", "force high [N]")
    return pl.DataFrame({**named, **dict(zip(heads, values.T, strict=True))})
