"""Part (f): the fit of part (c) from the start of a process to its result, with nothing compiled and after that."""

from __future__ import annotations

import compileall
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import octave
from equations import chosen_text, python_text
from peer import FloatArray, Peer, Row
from plain import WEIGHTS
from problem import NOISE, THETA, Problem

import clutchid
from clutchid.codegen.cache import TEXTS
from clutchid.model.compiled import write_texts
from estimation import bound, drawn_starts, noisy, posed

#: The second process of a folder has what the first one left there.
CASES = ("cold", "warm")


class Process(NamedTuple):
    """Wall and processor time in s of a process with those that it started, and its weights in N/m."""

    seconds: float
    processor: float
    theta: FloatArray


def installed(folder: Path) -> None:
    """A copy of clutchid in `folder` as a wheel installs it: with its texts, and with byte code."""
    package = folder / "clutchid"
    shutil.copytree(Path(clutchid.__file__).parent, package, ignore=shutil.ignore_patterns("static"))
    texts = package / "codegen" / TEXTS.name
    texts.mkdir(exist_ok=True)
    write_texts(texts)
    compileall.compile_dir(package, quiet=1)


def files(problem: Problem, folder: Path) -> None:
    """The recording, the model as text, and the programs in `folder`."""
    recording, measured, start = problem.given, noisy(problem, 0)["position"], drawn_starts(1)[0]
    np.savez(folder / "given.npz", **recording._asdict(), measured=measured, noise=NOISE, start=start)
    octave.write_search(problem, folder, measured, start)
    (folder / "rates.py").write_text(python_text(problem.values), encoding="utf-8")
    (folder / "chosen.py").write_text(chosen_text(problem.values, WEIGHTS), encoding="utf-8")
    for name in ("fresh.py", "plain.py"):
        shutil.copy(Path(__file__).with_name(name), folder)


def process(command: Sequence[str], folder: Path, installation: Path) -> Process:
    """The program of a peer in a folder, which keeps what is compiled."""
    own = {"PYTHONPATH": str(installation), "CLUTCHID_CACHE": str(folder / "cache")}
    begin, used = time.perf_counter(), _processor()
    ended = subprocess.run(command, cwd=folder, env=os.environ | own, check=True, capture_output=True, text=True)
    return Process(time.perf_counter() - begin, _processor() - used, np.array(ended.stdout.split(), float))


def _processor() -> float:
    """Processor time in s of the processes that this one has waited for, and of those that they have."""
    times = os.times()
    return times.children_user + times.children_system


def peer(*command: str) -> Callable[[Problem], Callable[[Path, Path], Process]]:
    """A peer that is a program, prepared."""
    return lambda _problem: partial(process, command)


def fresh(name: str) -> Callable[[Problem], Callable[[Path, Path], Process]]:
    """A peer of `fresh.py`."""
    return peer(sys.executable, "fresh.py", name)


PEERS = (
    Peer("clutchid.fit", (), fresh("clutchid")),
    Peer("SciPy LSODA, least_squares", ("scipy",), fresh("scipy")),
    Peer("CasADi compiled, least_squares", ("casadi", "gcc"), fresh("casadi")),
    Peer("JAX, least_squares", ("jax",), fresh("jax")),
    Peer("Octave ode45, lsqnonlin", ("octave-optim",), peer(*octave.COMMAND, "search.m")),
)


def rows(seconds: float = 4.0, peers: Sequence[Peer] = PEERS, rounds: int = 3) -> list[Row]:
    """Rows of the first and of the second process of each peer, in turn, each round in a folder of its own."""
    problem = posed(seconds)
    deviations = bound(problem)
    processes: dict[tuple[str, str], list[Process]] = {}
    with tempfile.TemporaryDirectory() as parent:
        installation = Path(parent) / "installed"
        installation.mkdir()
        installed(installation)
        for number in range(rounds):
            for peer in peers:
                if peer.missing():
                    continue
                folder = Path(parent) / f"{peer.name}{number}"
                folder.mkdir()
                files(problem, folder)
                for case in CASES:
                    run = peer.prepare(problem)(folder, installation)
                    processes.setdefault((case, peer.name), []).append(run)
    return [_row(case, peer, processes, deviations) for case in CASES for peer in peers]


def _row(case: str, peer: Peer, processes: dict[tuple[str, str], list[Process]], deviations: FloatArray) -> Row:
    """A line of the table."""
    runs, title = processes.get((case, peer.name)), f"{case.capitalize()}, 4 s at 1000 Hz"
    if runs is None:
        return Row("f", title, peer.name, note=f"absent: {', '.join(peer.missing())} not installed")
    first = processes[case, PEERS[0].name]
    low, middle, high = np.quantile([run.seconds for run in runs], [0.25, 0.5, 0.75])
    ratio = float(np.median([a.seconds / b.seconds for a, b in zip(runs, first, strict=True)]))
    off = max(float(np.max(np.abs(run.theta - THETA) / deviations)) for run in runs)
    processor = float(np.median([run.processor for run in runs]))
    error = f"worst weight off by {off:.2g} σ"
    return Row("f", title, peer.name, middle, low, high, len(runs), ratio, error=error, more=(processor,))
