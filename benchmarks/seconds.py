"""Time and accuracy of calibrations and readings: ``python benchmarks/seconds.py --families A,B,h --lines FILE``.

Each truck is calibrated from a recording with pressure; its worn clutch is then read from position alone, in each of
some cases. Every fit is a line of JSON: processor time of one thread and evaluations, cost and status of its searches,
free parameters with their standard deviations, error, coverage and width of the load, and where the valves have a
carrier the phase that is found from position alone. Lines that a file has are not measured again. With ``--workers``
trucks share the processors. Two files, of two versions, are compared by ``--compare BEFORE AFTER``.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from prove import SECONDS, Answer, score
from widening import seeds, worn_clutch

from clutchid import DataError, Fit, FitRequest, SolveError
from clutchid.estimation.fit import FIT_METHODS, fit_request
from clutchid.estimation.method import Method
from clutchid.estimation.phase import filtered_phase
from clutchid.log import Log
from clutchid.preparation.pulses import centred
from clutchid.strokes.duty_cycle import grid_phase
from clutchid.strokes.vented_rest import from_rest
from clutchid.truck import GRID, Truth, drive, truck

#: Columns that the recordings lack.
CONDITIONS = ("temperature_ambient", "pressure_supply")

#: A clutch without wear; worn, and that in cold and warm grease; worn, as a bus at 100 Hz has it.
CASES = ("new", "nothing", "cold", "warm", "100 Hz bus log")

Line = dict[str, Any]
T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[float, T]:
    """Processor time of a piece of work in s, and its result."""
    used = time.process_time()
    result = work()
    return time.process_time() - used, result


def recording(number: int, family: str, case: str) -> tuple[Log, Truth]:
    """A recording of a truck with position alone, and the truth."""
    if case == "new":
        driven = drive(truck(number, family), seconds=SECONDS, seed=seeds(number)[1], pressure=False, name="worn")
    else:
        driven = worn_clutch(number, family, case)
    return driven.log.without(*CONDITIONS), driven.truth


def recorded(method: Method, searches: list[Line]) -> Method:
    """A method that appends the end of each of its searches to a list."""

    def noted(what: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def done(*arguments: Any) -> Any:
            seconds, result = timed(lambda: work(*arguments))
            solution = getattr(result, "solution", result)
            if hasattr(solution, "at"):
                end = {"cost": solution.at.cost, "status": solution.status, "evaluations": solution.evaluations}
                searches.append({"search": what, **end, "seconds": round(seconds, 3)})
            return result

        return done

    changes = method.changes
    if changes is not None:
        changes = replace(changes, refine=noted("changed", changes.refine), settle=noted("mean", changes.settle))
    return replace(method, search=noted("fit", method.search), changes=changes)


def line_of(log: Log, truth: Truth, start: Fit | None, request: FitRequest) -> tuple[Line, Fit | None]:
    """What a fit takes, where it ends, and how right its load is."""
    searches: list[Line] = []
    methods = {name: recorded(method, searches) for name, method in FIT_METHODS.items()}
    try:
        seconds, result = timed(lambda: fit_request([log], start and start.actuator, request, methods=methods))
    except (DataError, SolveError) as refusal:
        return {"refused": str(refusal)}, None
    line = {"seconds": round(seconds, 3), "searches": searches, "status": result.status}
    if result.status == "failed":
        return line, None
    curve, own = result.load_curve, result.recordings[log.name].simulated["pressure_a"]
    errors = score(Answer(curve.position, curve.force, curve.low, curve.high, own), truth, log.time)
    width = np.median(np.interp(GRID, curve.position, curve.high - curve.low)) / truth.load(GRID).max()
    return {
        **line,
        "trust": result.verdict.trust,
        "error": errors.load,
        "covered": errors.coverage,
        "width": 100 * float(width),
        "load": np.interp(GRID[::10], curve.position, curve.force).tolist(),
        "scales": dict(result.scales),
        "parameters": {name: [estimate.value, estimate.std] for name, estimate in result.parameters.items()},
    }, result


def phase_of(log: Log, once: Fit) -> Line:
    """The phase of the carrier as found from position alone, that of the grid of the duty cycles, and seconds."""
    period = once.actuator.parameters.T_pwm
    if once.calibration is None or period <= 0.0:
        return {}
    log = from_rest(log, once.calibration.rest, "subtract").log
    grid = grid_phase(log, period)
    try:
        seconds, phase = timed(lambda: filtered_phase(log, once.actuator, once.calibration))
    except DataError:
        return {}
    return {"phase": phase, "grid": None if grid is None else centred(grid), "phase seconds": round(seconds, 3)}


def lines_of(number: int, family: str, cases: Sequence[str]) -> list[Line]:
    """Calibration and readings of a truck."""
    name = {"truck": family if family.startswith("h") else f"{family}{number}"}
    driven = drive(truck(number, family), seconds=SECONDS, seed=seeds(number)[0], name="calibration", conditions=True)
    log = driven.log.without(*CONDITIONS)
    line, once = line_of(log, driven.truth, None, FitRequest(("position", "pressure_a"), ("auto",)))
    lines = [{**name, "case": "calibration", **line}]
    if once is None:
        return lines
    for case in cases:
        log, truth = recording(number, family, case)
        line, _ = line_of(log, truth, once, FitRequest(calibration=once.calibration))
        lines.append({**name, "case": case, **line, **phase_of(log, once)})
    return lines


def trucks(families: Sequence[str], first: int, count: int) -> Iterator[tuple[int, str]]:
    """Numbers and families of trucks, those first that take longest; hybrids have the numbers 0 to 2 `count`."""
    for family in sorted(families, key="BhA".index):
        if family == "h":
            yield from ((0, f"h:{seed}") for seed in range(2 * count))
        else:
            yield from ((number, family) for number in range(first, first + count))


def read(path: Path) -> dict[tuple[str, str], Line]:
    """Lines of a file by truck and case."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return {(line["truck"], line["case"]): line for line in map(json.loads, text.splitlines())}


def spread(values: Sequence[float]) -> str:
    """Median and worst of some values."""
    return f"{np.median(values):.2f} / {max(values):.2f}" if len(values) else "-"


def table(lines: Sequence[Line]) -> Iterator[str]:
    """A row a family and case: median / worst of the trucks."""
    yield "| family | case | fits | seconds | evaluations | error [%] | covered [%] | width [%] | phase [s] |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for family, case in dict.fromkeys((line["truck"][0], line["case"]) for line in lines):
        own = [line for line in lines if (line["truck"][0], line["case"]) == (family, case) and "error" in line]
        evaluations = [sum(search["evaluations"] for search in line["searches"][:1]) for line in own]
        columns = [[line[name] for line in own] for name in ("seconds", "error", "width")]
        seconds, error, width = map(spread, columns)
        covered = f"{100 * np.mean([line['covered'] for line in own]):.0f}" if own else "-"
        phases = spread([line["phase seconds"] for line in own if "phase seconds" in line])
        row = (family, case, str(len(own)), seconds, spread(evaluations), error, covered, width, phases)
        yield f"| {' | '.join(row)} |"


def differences(before: Line, after: Line) -> Line:
    """What differs between two versions of a fit.

    Ratio of the processor times; cost beyond the one before; largest change of a parameter in standard deviations, and
    of the load in % of its peak; phase in periods.
    """
    if "error" not in before or "error" not in after:
        return {"other end": float(("error" in before) != ("error" in after))}
    old, new = before["parameters"], after["parameters"]
    moved = [abs(new[name][0] - value) / std for name, (value, std) in old.items() if name in new and std > 0.0]
    load, peak = np.array(after["load"]) - before["load"], max(before["load"])
    gone = {} if "phase" not in before else {"phase": abs(centred(after["phase"] - before["phase"]))}
    return {
        "ratio": after["seconds"] / before["seconds"],
        "cost": after["searches"][0]["cost"] - before["searches"][0]["cost"],
        "deviations": max(moved, default=0.0),
        "load": 100 * float(np.abs(load).max()) / peak,
        "error": after["error"] - before["error"],
        "covered": after["covered"] - before["covered"],
        "width": after["width"] - before["width"],
        **gone,
    }


def comparison(before: dict[tuple[str, str], Line], after: dict[tuple[str, str], Line]) -> Iterator[str]:
    """A line a fit that both versions have made, those first whose load has moved most, and the ratio of the times."""
    both = {key: differences(before[key], after[key]) for key in before if key in after}
    for (name, case), change in sorted(both.items(), key=lambda item: -item[1].get("load", np.inf)):
        yield f"{name:8}{case:16}" + "".join(f"{what} {value:+.3g}  " for what, value in change.items())
    for family in dict.fromkeys(name[0] for name, _ in both):
        for what in ("calibration", "readings"):
            keys = [key for key in both if key[0][0] == family and (key[1] == "calibration") == (what[0] == "c")]
            ratios = [both[key]["ratio"] for key in keys if "ratio" in both[key]]
            yield f"{family} {what}: ratio of the processor times, median / worst {spread(ratios)} of {len(ratios)}"


def main() -> None:
    """Measure the trucks that a file lacks and print the table, or compare two files."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--families", default="A,B")
    options.add_argument("--trucks", type=int, default=12)
    options.add_argument("--seed", type=int, default=3500)
    options.add_argument("--cases", default=",".join(CASES))
    options.add_argument("--workers", type=int, default=1)
    options.add_argument("--lines", type=Path, default=Path("seconds.jsonl"))
    options.add_argument("--compare", type=Path, nargs=2)
    chosen = options.parse_args()
    if chosen.compare:
        files = [read(path) for path in chosen.compare]
        print(*table([*files[0].values()]), "", *table([*files[1].values()]), "", sep="\n")
        print(*comparison(*files), sep="\n")
        return
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    there = {name for name, _ in read(chosen.lines)}
    wanted = [
        (number, family)
        for number, family in trucks(chosen.families.split(","), chosen.seed, chosen.trucks)
        if (family if family.startswith("h") else f"{family}{number}") not in there
    ]
    cases = chosen.cases.split(",")
    with ProcessPoolExecutor(chosen.workers, get_context("spawn")) as pool:
        # the first fits of a process load machine code, or compile it
        list(pool.map(lines_of, [8] * chosen.workers, ["A"] * chosen.workers, [["nothing"]] * chosen.workers))
        jobs = [pool.submit(lines_of, number, family, cases) for number, family in wanted]
        for job in as_completed(jobs):
            with chosen.lines.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps(line) + "\n" for line in job.result())
    print(*table([*read(chosen.lines).values()]), sep="\n")


if __name__ == "__main__":
    main()
