"""clutchid side by side with what a user would take instead: ``python benchmarks/peers/run.py [--only a,b]``.

Same equations, same work, one run of one machine; every row has its error beside its time. Peers that are not installed
are named as absent; ``pip install -r benchmarks/peers/requirements.txt`` brings those that pip has, beside clutchid;
its first lines name the others.

(a) one simulation, (b) with sensitivities, (c) an estimation of three load weights from many starts, (d) that of
each of a thousand recordings, (e) one step of the observer, (f) a fit from the start of a process, (g) reading of
files, (h) ten thousand simulations. ``--from FILE`` writes the page of a run that ``--json FILE`` kept. ``--only e,f``
takes about five minutes, with ``--rounds 1`` two; ``--only d`` five, with ``--recordings 100`` two.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import math
import os
import platform
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import batch
import cold
import formats
import observers
import recordings
import sensitivities
from ekf import WARM
from ekf_in_c import FLAGS
from peer import Peer, Row

import estimation
import simulation

PACKAGES = (
    "clutchid", "numpy", "scipy", "numba", "casadi", "jax", "diffrax", "scikit-sundae", "filterpy", "archimedes",
    "aeroid", "asammdf", "polars",
)  # fmt: skip


#: Key of the machine's load before a run, which differs from part to part.
LOAD = "load at the start"


class Part(NamedTuple):
    """A part of the comparison: a title, what the reader must know, its rows, and what the targets are held against.

    `more` are the titles of the times that its rows have beside the quartiles.
    """

    title: str
    words: str
    rows: Callable[[argparse.Namespace], list[Row]]
    targets: Callable[[Sequence[Row], argparse.Namespace], list[str]]
    more: tuple[str, ...] = ()


def compared(rows: Sequence[Row], case: str, peer: str) -> float:
    """Ratio of a peer to clutchid in a case; NaN where it did not run."""
    return next((row.ratio for row in rows if (row.case, row.peer) == (case, peer)), math.nan)


def judged(what: str, value: float, limit: float, least: bool = False) -> str:
    """A target with the measured value."""
    if math.isnan(value):
        return f"{what}: not measured."
    met = value >= limit if least else value <= limit
    return f"{what}: {value:.3g}, target at {'least' if least else 'most'} {limit:g}, {'met' if met else '**missed**'}."


def simulation_targets(rows: Sequence[Row], options: argparse.Namespace) -> list[str]:
    """Time of the loop over that of C."""
    del options
    cases = dict.fromkeys(row.case for row in rows)
    return [judged(f"{case}, loop over C", 1 / compared(rows, case, simulation.PEERS[2].name), 0.75) for case in cases]


def sensitivity_targets(rows: Sequence[Row], options: argparse.Namespace) -> list[str]:
    """Columns over one run, and CasADi's C over clutchid."""
    del options
    targets = []
    for case in dict.fromkeys(row.case for row in rows):
        limit = {"3": 1.8, "15": 4.0}.get(case.partition(" ")[0])
        if limit is not None:
            targets.append(judged(f"{case}, over one run", 1 / compared(rows, case, sensitivities.ONE_RUN), limit))
        ratio = compared(rows, case, "CasADi, Runge-Kutta, compiled")
        targets.append(judged(f"{case}, CasADi compiled over clutchid", ratio, 5.0, least=True))
    return targets


def estimation_targets(rows: Sequence[Row], options: argparse.Namespace) -> list[str]:
    """The best peer over clutchid, and coverage."""
    best = min((row for row in rows[1:] if row.runs), key=lambda row: row.ratio, default=None)
    words = f"best peer ({best.peer}) over clutchid" if best else "best peer over clutchid"
    targets = [judged(words, best.ratio if best else math.nan, 10.0, least=True)]
    if options.seeds:
        targets += [estimation.coverage(options.seeds, rest=rest) for rest in (estimation.REST, 0.0)]
    return targets


def recordings_targets(rows: Sequence[Row], options: argparse.Namespace) -> list[str]:
    """The best loop over `clutchid fleet`, with two workers."""
    case = f"{options.recordings} recordings of 4.3 s, 2 workers"
    others = [row for row in rows if row.case == case and row.runs and not row.peer.startswith("clutchid")]
    best = min(others, key=lambda row: row.ratio, default=None)
    words = f"{case}, best peer ({best.peer}) over {recordings.FLEET}" if best else case
    return [judged(words, best.ratio if best else math.nan, 1.0, least=True)]


def observer_targets(rows: Sequence[Row], options: argparse.Namespace) -> list[str]:
    """The C of Archimedes over that of clutchid."""
    del options
    names = [peer.name for peer in observers.IN_C if peer.name.startswith(observers.ARCHIMEDES)]
    ratios = [(row.ratio, row.peer) for row in rows if row.peer in names and row.runs]
    ratio, name = min(ratios, default=(math.nan, observers.ARCHIMEDES))
    return [judged(f"{name}, over clutchid's exported C", ratio, 1.0, least=True)]


SIMULATION = """The actuator of the paper, five states, on random strokes. clutchid, C, CasADi and JAX take the same
Runge-Kutta steps of 1 ms, so these rows compare speed at the same error. Solvers with steps of their own (relative
tolerance 1e-6, started anew at every edge of an input) are more exact. Error: largest difference of position and
pressure from steps 64 times finer. The 18 µm are an instant at an impact on the far stop, which one step of 1 ms
meets; the noise of a sensor is 50 µm."""

SENSITIVITIES = f"""Derivatives of the position to the load weights, then also to
{", ".join(sensitivities.SEVEN[3:])}, then also to {", ".join(sensitivities.FIFTEEN[7:])}. Those of clutchid, CasADi's
Runge-Kutta and JAX are exact for the discretised system, the steps of 1 ms, which is what a search needs. Error:
difference from the derivatives of steps 64 times finer, of the worst column. With three and seven parameters all of
it that exceeds 2 % are 9 of 10,000 samples, in three impacts on the far stop, and the median is 0.03 %; with
fifteen the worst column is the mass (`python benchmarks/peers/sensitivities.py`). Differences as `least_squares`
makes them have the noise of a solver's own steps, over the step of the difference."""

ESTIMATION = """Three load weights from 4 s of position at 1 kHz: the reference (steps 64 times finer) with 30 µm of
white noise, from ten starts. A search has succeeded if every weight is within five standard deviations (σ) of the
Cramér-Rao bound. clutchid's time includes its inspection of the recording, covariance and verdict, the peers' only
the search. The peers are given the true start of the piston; clutchid takes it from the rest before the first
stroke."""

RECORDINGS = """CSV files as in [an estimation](#an-estimation), each with noise and a load of its own. Each way is
a command from start to end. `clutchid fleet` also checks every recording, draws its load with a band, and keeps
results for an interrupted run. A loop is a Pool of `multiprocessing` with `least_squares`; what it compiles is in
*first run*. JAX is not among them: its traced functions did not end in the workers of a Pool. Memory is that of all
processes."""

OBSERVER = f"""A recording as in [an estimation](#an-estimation), of 20 s, followed from the load of the paper:
every filter predicts over 1 ms by Runge-Kutta and updates by the position, with the same prior and noise, in
double. The peers are extended Kalman filters of 8 states with a covariance. clutchid's has 6 states and a root of
the covariance with 9 columns, and also looks for frozen sensors, holes, outliers and a moved rest. *clutchid,
exported C* and all rows from Python correct at every sample, as the peers do; *as shipped* it corrects at every
tenth. C is compiled by `gcc {" ".join(FLAGS)}`. Each step is timed alone; the first {WARM} do not count. Error: rms
of the pressure in chamber A, and of the load over the stroke at the end, in % of its peak."""

COLD = """The first start of [an estimation](#an-estimation), a whole process. *Cold*, nothing is compiled but the
byte code of the packages; *warm* is the second process, with what the first left on disk (JAX's compilation cache
switched on). *Processor* is the time of all processors, with that of the C compiler."""

FILES = """Position, duty cycles and pressure. `clutchid.read` finds format, channels and units, and checks time and
values; the packages alone are given the names of the columns and return arrays."""


BATCH = """The positions of simulations of one recording, whose three load weights differ. A thread a processor
where the row says so."""


def wanted(peers: Sequence[Peer], options: argparse.Namespace) -> list[Peer]:
    """Peers whose names do not begin with one that is left out."""
    left_out = tuple(name for name in options.without.split(",") if name)
    return [peer for peer in peers if not peer.name.startswith(left_out)] if left_out else list(peers)


def simulated(options: argparse.Namespace) -> list[Row]:
    """Rows of part (a)."""
    return simulation.rows(peers=wanted(simulation.PEERS, options), rounds=options.rounds)


def differentiated(options: argparse.Namespace) -> list[Row]:
    """Rows of part (b)."""
    return sensitivities.rows(peers=wanted(sensitivities.PEERS, options), rounds=options.rounds)


def estimated(options: argparse.Namespace) -> list[Row]:
    """Rows of part (c)."""
    return estimation.rows(starts=options.starts, peers=wanted(estimation.PEERS, options))


def of_many(options: argparse.Namespace) -> list[Row]:
    """Rows of part (d)."""
    return recordings.rows(options.recordings, wanted(recordings.PEERS, options))


def observed(options: argparse.Namespace) -> list[Row]:
    """Rows of part (e)."""
    peers = (wanted(group, options) for group in (observers.IN_PYTHON, observers.IN_C))
    return observers.rows(20.0, *peers, rounds=options.rounds)


def started(options: argparse.Namespace) -> list[Row]:
    """Rows of part (f)."""
    return cold.rows(peers=wanted(cold.PEERS, options), rounds=min(options.rounds, 3))


def read(options: argparse.Namespace) -> list[Row]:
    """Rows of part (g)."""
    return formats.rows(rounds=options.rounds)


def of_batches(options: argparse.Namespace) -> list[Row]:
    """Rows of part (h)."""
    return batch.rows(options.simulations, wanted(batch.PEERS, options), min(options.rounds, 5))


def batch_targets(rows: Sequence[Row], options: argparse.Namespace) -> list[str]:
    """`simulate_many` against C on one thread, and the wanted time."""
    if not rows or options.simulations != batch.COUNT:
        return []
    below = compared(rows, rows[0].case, batch.IN_C)
    return [
        judged("ten thousand simulations in s", rows[0].median, 0.5),
        judged("C on one thread over `simulate_many`", below, 1.0, least=True),
    ]


def no_targets(_rows: Sequence[Row], _options: argparse.Namespace) -> list[str]:
    """For a part without targets."""
    return []


PARTS = {
    "a": Part("One simulation", SIMULATION, simulated, simulation_targets),
    "b": Part("With sensitivities", SENSITIVITIES, differentiated, sensitivity_targets),
    "c": Part("An estimation", ESTIMATION, estimated, estimation_targets),
    "d": Part("A thousand recordings", RECORDINGS, of_many, recordings_targets),
    "e": Part("One step of the observer", OBSERVER, observed, observer_targets, ("p99", "p99.9")),
    "f": Part("From a cold machine and a warm one", COLD, started, no_targets, ("processor",)),
    "g": Part("Reading of files", FILES, read, no_targets),
    "h": Part("Ten thousand simulations", BATCH, of_batches, batch_targets),
}


def machine() -> dict[str, str]:
    """Processor, Python and versions of packages and programs; those that are absent are left out."""
    facts = {"processor": platform.processor() or platform.machine(), "cores": str(os.cpu_count())}
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [line.partition(":")[2].strip() for line in info.read_text().splitlines() if "model name" in line]
        facts["processor"] = models[0] if models else facts["processor"]
    if hasattr(os, "getloadavg"):
        facts[LOAD] = f"{os.getloadavg()[0]:.1f}"
    facts["Python"] = platform.python_version()
    for name in PACKAGES:
        try:
            facts[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    for program in ("gcc", "octave-cli"):
        try:
            process = subprocess.run([program, "--version"], check=True, capture_output=True, text=True)
            facts[program] = process.stdout.splitlines()[0].split()[-1]
        except (OSError, subprocess.CalledProcessError):
            continue
    return facts


def seconds(value: float) -> str:
    """A time with a unit of its size; nothing for one that was not measured."""
    if math.isnan(value):
        return ""
    for unit, factor in (("ns", 1e9), ("µs", 1e6), ("ms", 1e3)):
        if value * factor < 1000:
            return f"{value * factor:.3g} {unit}"
    return f"{value:.4g} s"


#: Beginnings of cases that are between two others of the page: their rows stand in the file of rows only.
BETWEEN = ("100 recordings of", "10 recordings of 4.3 s, 2", "10 s at 1000 Hz")

#: Peers that nobody would choose beside a better one of the same package.
BESIDE = {
    "SciPy, RK45", "SciPy, Radau", "SciPy RK45, least_squares", "CasADi, Runge-Kutta", "CasADi, CVODES",
    "SciPy, LSODA, differences by default", "CasADi, compiled, map on threads",
}  # fmt: skip


def table(rows: Sequence[Row], more: Sequence[str] = ()) -> list[str]:
    """Lines of Markdown, a table a case, without rows scaled from another; `more` are titles of further times."""
    text: list[str] = []
    titles = ["", "median", *more, "over clutchid", "error", "first run", ""]
    for case in dict.fromkeys(row.case for row in rows if not row.case.startswith(BETWEEN)):
        text += ["", f"**{case}**", "", line(titles), "|" + "---|" * len(titles)]
        for row in (row for row in rows if row.peer not in BESIDE):
            if row.case == case and not row.runs:
                text.append(line([row.peer, *[""] * (len(titles) - 2), row.note]))
            elif row.case == case and not row.note.startswith("scaled from"):
                times = [seconds(row.median), *map(seconds, row.more)]
                text.append(line([row.peer, *times, f"{row.ratio:.3g}", row.error, seconds(row.prepared), row.note]))
    return text


def line(cells: Sequence[str]) -> str:
    """A row of a table in Markdown."""
    return "".join(f"| {cell} " if cell else "| " for cell in cells) + "|"


INTRODUCTION = """clutchid and what a user would take instead, on the same equations and the same work. This page is
what the commands below wrote: medians in turn, a ratio above 1 where the peer takes longer; *first run* includes
what a peer compiles. clutchid's kernels were in its cache, except in the comparison of cold and warm starts. Slower
variants of the same packages, quartiles and other sizes are in `benchmarks/results/peers.json`."""

NOT_AHEAD = """## Where clutchid is not ahead

- **Exactness.** At an impact on a stop a step of 1 ms is too long for an error below a micrometre, of states and of
  derivatives. Solvers with steps of their own are exact there.
- **Short recordings.** `clutchid.simulate` checks the log and makes one of all states; for a second of recording that
  takes about as long as the loop.
- **Estimation.** `least_squares` on compiled CasADi takes 2.3 times as long, where ten times was the target.
- **Few recordings.** `clutchid fleet` starts processes and keeps results: for ten recordings a loop over `clutchid.fit`
  is three times as fast, for a thousand a tenth faster.
- **Files.** Reading takes longer than by the package of the format alone.
- **Single samples from Python.** `clutchid.observe` checks each block: a call with one sample takes less than a step
  of Archimedes or filterpy, but longer than one of CasADi or JAX. Give it blocks, or export the C.
- **The first fit of a new process.** With nothing compiled SciPy, JAX and CasADi have their results first; with
  everything compiled CasADi has."""


class PartResult(NamedTuple):
    """A part that has run: its command, the machine, its rows, and what the targets are held against."""

    command: str
    machine: dict[str, str]
    rows: list[Row]
    targets: list[str]


def listed(versions: dict[str, str]) -> str:
    """Names and values, with commas."""
    return ", ".join(f"{name} {value}" for name, value in versions.items())


def page(sections: dict[str, PartResult]) -> str:
    """The page as Markdown."""
    usual = {name: value for part in sections.values() for name, value in part.machine.items() if name != LOAD}
    text = ["# Side by side", "", INTRODUCTION, "", f"Machine and versions: {listed(usual)}."]
    for key in sorted(sections):
        part = sections[key]
        own = {name: value for name, value in part.machine.items() if usual.get(name) != value}
        text += [
            "",
            f"## {PARTS[key].title}",
            "",
            PARTS[key].words,
            "",
            f"`{part.command}`; {listed(own)}".rstrip("; "),
        ]
        text += table(part.rows, PARTS[key].more)
        text += ["", *(f"- {line}" for line in part.targets)] if part.targets else []
    return "\n".join([*text, "", NOT_AHEAD]) + "\n"


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=",".join(PARTS), help="parts, with commas")
    parser.add_argument("--without", default="", help="beginnings of the names of peers to leave out, with commas")
    parser.add_argument("--rounds", type=int, default=15, help="of a fast peer")
    parser.add_argument("--starts", type=int, default=20, help="of an estimation")
    parser.add_argument("--seeds", type=int, default=1000, help="noise seeds for the coverage of intervals; 0 for none")
    parser.add_argument(
        "--recordings", type=int, default=1000, help="most recordings that are estimated: 10, 100, 1000"
    )
    parser.add_argument("--simulations", type=int, default=batch.COUNT, help="at once, of part h")
    parser.add_argument("--json", type=Path, help="file for all rows; parts that it has already stay")
    parser.add_argument("--from", dest="source", type=Path, help="such a file, whose page is written without a run")
    parser.add_argument("--out", type=Path, help="file for the page; else it is printed")
    return parser.parse_args(arguments)


def measured(options: argparse.Namespace) -> dict[str, PartResult]:
    """Run the parts; after each, what is there is kept in the file for rows, beside the other parts in it."""
    versions, defaults = machine(), parsed([])
    sections = {
        name: getattr(options, name)
        for name in ("only", "without", "rounds", "starts", "seeds", "recordings", "simulations")
    }
    chosen = [f"--{name} {value}" for name, value in sections.items() if value != getattr(defaults, name)]
    command = " ".join(["python benchmarks/peers/run.py", *chosen])
    results = read_results(options.json) if options.json and options.json.exists() else {}
    for key in options.only.split(","):
        rows = PARTS[key].rows(options)
        results[key] = PartResult(command, versions, rows, PARTS[key].targets(rows, options))
        if options.json:
            content = {
                k: part._asdict() | {"rows": [row._asdict() for row in part.rows]} for k, part in results.items()
            }
            options.json.write_text(json.dumps(finite(content), indent=1) + "\n", encoding="utf-8")
    return results


def read_results(path: Path) -> dict[str, PartResult]:
    """Results of earlier runs."""
    results = {}
    for key, part in json.loads(path.read_text(encoding="utf-8")).items():
        rows = [Row(**{k: math.nan if v is None else v for k, v in row.items()}) for row in part["rows"]]
        rows = [row._replace(more=tuple(math.nan if v is None else v for v in row.more)) for row in rows]
        results[key] = PartResult(**(part | {"rows": rows}))
    return results


def finite(value: object) -> object:
    """The value with None for numbers that are not finite, as JSON has none."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(inner) for inner in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def main() -> None:
    """Run the parts, or take an earlier run, and write the page."""
    options = parsed()
    text = page(read_results(options.source) if options.source else measured(options))
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
