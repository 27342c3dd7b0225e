"""Part (d): the load weights of each of many recordings in files, by `clutchid fleet` and by loops of a user.

Each way is a command of its own, measured from its start to its end with all of its processes.
"""

from __future__ import annotations

import json
import math
import os
import pickle
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
import psutil
from equations import python_text
from loop import START
from peer import FloatArray, Peer, Row
from problem import NOISE, THETA, Problem, sensitivities
from recorded import casadi_library

from clutchid import Actuator, Load, Log, write, write_parameters
from clutchid.estimation.parameter_file import ParameterFile
from estimation import NEAR, noisy, posed

#: Standard deviation of the true weights from recording to recording, as a share.
SPREAD = 0.03

#: Recordings of a vehicle: the folders of `clutchid fleet`.
VEHICLE = 20

#: Recordings and workers that are compared.
COUNTS, WORKERS = (10, 100, 1000), (1, 2)

#: Longest time of a command in s.
LIMIT = 240.0


class Outcome(NamedTuple):
    """What a command found: weights in N/m and failures by recording, and the seconds that the recordings took."""

    theta: Mapping[str, FloatArray]
    failures: Mapping[str, str]
    busy: float


class Way(NamedTuple):
    """A way to estimate a folder of recordings, the seconds that its compiling took, and what its command has found."""

    command: Callable[[Path, int, Path], list[str]]
    outcome: Callable[[Path], Outcome]
    compiled: float = 0.0


class Command(NamedTuple):
    """A command that has run: seconds, peak memory of all its processes in bytes, and how it ended."""

    seconds: float
    memory: float
    ending: str
    outcome: Outcome


class Truth(NamedTuple):
    """A true load in N/m, and standard deviations of the Cramér-Rao bound of its recording."""

    theta: FloatArray
    deviations: FloatArray


def fleet(problem: Problem) -> Way:
    """`clutchid fleet` from the paper's parameters: the load of each recording from position alone, with its band."""
    del problem
    start = Path(tempfile.mkdtemp()) / "start.toml"
    write_parameters(ParameterFile(Actuator(load=Load(START))), start)

    def command(folder: Path, workers: int, out: Path) -> list[str]:
        options = ["--start", str(start), "--workers", str(workers), "--out", str(out)]
        return [sys.executable, "-m", "clutchid", "fleet", str(folder), *options]

    return Way(command, fleet_outcome)


def fleet_outcome(out: Path) -> Outcome:
    """Weights from the load curves of a fleet, which are their combination of known functions."""
    if not (out / "results.parquet").exists():
        return Outcome({}, {}, 0.0)
    results = pl.read_parquet(out / "recordings" / "**" / "*.parquet", hive_partitioning=True)
    failures = {
        row["recording"]: row["message"]
        for row in results.iter_rows(named=True)
        if row["status"] not in ("ok", "warning")
    }
    theta = {}
    for row in results.filter(pl.col("force_N").is_not_null()).iter_rows(named=True):
        theta[row["recording"]] = np.linalg.lstsq(Load().phi(np.array(row["position_m"])), row["force_N"], rcond=None)[
            0
        ]
    return Outcome(theta, failures, float(results["wall_s"].sum()))


def loop(problem: Problem, kind: str, prepare: Callable[[Problem], dict[str, object]]) -> Way:
    """A user's loop, see `loop.py`, with what `prepare` makes of the problem."""
    begin = time.perf_counter()
    prepared = Path(tempfile.mkdtemp()) / "prepared.pickle"
    prepared.write_bytes(pickle.dumps(prepare(problem)))
    script = Path(__file__).with_name("loop.py")

    def command(folder: Path, workers: int, out: Path) -> list[str]:
        words = [kind, str(prepared), str(folder), str(workers), str(out)]
        return [sys.executable, str(script), *words]

    return Way(command, loop_outcome, time.perf_counter() - begin)


def loop_outcome(out: Path) -> Outcome:
    """Weights from the file that a loop has written."""
    entries = json.loads(out.read_text(encoding="utf-8")) if out.exists() else []
    theta = {entry["name"]: np.array(entry["theta"]) for entry in entries if not entry["failure"]}
    failures = {entry["name"]: entry["failure"] for entry in entries if entry["failure"]}
    return Outcome(theta, failures, sum(entry["seconds"] for entry in entries))


def casadi_libraries(problem: Problem) -> dict[str, object]:
    """Two libraries of CasADi's C: with derivatives, and without."""
    return {"noise": NOISE, "libraries": (casadi_library(problem), casadi_library(problem, columns=False))}


def for_scipy(problem: Problem) -> dict[str, object]:
    """The right-hand side as text, and what is simulated."""
    return {"noise": NOISE, "text": python_text(problem.values), "given": problem.given}


FLEET = "clutchid fleet"
CASADI = "CasADi compiled, least_squares in a Pool"

#: `longest` is the number of recordings here.
PEERS = (
    Peer(FLEET, (), fleet),
    Peer("clutchid.read and fit in a Pool", (), partial(loop, kind="clutchid", prepare=lambda _: {}), 100),
    Peer(CASADI, ("casadi", "gcc"), partial(loop, kind="casadi", prepare=casadi_libraries)),
    Peer("SciPy LSODA, least_squares in a Pool", (), partial(loop, kind="scipy", prepare=for_scipy), 4),
)


def made(folder: Path, count: int, problem: Problem) -> dict[str, Truth]:
    """So many recordings as CSV, each with a load and noise of its own; their true loads by name."""
    random, truths = np.random.default_rng(11), {}
    for seed in range(count):
        own = problem.at(np.array(THETA) * (1 + SPREAD * random.standard_normal(3)))
        J = sensitivities(own, own.drive)() / NOISE
        truths[f"r{seed:04d}"] = Truth(own.point, np.sqrt(np.diag(np.linalg.inv(J.T @ J))))
        save(noisy(own, seed), folder / f"V{seed // VEHICLE:02d}" / f"r{seed:04d}.csv")
    return truths


def save(log: Log, path: Path) -> None:
    """Write a recording as CSV, with its folder."""
    path.parent.mkdir(exist_ok=True, parents=True)
    write(log, path)


def part_of(source: Path, count: int) -> Path:
    """A folder with the first recordings of `source`, as links."""
    folder = Path(tempfile.mkdtemp())
    for path in sorted(source.rglob("*.csv"))[:count]:
        (folder / path.parent.name).mkdir(exist_ok=True)
        os.link(path, folder / path.parent.name / path.name)
    return folder


#: One thread of linear algebra and of polars a worker, as `clutchid fleet` has it.
ENVIRONMENT = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"), "1")


def memory_of(process: psutil.Process) -> float:
    """Memory of a process in bytes, of which what it shares with others is divided among them; 0 once it has ended."""
    try:
        return float(process.memory_full_info().pss)
    except psutil.Error:
        return 0.0


def descendants(process: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """A process and all below it."""
    try:
        parent = psutil.Process(process.pid)
        return [parent, *parent.children(recursive=True)]
    except psutil.Error:
        return []


def run(way: Way, folder: Path, workers: int, limit: float = LIMIT) -> Command:
    """Run a way over a folder."""
    out = Path(tempfile.mkdtemp()) / "out"
    errors = out.with_name("errors")
    environment = {**os.environ, **ENVIRONMENT}
    begin, peak, pause = time.perf_counter(), 0.0, 0.0
    with errors.open("wb") as stream:
        process = subprocess.Popen(
            way.command(folder, workers, out), stdout=subprocess.DEVNULL, stderr=stream, env=environment,
            start_new_session=True,
        )  # fmt: skip
        while True:
            try:
                process.wait(max(0.1, 50 * pause))  # looking at memory takes at most 2 % of a processor
                break
            except subprocess.TimeoutExpired:
                look = time.perf_counter()
                peak = max(peak, sum(map(memory_of, descendants(process))))
                pause = time.perf_counter() - look
                if look - begin > limit:
                    os.killpg(process.pid, signal.SIGKILL)
    seconds = time.perf_counter() - begin
    last = errors.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-1:]
    ending = "" if process.returncode == 0 else f"ended after {limit:.0f} s" if seconds > limit else "".join(last)
    outcome = way.outcome(out)
    shutil.rmtree(out.parent)
    return Command(seconds, peak, ending, outcome)


class Spoiled(NamedTuple):
    """What can happen to a recording: a word for it, and what it makes of the lines of the file."""

    word: str
    lines: Callable[[list[str]], list[str]]


def with_position(value: str, first: int, last: int) -> Callable[[list[str]], list[str]]:
    """The lines with another position, their last column, in some of them; an empty `value` repeats that before."""

    def changed(lines: list[str]) -> list[str]:
        other = value or lines[first - 1].rpartition(",")[2]
        rows = [f"{line.rpartition(',')[0]},{other}" for line in lines[first:last]]
        return [*lines[:first], *rows, *lines[last:]]

    return changed


SPOILED = (
    Spoiled("50 positions NaN", with_position("NaN", 2000, 2050)),
    Spoiled("cut off in a line", lambda lines: [*lines[:2500], lines[2500][:9]]),
    Spoiled("empty file", lambda _: []),
    Spoiled("a word for a number", with_position("overflow", 2000, 2001)),
    Spoiled("position stuck from 1.5 s on", with_position("", 1800, 100_000)),
)


def spoil(folder: Path) -> dict[str, str]:
    """Spoil recordings of a folder, among the others; what happened to them by name."""
    paths = sorted(folder.rglob("*.csv"))
    chosen = paths[len(paths) // len(SPOILED) - 1 :: len(paths) // len(SPOILED)]
    for path, how in zip(chosen, SPOILED, strict=True):
        text = "\n".join(how.lines(path.read_text(encoding="utf-8").splitlines()))
        path.unlink()  # a link to the whole one
        path.write_text(text, encoding="utf-8")
    return {path.stem: how.word for path, how in zip(chosen, SPOILED, strict=True)}


def off(theta: FloatArray, truth: Truth) -> float:
    """Error of the worst weight in standard deviations of the bound."""
    return float(np.max(np.abs(theta - truth.theta) / truth.deviations))


def error(outcome: Outcome, truths: Mapping[str, Truth], spoiled: Mapping[str, str]) -> str:
    """How many of the whole recordings have been estimated, and how well."""
    errors = [off(theta, truths[name]) for name, theta in outcome.theta.items() if name not in spoiled]
    if not errors:
        return "none estimated"
    near = sum(distances < NEAR for distances in errors)
    return f"{near} of {len(truths) - len(spoiled)} succeeded, worst weight off by {np.median(errors):.2g} σ (median)"


def words_on_spoiled(outcome: Outcome, truths: Mapping[str, Truth], spoiled: Mapping[str, str]) -> str:
    """What came of the spoiled recordings."""
    fates: dict[str, list[str]] = {"refused": [], "right": [], "wrong": [], "lost": []}
    for name, word in spoiled.items():
        if name in outcome.theta:
            distance = off(outcome.theta[name], truths[name])
            fates["right" if distance < NEAR else "wrong"].append(f"{word} ({distance:.2g} σ)")
        else:
            fates["refused" if name in outcome.failures else "lost"].append(word)
    return "; ".join(f"{fate}: {', '.join(words)}" for fate, words in fates.items() if words)


class Case(NamedTuple):
    """A folder of recordings with their true loads, and those that are spoiled, for some workers."""

    name: str
    folder: Path
    truths: Mapping[str, Truth]
    workers: int
    spoiled: Mapping[str, str] = {}


def row(case: Case, peer: Peer, way: Way, command: Command, count: int) -> Row:
    """The row of a command that has run on so many of the recordings, scaled to all of them."""
    seconds, whole = command.seconds + way.compiled, len(case.truths)
    beside = max(0.0, seconds - command.outcome.busy / case.workers)
    seconds = beside + (seconds - beside) * whole / count
    truths = {name: case.truths[name] for name in sorted(case.truths)[:count]}
    notes = [
        f"{whole / seconds:.3g} a second, {1e3 * seconds / whole:.3g} ms each, {command.memory / 1e6:.0f} MB, "
        f"{len(command.outcome.failures)} failed",
        f"timed on {count} and scaled" if count < whole else "",
        words_on_spoiled(command.outcome, truths, case.spoiled),
        command.ending[:200],
    ]
    return Row(
        "d", case.name, peer.name, seconds, seconds, seconds, 1, math.nan, beside,
        error(command.outcome, truths, case.spoiled), "; ".join(filter(None, notes)),
    )  # fmt: skip


def compared(case: Case, ways: Mapping[Peer, Way], commands: dict[tuple[str, int, int], Command]) -> list[Row]:
    """The rows of a case; a slow peer runs once on fewer recordings, and stands scaled in the rows of more."""
    rows_of_case = []
    for peer, way in ways.items():
        count = int(min(len(case.truths), peer.longest))
        key = peer.name, count, case.workers
        if key not in commands or case.spoiled:
            folder = case.folder if count == len(case.truths) else part_of(case.folder, count)
            commands[key] = run(way, folder, case.workers)
        rows_of_case.append(row(case, peer, way, commands[key], count))
    return [line._replace(ratio=line.median / rows_of_case[0].median) for line in rows_of_case]


def rows(count: int = COUNTS[-1], peers: Sequence[Peer] = PEERS) -> list[Row]:
    """The rows of up to `count` recordings, with one worker and with two, and of a hundred with spoiled ones."""
    problem = posed(4.0)
    absent = {peer.name: peer.missing() for peer in peers if peer.missing()}
    ways, commands = {peer: peer.prepare(problem) for peer in peers if peer.name not in absent}, {}
    whole = Path(tempfile.mkdtemp())
    truths, rows_of_cases = made(whole, count, problem), []
    for number in [size for size in COUNTS if size <= count]:
        folder = whole if number == count else part_of(whole, number)
        own = {name: truths[name] for name in sorted(truths)[:number]}
        for workers in WORKERS:
            words = f"{number} recordings of 4.3 s, {workers} worker{'s' if workers > 1 else ''}"
            rows_of_cases += compared(Case(words, folder, own, workers), ways, commands)
    number = min(count, 100)
    folder, own = part_of(whole, number), {name: truths[name] for name in sorted(truths)[:number]}
    case = Case(f"{number} recordings with {len(SPOILED)} spoiled ones, 2 workers", folder, own, 2, spoil(folder))
    rows_of_cases += compared(case, {peer: way for peer, way in ways.items() if peer.longest >= number}, commands)
    names = dict.fromkeys(row.case for row in rows_of_cases)
    return rows_of_cases + [
        Row("d", name, peer, note=f"absent: {', '.join(lacking)} not installed")
        for name in names
        for peer, lacking in absent.items()
    ]
