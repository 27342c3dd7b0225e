"""Results of `track` and `fleet` for the page: the table of a fleet, and the trend and the loads of one vehicle.

Everything is read from the files that these commands have written; a number that is infinite is the text "inf".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from clutchid.documents.fit_json import curve_json
from clutchid.documents.fleet_tables import ReplacementRow, months_table, shared_table, tag_tables
from clutchid.documents.tables import ReportTable
from clutchid.documents.wear_rows import ALARMS
from clutchid.errors import DataError
from clutchid.files import reason_of
from clutchid.fleets.output import REPLACEMENTS, RESULTS, TYPES, VEHICLES, WITHIN, type_of
from clutchid.fleets.parts import PLACES
from clutchid.fleets.storage import PARTS_FOLDER
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.names import natural, printable
from clutchid.verbs.saving import loads_path
from clutchid.wear.columns import LOAD_COLUMNS, SIDES
from clutchid.wear.life import COUNTED_OUTCOMES
from clutchid.wear.trend import LIFE

if TYPE_CHECKING:
    import polars as pl

#: Most vehicles of a fleet, recordings of a vehicle, and loads of it, which are taken evenly over its life.
_MOST_VEHICLES, _MOST_RECORDINGS, MOST_LOADS = 20_000, 5_000, 200

#: Most rows that are read of a file.
_MOST_ROWS = 2_000_000

#: Columns by which the files of a run are known.
_KNOWN = {
    "wear": ("recording", "outcome", "axis", "along", "shift_smoothed_mm", "limit_mm", "left_strokes"),
    "vehicles": ("vehicle", "counted", "load_change_percent"),
    "results": ("recording", "vehicle", "peak_N", "file_gone"),
}


class Files(NamedTuple):
    """The existing files of a track or a fleet: its tables, and those with the loads of its recordings."""

    wear: Path | None
    vehicles: Path | None
    results: Path | None
    loads: tuple[Path, ...]
    types: Path | None = None
    replacements: Path | None = None


def files_of(path: Path, below: Path) -> Files:
    """The files that belong to a result, all of them below a folder, also where they are links.

    Raises
    ------
    DataError
        If the file is no result of these commands.
    """
    path = path.with_name(path.name.replace(".load.", ".", 1)) if ".load." in path.name else path
    present = {*_columns(path)}
    kind = next((kind for kind, columns in _KNOWN.items() if {*columns} <= present), None)
    if kind is None and {"recording", "outcome"} <= present:
        raise DataError(
            f"{printable(path.name)}: is of an earlier version of clutchid, without all columns; make it again with "
            "`clutchid track --out FILE.parquet` or `clutchid fleet --out FOLDER`."
        )
    if kind is None:
        raise DataError(
            f"{printable(path.name)}: is no result of `clutchid track` (FILE.parquet of --out) or of `clutchid fleet` "
            f"({VEHICLES}, {RESULTS}, or the file of a vehicle in its folder)."
        )
    if kind == "wear":
        own = _inside(loads_path(path), below)
        return Files(path, None, None, (own,) if own else ())
    names = {"vehicles": VEHICLES, "results": RESULTS, "types": TYPES, "replacements": REPLACEMENTS}
    paths = {other: _inside(path.with_name(name), below) for other, name in names.items()} | {kind: path}
    # files that are sent to the page lie beside each other
    parts = sorted((*(path.parent / PARTS_FOLDER).glob("date=*/part-*.parquet"), *path.parent.glob("part-*.parquet")))
    loads = tuple(part for part in parts if _inside(part, below))
    return Files(None, paths["vehicles"], paths["results"], loads, paths["types"], paths["replacements"])


def _inside(path: Path, below: Path) -> Path | None:
    """An existing file below the folder, else None."""
    return path if path.is_file() and path.resolve().is_relative_to(below) else None


def _read(path: Path, where: pl.Expr | None = None, most: int = _MOST_ROWS) -> pl.DataFrame:
    """The first rows of a Parquet file, all or those that meet a condition.

    Raises
    ------
    DataError
        If it cannot be read as a table.
    """
    import polars as pl

    try:
        frame = pl.scan_parquet(path)
        rows: pl.DataFrame = (frame if where is None else frame.filter(where)).head(most).collect()
    except (OSError, pl.exceptions.PolarsError, ValueError) as error:
        why = reason_of(error) if type(error) is OSError else str(error).splitlines()[0][:200]
        raise DataError(f"{printable(path.name)}: cannot be read as a table ({why}).") from error
    return rows


def _columns(path: Path) -> Sequence[str]:
    return _read(path, most=0).columns


def opened_results(path: Path, below: Path, vehicle: str | None) -> dict[str, Any]:
    """A vehicle, or a fleet, from the files of a run.

    Parameters
    ----------
    path, below
        The file that was opened, and the folder that the others of the run must lie in.
    vehicle
        Name of one of a fleet; None for what the files hold.

    Raises
    ------
    DataError
        If it is no such file, or there is no such vehicle.
    """
    files = files_of(path, below)
    if files.wear is not None:
        names = _read(files.wear)["vehicle"].unique().to_list()
        return vehicle_table(files, vehicle or (names[0] if names else ""))
    if vehicle is None:
        return fleet_table(files)
    own = _own_file(files, vehicle, below)
    return vehicle_table(files if own is None else files_of(own, below)._replace(vehicles=files.vehicles), vehicle)


def _own_file(files: Files, vehicle: str, below: Path) -> Path | None:
    """The file with the trend of a vehicle; None if there is none."""
    import polars as pl

    row = None if files.vehicles is None else _read(files.vehicles, pl.col("vehicle") == vehicle, 1)
    name = row["file"][0] if row is not None and row.height else None
    if not name or files.vehicles is None:
        return None
    folder, file = files.vehicles.parent, f"{name}.parquet"
    return _inside(folder / file, below) or _inside(folder / Path(file).name, below)


# a fleet


def fleet_table(files: Files) -> dict[str, Any]:
    """The vehicles of a fleet, a list of values a column, in the order of their names, and what the fleet shares."""
    rows = [] if files.vehicles is None else _read(files.vehicles).to_dicts()
    newest = {} if files.results is None else _newest(_read(files.results))
    rows = rows or [{"vehicle": name, **row} for name, row in newest.items()]
    rows.sort(key=lambda row: natural(str(row["vehicle"])))
    shown = rows[:_MOST_VEHICLES]
    columns: dict[str, list[Any]] = {
        name: [row.get(name) for row in shown]
        for name in ("vehicle", "type", "recordings", "counted", "last", "axis", "alarms")
    }
    columns["last"] = [_text(last) for last in columns["last"]]
    for name in ("shift", "wear"):
        columns[name] = [_band([row.get(f"{name}{side}_mm") for side in SIDES]) for row in shown]
    changes = [[row.get(f"load_change{side}_percent") for side in SIDES] for row in shown]
    columns["load"] = [_band([_scaled(side, 0.01) for side in change]) for change in changes]
    columns["left"] = [_band([row.get(f"left_{row.get('axis')}{side}") for side in SIDES]) for row in shown]
    for name in (WITHIN[0], WITHIN[3], WITHIN[5]):
        columns[name] = [row.get(name) for row in shown]
    for name in ("trust", "peak", "half_load"):
        columns[name] = [newest.get(row["vehicle"], {}).get(name) for row in shown]
    return {
        "kind": "fleet",
        "vehicles": columns,
        "count": len(rows),
        "trends": files.vehicles is not None,
        "lives": LIFE,
        "tables": [_text_of(table) for table in _shared_tables(files)],
    }


def _shared_tables(files: Files) -> list[ReportTable]:
    """Replacements and types of a fleet that has a forecast."""
    types = [] if files.types is None else [type_of(row) for row in _read(files.types).iter_rows(named=True)]
    if not types or files.replacements is None:
        return []
    rows = [ReplacementRow(*row) for row in _read(files.replacements).iter_rows()]
    return [months_table(rows), *tag_tables(rows), shared_table(types)]


def _text_of(table: ReportTable) -> dict[str, Any]:
    """A table as text."""
    heads = [f"{column.group} {column.heading}".strip() for column in table.columns]
    rows = [[column.shown(cell) for column, cell in zip(table.columns, row, strict=True)] for row in table.rows]
    return {"title": table.title, "heads": heads, "rows": rows, "note": table.note}


def _band(sides: Sequence[Any]) -> list[float | str | None] | None:
    """A value with its ends; None where it is not known."""
    numbers = [_number(side) for side in sides]
    return None if numbers[0] is None else numbers


def _scaled(value: float | None, factor: float) -> float | None:
    """A number in another unit."""
    return None if value is None else factor * value


def _text(begin: datetime | str | None) -> str | None:
    """A time as ISO 8601."""
    return begin.isoformat() if isinstance(begin, datetime) else begin


def _number(value: Any) -> float | str | None:
    """A number for JSON: "inf" for infinity, None for a missing value."""
    if not isinstance(value, int | float) or np.isnan(value):
        return None
    return float(f"{value:.6g}") if np.isfinite(value) else "inf"


def _newest(results: pl.DataFrame) -> dict[str, dict[str, Any]]:
    """ReadBy vehicle: how many recordings, and the trust, peak and half-load position of the last one with a load."""
    vehicles: dict[str, dict[str, Any]] = {}
    for row in results.iter_rows(named=True):
        vehicle = vehicles.setdefault(
            row["vehicle"], {"type": row.get("type"), "recordings": 0, "counted": 0, "trust": row["trust"]}
        )
        vehicle["recordings"] += row.get("is_recording", True)
        peak = _band([row[f"peak{side}_N"] for side in SIDES])
        if peak is None:
            continue
        half = _band([row[f"half_load{side}_mm"] for side in SIDES])
        vehicle |= {"counted": vehicle["counted"] + 1, "trust": row["trust"], "peak": peak, "half_load": half}
    return vehicles


# a vehicle


def vehicle_table(files: Files, name: str) -> dict[str, Any]:
    """One vehicle: its recordings in their order, its trend if there is one, and its loads.

    Raises
    ------
    DataError
        If the files have no such vehicle.
    """
    import polars as pl

    own = pl.col("vehicle") == name
    source = files.wear or files.results
    rows = pl.DataFrame() if source is None else _read(source, own, _MOST_RECORDINGS)
    if not rows.height:
        where = "no table of recordings lies beside it" if source is None else f"{source.name} has no recordings of it"
        raise DataError(f"{printable(name)}: {where}, so that nothing is known of it.")
    names = [str(recording) for recording in rows["recording"]]
    loads = _loads(files, name, names)
    placed = rows.filter(pl.col("along").is_not_null()) if "along" in rows.columns else rows.head(0)
    trend = _trend(placed) if placed.height else None
    return {
        "kind": "vehicle", "vehicle": name, "type": _type(files, own),
        "recordings": [_recording(row, loads.get(row["recording"])) for row in rows.iter_rows(named=True)],
        "trend": trend,
        "loads": [{"recording": key, "curve": curve_json(_rounded(loads[key]))} for key in _evenly(names, loads)],
        "load_count": len(loads), "places": PLACES,
    }  # fmt: skip


def _type(files: Files, own: pl.Expr) -> str:
    """The type of a vehicle, from the first table that has it; a table of wear has none."""
    path = files.vehicles or files.results
    rows = None if path is None else _read(path, own, 1)
    return str(rows["type"][0] or "") if rows is not None and rows.height and "type" in rows.columns else ""


def _rounded(load: LoadCurve) -> LoadCurve:
    """A load rounded to 0.1 N at positions to 1 um, which is shorter to send."""
    return LoadCurve(load.position.round(6), load.force.round(1), load.low.round(1), load.high.round(1))


def _evenly(names: Sequence[str], loads: Mapping[str, LoadCurve]) -> list[str]:
    """Recordings with a load, at most so many, evenly from the first to the last."""
    loaded = [name for name in names if name in loads]
    if not loaded:
        return []
    chosen = np.unique(np.linspace(0, len(loaded) - 1, MOST_LOADS).round().astype(int))
    return [loaded[i] for i in chosen.tolist()]


def _recording(row: Mapping[str, Any], load: LoadCurve | None) -> dict[str, Any]:
    """A recording as a row of the table of its vehicle, in SI, with its load at `PLACES`."""
    half = [_scaled(row.get(f"half_load{side}_mm"), 1e-3) for side in SIDES]
    why = row.get("reason") or ("" if row.get("status") == "ok" else row.get("message"))
    said = " ".join(text for text in (why, row.get("warnings")) if text)
    return {
        "recording": row["recording"], "begin": _text(row.get("begin")),
        "strokes": _number(row.get("strokes")), "odometer": _number(row.get("odometer_km")),
        "status": row.get("status"), "trust": row.get("trust"), "outcome": row.get("outcome"), "said": said,
        "shift": _number(_scaled(row.get("shift_mm"), 1e-3)),
        "change": _number(_scaled(row.get("load_change_percent"), 0.01)), "half_load": _band(half),
        "at": None if load is None else _at_places(load),
    }  # fmt: skip


def _at_places(load: LoadCurve) -> list[list[float | str | None] | None]:
    """The load in N with its interval at each of `PLACES` that it reaches."""
    position, *sides = load.table().T
    return [
        _band([np.interp(1e-3 * place, position, side) for side in sides]) if 1e-3 * place <= position[-1] else None
        for place in PLACES
    ]


def _trend(rows: pl.DataFrame) -> dict[str, Any]:
    """The trend given all recordings, alarms, limit and forecast, over the axis of the trend."""
    columns = {
        "wear": ("wear", "_mm", 1e-3),
        "shift": ("shift", "_mm", 1e-3),
        "load": ("load_change", "_percent", 0.01),
    }

    def band(name: str, when: str) -> list[list[float | str | None]]:
        head, unit, factor = columns[name]
        sides = (rows[f"{head}_{when}{side}{unit}"] for side in SIDES)
        return [[_number(_scaled(value, factor)) for value in side] for side in sides]

    quantities = [name for name in columns if any(value is not None for value in band(name, "smoothed")[0])]
    last = rows.row(-1, named=True)
    limit = _number(_scaled(last["limit_mm"], 1e-3))
    return {
        "axis": rows["axis"][0], "along": [_number(value) for value in rows["along"]],
        "counted": sum(outcome in COUNTED_OUTCOMES for outcome in rows["outcome"]),
        "bands": {name: band(name, "smoothed") for name in quantities},
        "now": {name: [side[-1] for side in band(name, "filtered")] for name in quantities},
        "limit": None if limit is None else {"of": "wear" if "wear" in quantities else "shift", "value": limit},
        "left": _band([last[f"left_{last['axis']}{side}"] for side in SIDES]),
        "alarms": _alarms(rows),
    }  # fmt: skip


def _alarms(rows: pl.DataFrame) -> list[dict[str, Any]]:
    """The alarms in order, each with its recording and a sentence."""
    alarms = []
    names, begins = rows["recording"].to_list(), rows["begin"].to_list()
    for index, text in enumerate(rows["alarm"]):
        for kind in (text or "").split(", ") if text else ():
            when = f" on {begins[index]:%Y-%m-%d}" if begins[index] else ""
            where = f"between {names[index - 1]} and {names[index]}" if index else f"before {names[index]}"
            words = f"{ALARMS.get(kind, kind)} {where}{when}"
            alarms.append({"index": index, "kind": kind, "words": f"{words[0].upper()}{words[1:]}."})
    return alarms


def _loads(files: Files, vehicle: str, names: Sequence[str]) -> dict[str, LoadCurve]:
    """The loads of a vehicle by recording."""
    import polars as pl

    curves: dict[str, LoadCurve] = {}
    for path in files.loads:
        if "vehicle" not in _columns(path):  # that of a track, with a row a point
            for (name,), group in _read(path).group_by(["recording"], maintain_order=True):
                curves[str(name)] = LoadCurve(*(group[column].to_numpy() for column in LOAD_COLUMNS))
            continue
        rows = _read(path, (pl.col("vehicle") == vehicle) & pl.col("force_N").is_not_null())
        for row in rows.select("recording", *LOAD_COLUMNS).iter_rows():
            curves[row[0]] = LoadCurve(*map(np.array, row[1:]))
    return {name: curves[name] for name in names if name in curves}
