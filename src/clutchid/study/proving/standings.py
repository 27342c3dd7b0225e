"""Table of the proving ground: median and worst errors of every workflow, and ratios to the paper's method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from clutchid.numerics.interval import QUANTILE
from clutchid.reports.tables import Cell, Column, Table

Results = Sequence[Mapping[str, Any]]

#: Errors of a score: key, heading with unit, decimals.
ERRORS = (
    ("load", "load [%]", 2),
    ("load_touch", "5-8 mm [%]", 2),
    ("half_load", "half load [mm]", 3),
    ("pressure", "p_A [kPa]", 1),
)

NOTE = (
    "Load: rms error over 0.5 to 20 mm, and over 5 to 8 mm, in % of the true peak. Half load: error of the position "
    "where the rising load reaches half its peak. p_A: rms error of the chamber pressure. Ratio: median error over 5 "
    "to 8 mm relative to the paper's method. Covered: fraction of grid points where the 95 % band contains the true "
    "load, ± its 95 % interval for independent trucks. Time: median per truck."
)

#: Workflow that is the reference of all ratios.
REFERENCE = "paper"


def standings(results: Mapping[str, Results]) -> Table:
    """One row per workflow and conditions: medians and worst cases over worn recordings, coverage, failures, time.

    The ratio is the median load error over 5 to 8 mm relative to that of the paper's method on the same trucks.
    """
    columns = [
        Column("workflow", "workflow"),
        Column("family", "family"),
        Column("change", "change"),
        Column("trucks", "trucks", decimals=0),
        Column("failed", "failed", decimals=0),
    ]
    for key, heading, decimals in ERRORS:
        columns.append(Column(f"{key} median", "median", decimals=decimals, group=heading))
        columns.append(Column(f"{key} worst", "worst", decimals=decimals, group=heading))
    columns += [
        Column("ratio [1]", "ratio"),
        Column("coverage [1]", "covered\n[%]", scale=0.01, decimals=1),
        Column("coverage error [1]", "±", scale=0.01, decimals=1),
        Column("seconds [s]", "time\n[s]", decimals=1),
    ]
    rows = tuple(_row(name, one, results.get(_reference(name), ())) for name, one in results.items())
    return Table("Proving ground", tuple(columns), rows, note=NOTE)


def _row(name: str, results: Results, reference: Results) -> tuple[Cell, ...]:
    cells: list[Cell] = [
        name.split("@", maxsplit=1)[0],
        *_conditions(results[0]),
        len(results),
        sum(r["failed"] is not None for r in results),
    ]
    for key, _, _ in ERRORS:
        values = np.abs(_scores(results, key))
        cells += [float(np.median(values)), float(values.max())] if values.size else [None, None]
    covered, error = coverage(results)
    return (*cells, _ratio(results, reference), covered, error, float(np.median([r["seconds"] for r in results])))


def _reference(name: str) -> str:
    """The paper's method under the same conditions."""
    return "@".join([REFERENCE, *name.split("@")[1:]])


def _conditions(result: Mapping[str, Any]) -> tuple[str, str]:
    return result["family"], result["change"]


def _ratio(results: Results, reference: Results) -> float | None:
    both = {r["truck"] for r in results} & {r["truck"] for r in reference}
    own, paper = (_scores([r for r in one if r["truck"] in both], "load_touch") for one in (results, reference))
    return float(np.median(own) / np.median(paper)) if own.size and paper.size else None


def coverage(results: Results) -> tuple[float | None, float | None]:
    """Fraction of grid points that the bands cover, and half width of its 95 % interval, clustered by truck."""
    shares = [np.mean([log["score"]["coverage"] for log in r["logs"].values()]) for r in results if r["logs"]]
    if not shares:
        return None, None
    half = QUANTILE * np.std(shares, ddof=1) / np.sqrt(len(shares)) if len(shares) > 1 else np.nan
    return float(np.mean(shares)), float(half)


def _scores(results: Results, key: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([log["score"][key] for r in results for log in r["logs"].values()], dtype=np.float64)


def every_recording(results: Mapping[str, Results]) -> Table:
    """One row per worn recording and workflow, with all errors, for a CSV file."""
    columns = [Column("workflow", "workflow"), Column("family", "family"), Column("change", "change")]
    columns += [Column("truck", "truck", decimals=0), Column("recording", "recording")]
    columns += [Column("wear [m]", "wear [mm]", scale=1e-3)]
    columns += [Column(key, heading, decimals=decimals) for key, heading, decimals in ERRORS]
    columns += [Column("coverage [1]", "covered"), Column("failed", "failed")]
    rows: list[tuple[Cell, ...]] = []
    for name, one in results.items():
        for r in one:
            of = (name.split("@")[0], *_conditions(r), r["truck"])
            if r["failed"] is not None:
                rows.append((*of, None, None, *[None] * (len(ERRORS) + 1), r["failed"]))
            for stem, log in r["logs"].items():
                scores = log["score"]
                cells = [scores[key] for key, _, _ in ERRORS]
                rows.append((*of, stem, log["wear_m"], *cells, scores["coverage"], None))
    return Table("Every recording", tuple(columns), tuple(rows))
