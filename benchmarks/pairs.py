"""Is another truck's calibration recognised? ``python benchmarks/pairs.py OUT --family A --family B --trucks 24``.

Every truck is calibrated once with pressure, into ``OUT/A_00000.toml``. Then recordings of worn clutches are read from
position alone: those of all other trucks ("pair"), those of its own truck under the cases of `readings.py`, with the
supply pressure recorded and without ("right"), and with leaks of chamber A, alone and beside other changes
("leak 1e-10"), and its own calibration recording ("calibration"). ``--kind`` takes one of these kinds. The order is
drawn so that a part of a run is a fair sample of all; ``--budget SECONDS`` ends it, and a further run goes on where it
ended.

Each reading is a line of ``OUT/readings.jsonl``: what was read, the verdict of today, and all that a rule may use, so
that rules are judged without reading again: ``python benchmarks/pairs.py OUT --analyse``. For the k free parameters of
the reading and the m others that differ between trucks (`names`, with `mean`, `width` and `positive` of their
coordinates), `R` is the triangular factor ``[R | q]`` of the data at `x`, by rows; `posterior` and `std` are those of
the mixture over `hypotheses`.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

#: Leaks of chamber A in m³/(Pa·s).
LEAKS = (5e-11, 1e-10, 1.5e-10, 2e-10, 2.5e-10, 4e-10)

#: The leak that begins beside other changes, and these.
BESIDE = 1e-10, ("supply and warm", "supply and cold", "cold and valves")

#: Parameters that differ between trucks, but are not freed in a reading.
FIXED = ("P_0", "M", "D_zdot", "V_0B", "b_vs", "m_vs", "b_ve", "m_ve", "gamma", "h_B", "tau_S", "tau_G", "F_h", "K_h")

#: Digits of stored numbers.
DIGITS = 6


class Item(NamedTuple):
    """A recording of truck `number` under a case, to be read with the calibration of truck `calibration`."""

    family: str
    calibration: int
    number: int
    case: str
    recorded: str = "position"

    @property
    def key(self) -> str:
        """Key of the reading in the file."""
        return "/".join(map(str, self))


def items(family: str, calibration: int, numbers: Sequence[int]) -> list[tuple[float, Item]]:
    """All readings with a calibration, by their place in the order of all; each kind is spread evenly."""
    from readings import CASES, WITHOUT_AIR

    rng = np.random.default_rng([calibration, ord(family), 49])
    kinds = (
        [Item(family, calibration, other, "pair") for other in numbers if other != calibration],
        [Item(family, calibration, calibration, case, recorded) for case in CASES for recorded in WITHOUT_AIR],
        [Item(family, calibration, calibration, f"leak {leak:g}") for leak in LEAKS]
        + [Item(family, calibration, calibration, f"leak {BESIDE[0]:g}, {case}") for case in BESIDE[1]],
    )
    placed = [(0.0, Item(family, calibration, calibration, "calibration"))]
    for kind in kinds:
        places = (np.arange(len(kind)) + rng.uniform()) / max(1, len(kind))
        placed += [(float(place), kind[i]) for place, i in zip(places, rng.permutation(len(kind)), strict=True)]
    return placed


def calibration_file(folder: Path, family: str, number: int) -> Path:
    """Where the calibration of a truck is kept."""
    return folder / f"{family}_{number:05d}.toml"


def calibrate(folder: Path, family: str, number: int) -> float:
    """Make the calibration of a truck; seconds of processor time."""
    from readings import calibration_of

    begin = time.process_time()
    path = calibration_file(folder, family, number)
    part = path.with_suffix(".part.toml")
    calibration_of(number, family, part)
    part.rename(path)
    return time.process_time() - begin


def recording(item: Item) -> tuple[Any, Any]:
    """The recording of an item without its pressure, and the truth."""
    from readings import LACKING
    from widening import SECONDS, seeds, worn_clutch

    from clutchid.truck import drive, truck

    if item.case == "calibration":
        kind = truck(item.number, item.family)
        made = drive(kind, seconds=SECONDS, seed=seeds(item.number)[0], name="worn", conditions=True)
    elif item.case.startswith("leak "):
        kind = truck(item.number, item.family)
        leak, _, case = item.case.removeprefix("leak ").partition(", ")
        leaking = kind.replace({"C_A0": kind.C_A0 + float(leak)})
        made = worn_clutch(item.number, item.family, case or "nothing", kind=leaking)
    else:
        made = worn_clutch(item.number, item.family, "nothing" if item.case == "pair" else item.case)
    without = [name for name in ("pressure_a", *LACKING[item.recorded]) if name in made.log]
    return made.log.without(*without), made.truth


def read(folder: Path, item: Item) -> dict[str, Any]:
    """One reading, as plain values; `refused` says why there is none."""
    from clutchid import FitRequest, fit
    from clutchid.errors import ClutchidError
    from clutchid.estimation import calibrate as module
    from clutchid.estimation.parameter_file import read_parameters
    from clutchid.truck import GRID

    content: dict[str, Any] = {**item._asdict(), "key": item.key}
    once = read_parameters(calibration_file(folder, item.family, item.calibration))
    log, truth = recording(item)
    explanations: dict[Any, Any] = {}
    explained = module.explained

    def remembered(*arguments: Any) -> Any:
        explanations.update(explained(*arguments))
        return explanations

    begin = time.process_time()
    module.explained = remembered
    try:
        result = fit(log, once.actuator, request=FitRequest(calibration=once.calibration), on_failure="return")
    except ClutchidError as error:
        return {**content, "refused": str(error)}
    finally:
        module.explained = explained
    content |= {"seconds": time.process_time() - begin, "status": result.status, "evaluations": result.evaluations}
    content |= verdict_of(result) | load_of(result, once, truth.load(GRID), GRID)
    if explanations:
        content["searches"] = [[e.solution.status, e.solution.evaluations] for e in explanations.values()]
        content |= evidence_of(explanations, once, log)
        content["nis"] = observed(log, once)
    return rounded(content)


def verdict_of(result: Any) -> dict[str, Any]:
    """The verdict of today and what it is made from."""
    from clutchid.estimation.assess.reasons import expected_error
    from clutchid.estimation.assess.verdict import verdict

    judged = verdict(result)
    departure = result.departure
    rest = next(iter(result.recordings.values())).rest if result.recordings else None
    return {
        "trust": judged.trust,
        "reasons": list(judged.reasons),
        "converged": result.converged,
        "departure": list(departure) if departure else None,
        "expected_error": expected_error(result) if departure else None,
        "changes": [[c.name, c.before, c.after, c.std, c.probability] for c in result.changes],
        "rest": rest.value if rest else None,
    }


def load_of(result: Any, once: Any, true: np.ndarray, grid: np.ndarray) -> dict[str, Any]:
    """The load that was read with its band, the true one, and that of the calibration, in N."""
    curve = result.load_curve
    return {
        "true": true,
        "load": np.interp(grid, curve.position, curve.force),
        "low": np.interp(grid, curve.position, curve.low),
        "high": np.interp(grid, curve.position, curve.high),
        "calibrated": once.actuator.load.force(grid),
    }


def evidence_of(explanations: dict[Any, Any], once: Any, log: Any) -> dict[str, Any]:
    """Posterior over the hypotheses, and the information of the data about all that differs between trucks."""
    from clutchid.estimation.departure import relative_misfit
    from clutchid.estimation.hypotheses import hypothesis_score, mixture, most_probable
    from clutchid.inference.smoother.problem import data_factor, linearise
    from clutchid.inference.uncertainty.change_prior import HYPOTHESES
    from clutchid.inference.uncertainty.coordinates import coordinates
    from clutchid.numerics.failure import Failure

    calibration = once.calibration
    best = explanations[most_probable(explanations, calibration)]
    problem, at = best.result.problem, best.solution
    weighed = mixture(explanations, calibration)
    bases = {c.base for c in problem.coordinates}
    actuator = problem.actuator
    fixed = [n for n in FIXED if n in actuator.acting and n not in bases and actuator.value(n) != 0.0]
    extra = coordinates(actuator, fixed, {}, {})
    wide = problem.widened(extra)
    x = np.concatenate([at.x, np.zeros(len(extra))])
    linear = linearise(wide, x, at.at.X)
    factor = None if isinstance(linear, Failure) else data_factor(wide, linear)
    usual = calibration.position_only
    return {
        "T_pwm": actuator.parameters.T_pwm,
        "names": [c.base for c in wide.coordinates],
        "mean": [c.mean for c in wide.coordinates],
        "width": [c.width for c in wide.coordinates],
        "positive": [c.positive for c in wide.coordinates],
        "changing": [i for i, c in enumerate(problem.coordinates) if c.name in problem.changing],
        "x": at.x,
        "posterior": weighed.x,
        "std": np.sqrt(np.diag(weighed.covariance)),
        "hypotheses": ["+".join(h) for h in weighed.hypotheses],
        "probabilities": weighed.probabilities,
        "searched": ["+".join(h) for h in explanations],
        "misfits": [
            relative_misfit(explanation.solution.at.cost, [log], calibration) for explanation in explanations.values()
        ],
        "costs": [explanation.solution.at.cost for explanation in explanations.values()],
        "scores": [hypothesis_score(explanation.under(h), h, calibration) for h, explanation in explanations.items()],
        "best": "+".join(most_probable(explanations, calibration)),
        "all_scores": [hypothesis_score(explanations.get(h, best).under(h), h, calibration) for h in HYPOTHESES],
        "dispersion": usual.dispersion if usual else 1.0,
        "R": None if factor is None else factor[np.triu_indices_from(factor)],
    }


def observed(log: Any, once: Any) -> float:
    """Mean of the innovations of the joint observer over those of the calibration recordings; NaN if it refuses."""
    from clutchid.errors import ClutchidError
    from clutchid.observer import observe_recording, observer

    try:
        return float(observe_recording(observer(once.actuator, calibration=once.calibration), log).after.mismatch)
    except ClutchidError:
        return float("nan")


def rounded(value: Any) -> Any:
    """Plain values with `DIGITS` digits."""
    if isinstance(value, dict):
        return {key: rounded(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [rounded(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


def compiled(variant: str) -> None:
    """Compile the kernels of a model variant."""
    from clutchid.model.compiled import compile_ahead

    compile_ahead([variant])


def driven(family: str) -> None:
    """Compile the loop of a family's trucks."""
    from clutchid.truck import drive, truck

    drive(truck(0, family), seconds=1.0, seed=0)


def stored(path: Path) -> list[dict[str, Any]]:
    """The readings of a file; a line that was cut off is left out."""
    readings = []
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                readings.append(json.loads(line))
            except ValueError:
                continue
    return readings


def read_all(folder: Path, wanted: Sequence[tuple[float, Item]], workers: int, budget: float) -> None:
    """Calibrate and read until all is there or the budget is spent; then the workers are ended."""
    begin, path = time.perf_counter(), folder / "readings.jsonl"
    there = {entry["key"] for entry in stored(path)}
    queue = [item for _, item in sorted(wanted, key=lambda pair: pair[0]) if item.key not in there]
    needed = sorted({(item.family, item.calibration) for item in queue}, reverse=True)
    missing = [entry for entry in needed if not calibration_file(folder, *entry).exists()]
    ready = set(needed) - set(missing)
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    from clutchid.model.variants import VARIANTS

    ahead = [pool.submit(driven, family) for family, _ in {entry[0]: entry for entry in needed}.items()]
    ahead += [pool.submit(compiled, variant) for variant in VARIANTS if "energy" in variant]
    wait(ahead, budget)
    print(f"compiled after {time.perf_counter() - begin:.0f} s", flush=True)
    calibrations = {pool.submit(calibrate, folder, *entry): entry for entry in missing}
    running: dict[Future[Any], Any] = {}
    count = 0
    with path.open("a", encoding="utf-8") as file:
        while (queue or running) and time.perf_counter() - begin < budget:
            free = workers - len(running) - len(calibrations)
            chosen = [item for item in queue if (item.family, item.calibration) in ready][: max(0, free)]
            for item in chosen:
                queue.remove(item)
                running[pool.submit(read, folder, item)] = item
            if not running and not calibrations:
                break
            ended, _ = wait([*running, *calibrations], 5.0, return_when=FIRST_COMPLETED)
            for entry in ended:
                failure = entry.exception()
                what = calibrations.pop(entry) if entry in calibrations else running.pop(entry)
                if failure is not None:
                    print(f"{what}: {type(failure).__name__}: {failure}", flush=True)
                elif isinstance(what, Item):
                    file.write(json.dumps(entry.result()) + "\n")
                    file.flush()
                    count += 1
                else:
                    ready.add(what)
                    print(f"{what}: calibrated, {entry.result():.0f} s of processor time", flush=True)
    print(f"{count} readings after {time.perf_counter() - begin:.0f} s, {len(queue)} are left", flush=True)
    for process in list(pool._processes.values()):  # a reading may take a minute, which the budget does not have
        process.terminate()
    pool.shutdown(wait=False, cancel_futures=True)


def kind_of(reading: dict[str, Any]) -> str:
    """Kind of a reading: pair, right (its own truck), leak or calibration."""
    first: str = reading["case"].partition(" ")[0]
    return first if first in ("pair", "leak", "calibration") else "right"


def error_of(reading: dict[str, Any]) -> float:
    """Error of the load, rms in % of the peak."""
    error = np.array(reading["load"]) - np.array(reading["true"])
    return 100.0 * float(np.sqrt(np.mean(error**2))) / max(reading["true"])


def inside(reading: dict[str, Any]) -> float:
    """Share of the points in the band in %."""
    low, high, true = (np.array(reading[name], dtype=float) for name in ("low", "high", "true"))
    return 100.0 * float(np.mean((low <= true) & (true <= high)))


def by_case(read_: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A line a case: trust good / with care / none, error, coverage."""
    yield f"{'case':<28}{'readings':>9}{'good/care/none':>16}{'error, worst':>20}{'covered':>9}{'named another':>15}"
    for name in dict.fromkeys(f"{reading['family']} {reading['case']}, {reading['recorded']}" for reading in read_):
        own = [reading for reading in read_ if f"{reading['family']} {reading['case']}, {reading['recorded']}" == name]
        trusts = "/".join(str(sum(reading["trust"] == t for reading in own)) for t in ("good", "with care", "none"))
        errors = [error_of(reading) for reading in own]
        named = sum("of another truck" in " ".join(reading["reasons"]) for reading in own)
        covered = np.mean([inside(reading) for reading in own])
        error = f"{np.median(errors):.2f} / {max(errors):.2f}"
        yield f"{name:<28}{len(own):>9}{trusts:>16}{error:>20}{covered:>8.0f} %{named:>15}"


def statistics(folder: Path, reading: dict[str, Any]) -> dict[str, float]:
    """What a rule may compare, of a stored reading; without what a recorded supply adds to the information."""
    from scipy.special import chdtr

    from clutchid.estimation.parameter_file import read_parameters
    from clutchid.inference.uncertainty.change_prior import HYPOTHESES, change_covariance
    from clutchid.inference.uncertainty.coordinates import CURVATURE, coordinates, smoothness
    from clutchid.inference.uncertainty.gaussian import GaussianPosterior, gaussian_posterior
    from clutchid.parameters import GROUPS

    actuator = read_parameters(calibration_file(folder, reading["family"], reading["calibration"])).actuator
    names, k, at = reading["names"], len(reading["x"]), reading["changing"]
    x, width, mean = np.array(reading["x"]), np.array(reading["width"][:k]), np.array(reading["mean"][:k])
    positive, changing = np.array(reading["positive"][:k]), [reading["names"][i] for i in at]
    si = np.where(positive, mean * np.exp(np.where(positive, width * x, 0.0)), mean + width * x)
    sizes = np.where(positive, mean * width, width)[at]
    weights = {n: v for n, v in zip(names[:k], si.tolist(), strict=True) if n in actuator.load.names}
    bent = smoothness(actuator.replace(weights), names[:k], actuator.load.theta, CURVATURE)
    bent[:, :-1] *= np.where(positive, width * si, width)
    factor = np.zeros((len(names) + 1, len(names) + 1))
    factor[np.triu_indices(len(names) + 1)] = reading["R"]
    data = factor[:, [*range(k), -1]] / np.sqrt(max(1.0, reading["dispersion"]))

    def covariance(hypothesis: Sequence[str]) -> np.ndarray:
        return np.asarray(change_covariance(actuator, changing, tuple(hypothesis)) / np.outer(sizes, sizes))

    def posterior(prior: np.ndarray) -> GaussianPosterior:
        root = np.eye(k)
        root[np.ix_(at, at)] = np.linalg.inv(np.linalg.cholesky(prior))
        rows = np.vstack([np.column_stack([root, root @ x]), bent])
        return gaussian_posterior(data, rows, float(np.linalg.slogdet(root)[1]))

    everything = covariance(tuple(GROUPS))
    own = [i for i, name in enumerate(changing) if name != "C_A0"]
    counted, moved = everything[np.ix_(own, own)], np.array(reading["posterior"])[at][own]
    left = posterior(everything).covariance[np.ix_(at, at)][np.ix_(own, own)]
    distance = float(moved @ np.linalg.solve(counted, moved))
    expected = len(own) - float(np.trace(np.linalg.solve(counted, left)))
    spread = np.array([c.width * (c.mean if c.positive else 1.0) for c in coordinates(actuator, changing, {}, {})])
    between = covariance(("supply pressure", "temperature and grease")) + np.diag(2.0 * (spread / sizes) ** 2)
    evidence = max(posterior(covariance(h)).log_evidence for h in HYPOTHESES)
    whole, parameters, misfit = reading["departure"][:3]
    return {
        "chi-square of what the data determine": float(chdtr(expected, distance)),
        "squared distance": whole,
        "distance beyond all parameters": (whole - parameters) / np.sqrt(2.0 * parameters),
        "evidence of another truck": posterior(between).log_evidence - evidence,
        "largest deviation": float(np.max(np.abs(moved) / np.sqrt(np.diag(counted)))),
        "misfit": misfit,
        "misfit without a change": reading["misfits"][0],
        "innovations (NIS)": reading["nis"] or 0.0,
    }


def rules(folder: Path, read_: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A line a statistic: how well a limit that even calibrations choose does on odd ones.

    The limit is the largest value of the right readings of even calibrations that have a use today.
    """
    wanted = [reading for reading in read_ if kind_of(reading) in ("pair", "right") and reading.get("R")]
    values = [statistics(folder, reading) for reading in wanted]
    odd = np.array([reading["calibration"] % 2 == 1 for reading in wanted])
    right = np.array([kind_of(reading) == "right" and reading["trust"] != "none" for reading in wanted])
    pair = np.array([kind_of(reading) == "pair" for reading in wanted])
    yield f"{'statistic':<40}{'limit':>9}{'pairs above':>14}{'right above':>14}{'least pair':>12}{'largest right':>15}"
    for name in values[0]:
        v = np.array([reading[name] for reading in values])
        limit = float(v[right & ~odd].max())
        above = [f"{int((v[part & odd] > limit).sum())} of {int((part & odd).sum())}" for part in (pair, right)]
        ends = f"{v[pair].min():>12.3g}{v[right].max():>15.3g}"
        yield f"{name:<40}{limit:>9.3g}{above[0]:>14}{above[1]:>14}{ends}"
    v = np.array([reading["chi-square of what the data determine"] for reading in values])
    for level in (0.9, 0.95, 0.99):
        counts = [f"{int((v[part] > level).sum())} of {int(part.sum())} {what}" for part, what in (
            (pair & ~odd, "pairs of even calibrations"), (pair & odd, "of odd"),
            (right & ~odd, "right ones with a use"), (right & odd, "of odd"),
        )]  # fmt: skip
        yield f"chi-square beyond {level:g}: {', '.join(counts)}"


def searches(folder: Path, read_: Sequence[dict[str, Any]]) -> Iterator[str]:
    """A line a kind of search: how many there are, and the most evaluations until one had converged."""
    from clutchid.estimation.parameter_file import read_parameters

    ends = [read_parameters(path).continuation.state for path in sorted(folder.glob("*_?????.toml"))]
    counted = [reading["searches"] for reading in read_ if "searches" in reading]
    every = [search for reading in counted for search in reading]
    whole = [
        ["converged" if {status for status, _ in reading} == {"converged"} else "limit", sum(n for _, n in reading)]
        for reading in counted
    ]
    calibrations = [[end.status, end.evaluations] for end in ends]
    kinds = ("calibrations", calibrations), ("searches of readings", every), ("readings, all their searches", whole)
    for name, of_kind in kinds:
        converged = sorted(count for status, count in of_kind if status == "converged")
        if converged:
            usual = converged[len(converged) // 2]
            yield f"{name}: {len(of_kind)}, {len(converged)} converged, after {usual} evaluations in the median, "
            others = sorted(count for status, count in of_kind if status != "converged")
            yield f"    {converged[-1]} at most; the others ended after {others}"


def analyse(folder: Path) -> None:
    """Print what the stored readings show."""
    every = stored(folder / "readings.jsonl")
    refused = [reading for reading in every if "refused" in reading]
    readings = [reading for reading in every if "refused" not in reading]
    for line in by_case(
        sorted(
            readings, key=lambda reading: (reading["family"], kind_of(reading), reading["case"], reading["recorded"])
        )
    ):
        print(line)
    print(f"{len(refused)} refused: {sorted({reading['key'] for reading in refused})}\n")
    for line in searches(folder, readings):
        print(line)
    for line in rules(folder, readings):
        print(line)


def main() -> None:
    """Read pairs of trucks, or analyse what is stored."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--family", action="append", choices=("A", "B"), help="default: both")
    options.add_argument("--trucks", type=int, default=24)
    options.add_argument("--seed", type=int, default=3500)
    options.add_argument("--workers", type=int, default=1)
    options.add_argument("--kind", choices=("pair", "right", "leak", "calibration"), help="default: all")
    options.add_argument("--budget", type=float, default=1e9, help="seconds after which the run ends")
    options.add_argument("--analyse", action="store_true")
    chosen = options.parse_args()
    if chosen.analyse:
        analyse(chosen.folder)
        return
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    chosen.folder.mkdir(parents=True, exist_ok=True)
    numbers = range(chosen.seed, chosen.seed + chosen.trucks)
    wanted = [entry for family in chosen.family or ("A", "B") for n in numbers for entry in items(family, n, numbers)]
    wanted = [(place, item) for place, item in wanted if chosen.kind in (None, kind_of(item._asdict()))]
    read_all(chosen.folder, wanted, chosen.workers, chosen.budget)


if __name__ == "__main__":
    main()
