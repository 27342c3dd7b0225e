"""Track the wear of one clutch: from recordings to its life, and the files of the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from clutchid import processes
from clutchid.arguments import checked
from clutchid.documents.results import WornClutch
from clutchid.errors import DataError
from clutchid.files import not_an_address, write_frame
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.messages import listed
from clutchid.names import as_text
from clutchid.processes import check_workers
from clutchid.strokes.vented_rest import Zero
from clutchid.verbs.folders import (
    FolderContent,
    files_by_name,
    folder_content,
    left_out,
    name_in,
    name_of,
    no_recordings,
)
from clutchid.verbs.reading import Reading
from clutchid.verbs.saving import loads_path
from clutchid.verbs.start import content_of
from clutchid.verbs.wear_reading import counted_once, read_recording, unless_lost
from clutchid.wear.columns import LOAD_COLUMNS, METADATA, NUMBER_COLUMNS, SIDES, TEXT_COLUMNS, banded, reading_columns
from clutchid.wear.history import RecordingJob, WearReading
from clutchid.wear.life import LifeLimits, LifeRow, Wear, to_estimate, wear_of
from clutchid.wear.tables import read_table, read_wear_table
from clutchid.wear.trend import LIFE

if TYPE_CHECKING:
    import polars as pl

#: Suffix of a table of wear beside the calibration of its type.
WEAR_TABLE = ".wear.csv"

#: Problem of a row of a table where files are named one by one.
_NOT_NAMED = "the table names it, but it is not among the recordings of this command."


def recordings_of(
    sources: Sequence[Path], rows: Mapping[str, RecordingJob] = MappingProxyType({}), apart: Sequence[Path] = ()
) -> tuple[list[RecordingJob], str]:
    """The recordings: files as they are, and of a folder all files below it that can be recordings or `rows` name.

    They come with a sentence about what folders hold beside them; rows without a file have a problem.

    Parameters
    ----------
    apart
        Files that are no recordings: tables, and what an earlier run may have left in the folder.

    Raises
    ------
    DataError
        If there is none, one is not there, or two have the same name.
    """
    for source in sources:
        not_an_address(source)
        if not source.exists():
            raise DataError(f"{source}: there is no such file or folder.")
    left = {path.resolve() for path in apart}
    contents = [folder_content(source, left) for source in sources if source.is_dir()]
    whole = FolderContent(
        tuple(path for content in contents for path in content.recordings),
        tuple(path for content in contents for path in content.others),
        sum(content.results for content in contents),
    )
    paths = [*(source for source in sources if not source.is_dir()), *whole.recordings]
    names: dict[str, Path] = {}
    for path in paths:
        other = names.setdefault(name_in(rows, path) or name_of(path), path)
        if other is not path:
            raise DataError(f"{path} and {other}: have the same name; every recording of a vehicle needs its own name.")
    files = files_by_name(whole, rows)
    jobs = [replace(rows.get(name, RecordingJob(name)), path=path) for name, path in names.items()]
    jobs += [files.located(row) for name, row in rows.items() if name not in names]
    named = {job.path for job in jobs}
    beside = left_out([path for path in whole.others if path not in named], whole.results)
    if not any(named):
        raise DataError(no_recordings(", ".join(map(str, sources)) or "no folder", beside))
    return [job if job.path or contents else replace(job, problem=_NOT_NAMED) for job in jobs], beside


def vehicle_of(jobs: Sequence[RecordingJob], table: Mapping[str, RecordingJob], source: str) -> str:
    """The one vehicle of all recordings with a file: that of the table, else of their folder.

    Raises
    ------
    DataError
        If they belong to several vehicles, or to none of the table.
    """
    paths = [job.path for job in jobs if job.path]
    if not table:
        folders = {path.resolve().parent for path in paths}
        return as_text(folders.pop().name) if len(folders) == 1 else ""
    vehicles = {job.vehicle for job in jobs if job.path and job.recording in table}
    if not vehicles:
        raise DataError(
            f"{source}: names none of the {len(paths)} recordings; its column 'recording' must have their names."
        )
    if len(vehicles) > 1:
        some = listed(sorted(vehicles), 3)
        raise DataError(f"{source}: the recordings are of {len(vehicles)} vehicles ({some}); track follows one.")
    (vehicle,) = vehicles
    return vehicle


@checked
def track(
    recordings: str | PathLike[str] | Sequence[str | PathLike[str]],
    start: str | PathLike[str],
    *,
    table: str | PathLike[str] | None = None,
    wear_table: str | PathLike[str] | None = None,
    limit: float | None = None,
    by: Literal["estimate", "observe", "auto"] = "estimate",
    workers: int = 1,
    ambient: float | None = None,
    channels: str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
    zero: Zero = "subtract",
    results: Sequence[Path] = (),
    progress: Callable[[int, int], None] | None = None,
) -> WornClutch:
    """Follow the wear of one clutch through its recordings.

    Parameters
    ----------
    recordings : path, or several
        Files of one vehicle, or a folder with them.
    start : path
        Calibration (TOML) of its type.
    table : path, optional
        CSV with recording, vehicle, date, odometer_km and strokes, as far as they are known.
    wear_table : path, optional
        CSV with wear [mm], half_load [mm] and load [N] of this type; by default CAL.wear.csv beside the calibration
        CAL.toml, if it is there.
    limit : m, optional
        Shift of the half-load position that ends the life of the clutch; by default the last row of the table of wear.
    by : 'estimate', 'observe' or 'auto'
        What reads the recordings. 'auto' observes those that record the supply pressure and that the observer trusts,
        and estimates the others, those that the trend does not expect, and those before and after an alarm.
    workers : int
        Number of processes.
    ambient : Pa, optional
        Ambient pressure for gauge units; P_0 of the calibration by default.
    channels, dbc : paths
        Channel map (TOML), and DBC files of bus logs.
    zero : 'subtract' or 'keep'
        Whether a vented rest that has moved is subtracted from the position.
    results : paths
        Files that an earlier run may have left among the recordings.
    progress : function(done, all), optional
        Called after each recording.

    Returns
    -------
    tracked : WornClutch
        ``tracked.wear`` is the `Wear`; `clutchid.verbs.tracking.write_tracked` writes its files.

    Raises
    ------
    DataError, ParameterError
        If there are no recordings, they belong to several vehicles, or a file cannot be understood.

    Examples
    --------
    One recording says how far the load of one clutch has moved, but nothing of a trend:

    >>> import clutchid, tempfile
    >>> log = clutchid.bundled_recording()
    >>> cal = clutchid.calibrate(log.slice(0, 4000))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     clutchid.write_parameters(clutchid.parameter_file(cal), f"{folder}/cal.toml")
    ...     clutchid.write(log.slice(6000, 10_000).without("pressure_a"), f"{folder}/run.csv")
    ...     tracked = clutchid.track(f"{folder}/run.csv", f"{folder}/cal.toml")
    >>> len(tracked.wear.readings), bool(abs(tracked.wear.now["shift"].value[0]) < 0.2e-3)
    (1, True)
    """
    content_of(Path(start))  # a broken one is one sentence, not one a recording
    rows = read_table(Path(table)) if table else {}
    rig = Path(wear_table) if wear_table else Path(start).with_suffix(WEAR_TABLE)
    limits = LifeLimits(limit, read_wear_table(rig) if wear_table or rig.is_file() else None)
    several = [recordings] if isinstance(recordings, str | PathLike) else recordings
    apart = [*results, rig, *([Path(table)] if table else ())]
    jobs, beside = recordings_of([Path(path) for path in several], rows, apart)
    vehicle, files = vehicle_of(jobs, rows, str(table)), [replace(job, start=Path(start)) for job in jobs if job.path]
    check_workers(workers)
    reading = Reading(ambient=ambient, channels=channels, dbc=tuple(dbc), zero=zero)
    absent = [job for job in jobs if not job.path and job.vehicle == vehicle]
    warnings = () if rows else _several_folders([job.path for job in files if job.path])
    by_path: dict[Path | None, WearReading] = {}
    todo, reader, count = files, by, 0
    while True:
        every = count + len(todo)
        for finished in processes.results(partial(read_recording, reading, reader), todo, workers):
            by_path[finished.item.path] = unless_lost(finished.item, finished.result)
            count += 1
            if progress:
                progress(count, every)
        readings = [*counted_once((as_text(path.name), by_path[path]) for job in files if (path := job.path))]
        readings += [WearReading("bad_input", job.problem, apart=True) for job in absent]
        wear = wear_of(vehicle, [*files, *absent], readings, limits, warnings)
        if by != "auto" or not (todo := [*to_estimate(wear)]):
            return WornClutch(wear, beside)
        reader = "estimate"


def _several_folders(paths: Sequence[Path]) -> tuple[str, ...]:
    """Warning of recordings in several folders, of which no table says that they belong together."""
    folders = sorted({path.resolve().parent for path in paths})
    if len(folders) < 2:
        return ()
    names = listed((as_text(folder.name) for folder in folders), 3)
    return (
        f"the recordings lie in {len(folders)} folders ({names}) and are treated as recordings of one vehicle; give "
        "--table with the vehicle of each, or one folder.",
    )


#: Quantities of a trend with the ends of their columns and the factors of these.
_TREND = {"shift": ("_mm", 1e3), "wear": ("_mm", 1e3), "load": ("_percent", 100.0)}

#: Names of quantities in tables, where they are others.
_NAMED = {"load": "load_change"}


def table_of(wear: Wear) -> pl.DataFrame:
    """A row a recording: when, what came of it, its reading, and the trend there, as known then and given all.

    Files without a place in the life come last. What is not known is null.
    """
    import polars as pl

    number, text = pl.Float64, pl.String
    schema: dict[str, Any] = {
        "recording": text, "vehicle": text, "begin": pl.Datetime("us", "UTC"), "odometer_km": number, "strokes": number,
        **dict.fromkeys((*TEXT_COLUMNS, "outcome", "reason", "warnings", "alarm"), text),
        **dict.fromkeys(NUMBER_COLUMNS, number),
        "rest_cause": text, "axis": text, "along": number, "limit_mm": number,
        **{f"left_{axis}{side}": number for axis in LIFE for side in SIDES},
    }  # fmt: skip
    for when, name in product(("filtered", "smoothed"), _TREND):
        schema |= dict.fromkeys(banded(f"{_NAMED.get(name, name)}_{when}", (0.0,) * 3, _TREND[name][0]), number)
    return pl.DataFrame(
        [_row(wear, k, row) for k, row in enumerate(wear.rows)], schema, orient="row"
    ).fill_nan(None)  # fmt: skip


def _row(wear: Wear, k: int, row: LifeRow) -> dict[str, object]:
    """A recording of a life as a row of its table; files beyond those with a place have no trend."""
    job, columns = row.job, reading_columns(row.reading)
    columns |= {
        "recording": job.recording, "vehicle": wear.vehicle, "odometer_km": job.odometer, "strokes": job.strokes,
        "outcome": row.outcome, "reason": row.reason, "warnings": " ".join(job.warnings), "axis": wear.axis,
        "alarm": ", ".join(alarm.kind for alarm in wear.alarms if alarm.before == job.recording) or None,
        "limit_mm": None if wear.limit is None else 1e3 * wear.limit,
    }  # fmt: skip
    if k < len(wear.dated):
        columns |= {"rest_cause": wear.rests[k].cause if wear.rests else None, "along": float(wear.s[k])}
        for when, bands in (("filtered", wear.then), ("smoothed", wear.now)):
            for name, band in bands.items():
                sides = (band.value[k], band.low[k], band.high[k])
                columns |= banded(f"{_NAMED.get(name, name)}_{when}", sides, *_TREND[name])
    if k == len(wear.dated) - 1 and wear.left is not None:
        columns |= banded(f"left_{wear.axis}", (wear.left.median, wear.left.low, wear.left.high))
    return {**columns, "begin": job.begin}


def load_frame(keys: Mapping[str, Sequence[str]], curves: Sequence[LoadCurve | None]) -> pl.DataFrame:
    """Loads below each other, those that are known: columns of `keys` with a text a load, position, force and band."""
    import polars as pl

    curves_by_row = [(i, curve) for i, curve in enumerate(curves) if curve is not None]
    values = np.concatenate([curve.table() for _, curve in curves_by_row]) if curves_by_row else np.zeros((0, 4))
    rows = [i for i, curve in curves_by_row for _ in range(curve.position.size)]
    named = {key: pl.Series([texts[i] for i in rows], dtype=pl.String) for key, texts in keys.items()}
    return pl.DataFrame({**named, **dict(zip(LOAD_COLUMNS, values.T, strict=True))})


def write_tracked(tracked: WornClutch, out: Path) -> None:
    """Write the rows, and beside them the loads as OUT.load.parquet.

    Raises
    ------
    ExportError
        If a file cannot be written; an existing one is then unchanged.
    """
    wear = tracked.wear
    write_frame(table_of(wear), out, METADATA)
    rows = wear.rows
    curves = [row.reading.curve for row in rows]
    write_frame(load_frame({"recording": [row.job.recording for row in rows]}, curves), loads_path(out), METADATA)
