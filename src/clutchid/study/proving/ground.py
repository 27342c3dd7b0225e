"""The proving ground: a seeded fleet of virtual trucks, each with a calibration and two worn recordings."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.arguments import checked
from clutchid.documents.tables import ReportTable, to_csv
from clutchid.errors import ExportError
from clutchid.files import make_folder, write_text
from clutchid.fleets.cluster import ONE_WORKER, Workers, results, version_and_source
from clutchid.processes import LostWork
from clutchid.study.proving.scores import Answer, every_recording, score, standings
from clutchid.study.proving.workflows import workflow
from clutchid.truck import Drive, changed, drive, truck
from clutchid.verbs.virtual_fleet import STROKES_A_METRE

#: Length of every recording in s.
SECONDS = 30.0

#: Wear of the facing in m in the two worn recordings.
_WEAR = ((0.5e-3, 1.75e-3), (1.75e-3, 3.0e-3))


@dataclass(frozen=True, slots=True, eq=False)
class Proof:
    """Recordings of one truck: a calibration recording with pressure, worn ones without, and their truths."""

    calibration: Drive
    worn: tuple[Drive, ...]


@dataclass(frozen=True, slots=True)
class Conditions:
    """Family of the trucks, and changes between calibration and worn recordings, see `clutchid.truck.CHANGES`."""

    family: str = "A"
    changes: tuple[str, ...] = ()

    @property
    def suffix(self) -> str:
        """End of the name of a folder with results; nothing for family A without changes."""
        return "" if self == Conditions() else f"@{'+'.join((self.family, *self.changes))}"


def proof(number: int, conditions: Conditions = Conditions()) -> Proof:
    """The recordings of truck `number`; the same number gives the same recordings.

    Wear, manoeuvres and seeds do not depend on the conditions.

    Raises
    ------
    ParameterError
        If there is no such truck, family or change.
    """
    new = truck(number, conditions.family)
    rng = np.random.default_rng([number, 1])
    wear = [float(rng.uniform(*limits)) for limits in _WEAR]
    seeds = rng.integers(0, 2**31, 1 + len(wear)).tolist()
    calibration = drive(new, seconds=SECONDS, seed=seeds[0], name="calibration")
    worn = tuple(
        drive(
            new,
            seconds=SECONDS,
            seed=s,
            wear=w,
            cycles=w * STROKES_A_METRE,
            pressure=False,
            change=conditions.changes,
            name=f"worn{i}",
        )
        for i, (s, w) in enumerate(zip(seeds[1:], wear, strict=True), 1)
    )
    return Proof(calibration, worn)


def prove_one(name: str, number: int, conditions: Conditions = Conditions()) -> dict[str, Any]:
    """Run the workflow `name` on truck `number`: scores, load curves and further results, as plain values.

    If the workflow raises an exception or returns no finite curve, the truck counts as failed, with the reason.
    """
    ground = proof(number, conditions)
    begin = time.perf_counter()
    try:
        worn = [replace(d.log.without("pressure_a"), metadata={}) for d in ground.worn]
        answers = workflow(name)(ground.calibration.log, worn)
        seconds = time.perf_counter() - begin
        logs = {d.log.name: _scored(answer, d) for answer, d in zip(answers, ground.worn, strict=True)}
    except Exception as error:
        return _result(number, conditions, f"{type(error).__name__}: {error}", time.perf_counter() - begin, {})
    return _result(number, conditions, None, seconds, logs)


def _result(
    number: int, conditions: Conditions, failed: str | None, seconds: float, logs: dict[str, Any]
) -> dict[str, Any]:
    about = {"truck": number, "family": conditions.family, "change": " + ".join(conditions.changes) or "none"}
    return {**about, "failed": failed, "seconds": seconds, "logs": logs}


def _scored(answer: Answer, driven: Drive) -> dict[str, Any]:
    return {
        "score": asdict(score(answer, driven.truth, driven.log.time)),
        "wear_m": driven.truth.truck.wear,
        "curve": {key: getattr(answer, key).tolist() for key in ("position", "force", "low", "high")},
        "kept": dict(answer.details),
    }


@checked
def prove(
    name: str,
    numbers: Iterable[int],
    out: str | PathLike[str],
    conditions: Conditions = Conditions(),
    place: Workers = ONE_WORKER,
    progress: Callable[[int, int], None] | None = None,
) -> list[dict[str, Any]]:
    """Run a workflow on the trucks `numbers` and save every result in ``out/NAME/``; existing results are kept.

    The trucks are shared by the worker processes of `place`. A truck that ends its process has failed. The results do
    not depend on the number of workers or on interruptions. The folder of `conditions` other than family A without
    changes is ``out/NAME@FAMILY+CHANGE``.

    Parameters
    ----------
    name : str
        A workflow by name, such as 'paper' or 'calibrated', or MODULE:FUNCTION of one's own.
    numbers : integers
        Of the trucks.
    out : path
        Folder of the results.
    conditions : Conditions
        Family of the trucks, and what changes between calibration and worn recordings.
    place : Workers
        Number of workers, or a scheduler.
    progress : function(done, all), optional
        Called after each truck.

    Returns
    -------
    results : list of dicts
        As in the files: one for each truck, with scores in % of the peak load by recording.

    Raises
    ------
    ParameterError
        For an unknown workflow, family or change, or fewer than one worker.
    ExportError
        If `out` cannot be written, or contains results of other settings.
    SolveError
        If the scheduler is lost; the results before are kept.

    Examples
    --------
    How far the paper's method is off on the first virtual truck, in % of the peak load:

    >>> import clutchid, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (result,) = clutchid.prove("paper", [0], folder)
    >>> 5 < result["logs"]["worn1"]["score"]["load"] < 50
    True
    """
    workflow(name)
    changed(truck(0, conditions.family), *conditions.changes)
    requested = sorted(set(numbers))
    folder = _folder(Path(out), name + conditions.suffix)
    by_number = {n: _read(folder / f"truck_{n:05d}.json") for n in requested}
    todo = [n for n, result in by_number.items() if result is None]
    work = partial(prove_one, name, conditions=conditions)
    for count, finished in enumerate(results(work, todo, place) if todo else (), 1):
        number, outcome = finished.item, finished.result
        result = _result(number, conditions, outcome.message, 0.0, {}) if isinstance(outcome, LostWork) else outcome
        _write(folder / f"truck_{number:05d}.json", result)
        by_number[number] = result
        if progress:
            progress(count, len(todo))
    return [result for result in by_number.values() if result is not None]


def _folder(out: Path, name: str) -> Path:
    """Folder of the results of a workflow for the current settings, created if necessary."""
    folder = out / name.replace(":", "_").replace("/", "_")
    make_folder(folder, "--out")
    settings = _read(folder / "settings.json")
    if settings is None:
        _write(folder / "settings.json", version_and_source())
    elif settings != version_and_source():
        raise ExportError(
            f"{folder}: contains results of another version or fleet; choose another folder or delete it."
        )
    return folder


def _read(path: Path) -> dict[str, Any] | None:
    """Contents of a file of results; None where there is none, or only a part of it, which is made again."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    return content if isinstance(content, dict) else None


def _write(path: Path, content: dict[str, Any]) -> None:
    write_text(json.dumps(content), path)


def stored_results(out: Path, numbers: Iterable[int]) -> dict[str, list[dict[str, Any]]]:
    """Results of all workflows in `out` for the trucks `numbers`, the paper's method first."""
    by_workflow: dict[str, list[dict[str, Any]]] = {}
    for folder in sorted(out.iterdir(), key=lambda path: (path.name != "paper", path.name)):
        if not folder.is_dir() or _read(folder / "settings.json") != version_and_source():
            continue
        results = [result for n in sorted(set(numbers)) if (result := _read(folder / f"truck_{n:05d}.json"))]
        if results:
            by_workflow[folder.name] = results
    return by_workflow


def write_tables(out: Path, numbers: Iterable[int]) -> ReportTable:
    """Write ``standings.csv`` and ``recordings.csv`` of all workflows in a folder, for trucks by number; the standings.

    Raises
    ------
    ExportError
        If they cannot be written.
    """
    results = stored_results(out, numbers)
    table = standings(results)
    write_text(to_csv(table), out / "standings.csv")
    write_text(to_csv(every_recording(results)), out / "recordings.csv")
    return table
