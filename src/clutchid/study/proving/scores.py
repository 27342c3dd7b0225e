"""Answers of a workflow for a worn recording, scored against the truth, and the table of all workflows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from clutchid.documents.tables import Cell, Column, ReportTable
from clutchid.estimation.assess.comparison import half_load
from clutchid.log import FloatArray, Log
from clutchid.numerics.interval import QUANTILE
from clutchid.truck import GRID, Truth

#: Range of the grid around the touch point, in m.
TOUCH = (5e-3, 8e-3)


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """A load curve in N over positions in m with its 95 % band, and the chamber pressure in Pa at every sample.

    `details` has further results as plain values.
    """

    position: FloatArray
    force: FloatArray
    low: FloatArray
    high: FloatArray
    pressure_a: FloatArray
    details: Mapping[str, Any] = field(default_factory=dict)


#: Function of a calibration recording with pressure and worn recordings with position only; one answer for each.
Workflow = Callable[[Log, Sequence[Log]], Sequence[Answer]]


@dataclass(frozen=True, slots=True)
class Score:
    """Errors of one answer.

    `load` is rms over 0.5 to 20 mm and `load_touch` over 5 to 8 mm, in % of the true peak; `half_load` the error of the
    position where the rising load reaches half its peak [mm]; `pressure` the rms error of the chamber pressure [kPa];
    `coverage` the fraction of the grid where the band contains the true load.
    """

    load: float
    load_touch: float
    half_load: float
    pressure: float
    coverage: float


def score(answer: Answer, truth: Truth, time: FloatArray) -> Score:
    """Score `answer` against the truth of its recording, whose samples are at `time` in s.

    Raises
    ------
    ValueError
        If the curve does not cover the grid or is not finite there.
    """
    force, low, high = (np.interp(GRID, answer.position, c) for c in (answer.force, answer.low, answer.high))
    if answer.position[0] > GRID[0] or answer.position[-1] < GRID[-1] or not np.isfinite(force).all():
        raise ValueError("the load curve must be finite from 0.5 to 20 mm")
    true = truth.load(GRID)
    error = (force - true) / true.max() * 100
    near = (TOUCH[0] - 1e-9 < GRID) & (TOUCH[1] + 1e-9 > GRID)
    fine = np.linspace(0.0, GRID[-1], 4001)
    halves = [half_load(fine, np.interp(fine, answer.position, answer.force)), half_load(fine, truth.load(fine))]
    pressure = answer.pressure_a - np.interp(time, truth.time, truth.states["pressure_a"])
    return Score(
        load=_rms(error),
        load_touch=_rms(error[near]),
        half_load=(halves[0] - halves[1]) * 1e3,
        pressure=_rms(pressure[np.isfinite(pressure)]) * 1e-3,
        coverage=float(np.mean((low <= true) & (true <= high))),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


Results = Sequence[Mapping[str, Any]]

#: Errors of a score: key, heading with unit, decimals.
_ERRORS = (
    ("load", "load [%]", 2),
    ("load_touch", "5-8 mm [%]", 2),
    ("half_load", "half load [mm]", 3),
    ("pressure", "p_A [kPa]", 1),
)

_NOTE = (
    "Load: rms error over 0.5 to 20 mm, and over 5 to 8 mm, in % of the true peak. Half load: error of the position "
    "where the rising load reaches half its peak. p_A: rms error of the chamber pressure. Ratio: median error over 5 "
    "to 8 mm relative to the paper's method. Covered: fraction of grid points where the 95 % band contains the true "
    "load, ± its 95 % interval for independent trucks. Time: median per truck."
)

#: Workflow that is the reference of all ratios.
_REFERENCE = "paper"


def standings(results: Mapping[str, Results]) -> ReportTable:
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
    for key, heading, decimals in _ERRORS:
        columns.append(Column(f"{key} median", "median", decimals=decimals, group=heading))
        columns.append(Column(f"{key} worst", "worst", decimals=decimals, group=heading))
    columns += [
        Column("ratio [1]", "ratio"),
        Column("coverage [1]", "covered\n[%]", scale=0.01, decimals=1),
        Column("coverage error [1]", "±", scale=0.01, decimals=1),
        Column("seconds [s]", "time\n[s]", decimals=1),
    ]
    rows = tuple(_row(name, own, results.get(_reference(name), ())) for name, own in results.items())
    return ReportTable("Proving ground", tuple(columns), rows, note=_NOTE)


def _row(name: str, results: Results, reference: Results) -> tuple[Cell, ...]:
    cells: list[Cell] = [
        name.split("@", maxsplit=1)[0],
        *_conditions(results[0]),
        len(results),
        sum(r["failed"] is not None for r in results),
    ]
    for key, _, _ in _ERRORS:
        values = np.abs(_scores(results, key))
        cells += [float(np.median(values)), float(values.max())] if values.size else [None, None]
    covered, error = coverage(results)
    return (*cells, _ratio(results, reference), covered, error, float(np.median([r["seconds"] for r in results])))


def _reference(name: str) -> str:
    """The paper's method under the same conditions."""
    return "@".join([_REFERENCE, *name.split("@")[1:]])


def _conditions(result: Mapping[str, Any]) -> tuple[str, str]:
    return result["family"], result["change"]


def _ratio(results: Results, reference: Results) -> float | None:
    both = {r["truck"] for r in results} & {r["truck"] for r in reference}
    own, paper = (_scores([r for r in group if r["truck"] in both], "load_touch") for group in (results, reference))
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


def every_recording(results: Mapping[str, Results]) -> ReportTable:
    """One row per worn recording and workflow, with all errors, for a CSV file."""
    columns = [Column("workflow", "workflow"), Column("family", "family"), Column("change", "change")]
    columns += [Column("truck", "truck", decimals=0), Column("recording", "recording")]
    columns += [Column("wear [m]", "wear [mm]", scale=1e-3)]
    columns += [Column(key, heading, decimals=decimals) for key, heading, decimals in _ERRORS]
    columns += [Column("coverage [1]", "covered"), Column("failed", "failed")]
    rows: list[tuple[Cell, ...]] = []
    for name, own in results.items():
        for r in own:
            of = (name.split("@")[0], *_conditions(r), r["truck"])
            if r["failed"] is not None:
                rows.append((*of, None, None, *[None] * (len(_ERRORS) + 1), r["failed"]))
            for stem, log in r["logs"].items():
                scores = log["score"]
                cells = [scores[key] for key, _, _ in _ERRORS]
                rows.append((*of, stem, log["wear_m"], *cells, scores["coverage"], None))
    return ReportTable("Every recording", tuple(columns), tuple(rows))
