"""Files of a virtual fleet: recordings of months, calibration recordings of its truck types, and the truth apart."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.errors import ExportError, SolveError
from clutchid.estimation.assess.comparison import ENGAGING, half_load
from clutchid.files import atomic_write, make_folder, not_an_address
from clutchid.log import FloatArray
from clutchid.measurements import write
from clutchid.processes import LostWork, check_workers, results
from clutchid.truck import aged, drive, load_curve, truck
from clutchid.truck.families import family_label
from clutchid.truck.service import Visit
from clutchid.truck.vehicle import Vehicle

#: Positions in m at which a true load is looked at, and steps of wear in the table of a type.
LOAD_POSITIONS, STEPS = np.linspace(0.0, 0.02, 4001), 36

#: Length in s, and seed, of the recording with pressure from which a type is calibrated.
_CALIBRATION, _CALIBRATION_SEED = 30.0, 1

#: Strokes for a metre of wear, as the ages in a type's table have done.
STROKES_A_METRE = 3e8

#: Names of the files of a fleet, and of their folders.
_TABLE, _TRUTH, _RECORDINGS, _CALIBRATIONS = "recordings.csv", "truth.csv", "recordings", "calibrations"

CsvRow = Mapping[str, Any]


def write_fleet(
    out: Path,
    vehicles: Iterable[Sequence[Visit]],
    seconds: float = 30.0,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Drive all recordings of a fleet and write them to a new folder; the number of recordings.

    ``recordings/VEHICLE/NAME.parquet``: position, duty cycles, air temperature and supply pressure. ``recordings.csv``
    has recording, vehicle, type, date, odometer_km and strokes; ``calibrations/`` for each type a recording with
    pressure, and its half-load position and mean load over 5 to 8 mm by the wear of the facing. ``truth.csv`` is the
    truth.

    Parameters
    ----------
    out
        A folder that does not exist, or is empty.
    vehicles
        Recordings by vehicle, see `clutchid.truck.service.visits`.
    seconds : s
        Length of a recording.

    Raises
    ------
    ExportError
        If the folder has files, or cannot be written.
    ParameterError
        If there is no worker, or a recording is too short or too long.
    SolveError
        If a recording ends its process.
    """
    check_workers(workers)
    visits = [visit for vehicle in vehicles for visit in vehicle]
    _new_folders(out, visits)
    kinds = sorted({(visit.family, visit.number) for visit in visits})
    for family, number in kinds:
        _write_calibration(out / _CALIBRATIONS, family, number)
    rows: dict[str, CsvRow] = {}
    for finished in results(partial(_recorded, out, seconds), visits, workers):
        if isinstance(finished.result, LostWork):
            raise SolveError(f"{finished.item.recording}: {finished.result.message}")
        rows[finished.item.recording] = finished.result
        if progress:
            progress(len(rows), len(visits))
    _write_csv(out / _TRUTH, [rows[visit.recording] for visit in visits])
    _write_csv(out / _TABLE, [row for visit in visits for row in _listed(visit)])
    return len(visits)


def type_name(family: str, number: int) -> str:
    """Name of a truck type, as in the table and in the names of its calibration's files."""
    return f"{family_label(family)}{number:04d}"


def _new_folders(out: Path, visits: Iterable[Visit]) -> None:
    not_an_address(out, "--out")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ExportError(f"--out {out}: exists already; name a new folder for the fleet.")
    for folder in (_CALIBRATIONS, *{f"{_RECORDINGS}/{visit.vehicle}" for visit in visits}):
        make_folder(out / folder, "--out")


def _write_calibration(folder: Path, family: str, number: int) -> None:
    """A recording with pressure of a new truck, and how its load changes with wear, as on a test rig."""
    new, name = truck(number, family), type_name(family, number)
    driven = drive(new, seconds=_CALIBRATION, seed=_CALIBRATION_SEED, conditions=True, name=name)
    write(replace(driven.log, metadata={}), folder / f"{name}.parquet")
    wear = np.linspace(0.0, new.w_max, STEPS)
    loads = [load_at_positions(aged(new, w, w * STROKES_A_METRE)) for w in wear]
    rows = [
        {"wear [mm]": w * 1e3, "half_load [mm]": half_load(LOAD_POSITIONS, load) * 1e3, "load [N]": engaging(load)}
        for w, load in zip(wear, loads, strict=True)
    ]
    _write_csv(folder / f"{name}.wear.csv", rows)


def engaging(load: FloatArray) -> float:
    """Mean load in N where the clutch engages."""
    first, last = ENGAGING
    return float(np.mean(load[(first <= LOAD_POSITIONS) & (last >= LOAD_POSITIONS)]))


def load_at_positions(vehicle: Vehicle) -> FloatArray:
    """Load in N of a truck at `LOAD_POSITIONS`, relative to its engaged rest."""
    curve = load_curve(vehicle)
    return curve.force(LOAD_POSITIONS + curve.rest)


def _recorded(out: Path, seconds: float, visit: Visit) -> CsvRow:
    """Drive and write a recording; the row of its truth."""
    driven = drive(
        visit.truck, seconds=seconds, seed=visit.seed, wear=visit.wear, cycles=visit.cycles,
        temperature=visit.temperature, pressure=False, conditions=True, offset=visit.offset, name=visit.recording,
    )  # fmt: skip
    recorded = driven.log if visit.records_supply else driven.log.without("pressure_supply")
    log = recorded.with_columns(position=visit.gain * recorded["position"])
    path = out / _RECORDINGS / visit.vehicle / f"{visit.recording}.parquet"
    write(replace(log, metadata={"start": visit.clock.isoformat()}), path)
    if visit.fault == "cut off":
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    if visit.fault == "twice":
        shutil.copyfile(path, path.with_stem(f"{path.stem}_again"))
    return _truth(visit, driven.truth.truck)


def _truth(visit: Visit, vehicle: Vehicle) -> CsvRow:
    """True values of a recording; `limit [mm]` is the shift of the half-load position at the end of the facing."""
    new = truck(visit.number, visit.family)
    at_rest, load = half_load(LOAD_POSITIONS, load_at_positions(new)), load_at_positions(vehicle)
    end = aged(new, new.w_max, new.w_max * STROKES_A_METRE)
    half = half_load(LOAD_POSITIONS, load)
    return {
        "recording": visit.recording,
        "vehicle": visit.vehicle,
        "type": type_name(visit.family, visit.number),
        "date": visit.begin.isoformat(),
        "strokes": round(visit.strokes),
        "wear [mm]": visit.wear * 1e3,
        "half_load [mm]": half * 1e3,
        "shift [mm]": (half - at_rest) * 1e3,
        "limit [mm]": (half_load(LOAD_POSITIONS, load_at_positions(end)) - at_rest) * 1e3,
        "peak [N]": float(load.max()),
        "load [N]": engaging(load),
        "load change [1]": engaging(load) / engaging(load_at_positions(new)) - 1.0,
        "temperature [degC]": visit.temperature - 273.15,
        "supply [1]": visit.supply,
        "leak [m³/(Pa·s)]": visit.leak,
        "gain [1]": visit.gain,
        "offset [mm]": visit.offset * 1e3,
        "supply_recorded": visit.records_supply,
        "event": visit.event,
        "fault": visit.fault,
    }


def _listed(visit: Visit) -> list[CsvRow]:
    """Rows of a visit in the table of recordings; two where its recording was sent twice."""
    names = [visit.recording, *([f"{visit.recording}_again"] if visit.fault == "twice" else [])]
    entries = {
        "vehicle": visit.vehicle,
        "type": type_name(visit.family, visit.number),
        "date": visit.begin.isoformat(timespec="seconds"),
        "odometer_km": round(visit.odometer),
        "strokes": round(visit.strokes),
    }
    return [{"recording": name, **entries} for name in names]


def _write_csv(path: Path, rows: Sequence[CsvRow]) -> None:
    with atomic_write(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
