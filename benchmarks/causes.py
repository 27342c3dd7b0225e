"""What a reading says of its inputs: ``python benchmarks/causes.py`` prints its tables from `results/causes.jsonl`.

``--store FOLDER`` makes the readings that the file lacks, with calibrations kept in FOLDER; it can be stopped and
called again. Trucks 5200 on of families A and B and hybrids h:41 on are calibrated once, with pressure and supply
pressure, and their worn clutch (1.5 mm) is read for 12 s with the chamber pressure recorded and not fitted:

- sound: under every case of `widening.py`, from position alone and with the supply pressure;
- faults: unchanged, with an input spoiled in each way of `FAULTS`;
- others: with the calibration of the truck before.

Each is also observed. A line has what was decided, and what it was decided by, so that other limits can be tried.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from online import calibrated
from prove import STROKES_A_METRE
from scipy.special import chdtr
from scipy.stats import beta
from widening import ANOTHER, CASES, LATE, WEAR, seeds

from clutchid import FitRequest, fit, parameter_file, read_parameters, write_parameters
from clutchid.errors import ClutchidError
from clutchid.estimation.assess.observed import Indicators, indicators, observed_verdict
from clutchid.estimation.assess.pressure import PressureTest, pressure_reasons, pressure_tests
from clutchid.estimation.assess.reasons import ANOTHER as BEYOND
from clutchid.estimation.assess.reasons import (
    FAR,
    FOLLOWED,
    MISFIT,
    POOR_MISFIT,
    departure_reasons,
    expected_error,
    named_cause,
    of_no_fault,
    reasons,
    supply_reasons,
)
from clutchid.estimation.assess.travel import travel_changes, travel_reasons
from clutchid.estimation.parameter_file import ParameterFile
from clutchid.estimation.result import InputFault
from clutchid.inference.uncertainty.conditions import GAUGE
from clutchid.log import INPUTS, FloatArray, Log
from clutchid.observer import observe_recording, observer
from clutchid.observer.health import FLAGS
from clutchid.strokes.travel import GAIN, MORE
from clutchid.truck import GRID, Drive, Vehicle, drive, truck

#: Stored readings, a line each.
STORED = Path(__file__).parent / "results" / "causes.jsonl"

#: Seconds of a recording.
SECONDS = 12.0

#: Columns that a recording lacks, by what it has beside position and duty cycles.
LACKING = {"position": ("temperature_ambient", "pressure_supply"), "supply": ("temperature_ambient",)}

#: Numbers of the trucks by family, for sound recordings; how many of each are spoiled, and have another's calibration.
NUMBERS = {"A": range(5200, 5209), "B": range(5200, 5208), "h": range(41, 49)}
SPOILED, OTHERS = 2, 4


def _with_duties(of: Callable[..., FloatArray]) -> Callable[[Log], Log]:
    return lambda log: log.with_columns(**{name: of(log[name]) for name in INPUTS})


def _late(seconds: float) -> Callable[[Log], Log]:
    return lambda log: log.with_columns(position=np.interp(log.time - seconds, log.time, log["position"]))


def _filtered(lag: float) -> Callable[[Log], Log]:
    def spoil(log: Log) -> Log:
        shown, decay = log["position"].copy(), np.exp(-np.diff(log.time) / lag)
        for i, share in enumerate(decay.tolist(), 1):
            shown[i] = share * shown[i - 1] + (1.0 - share) * shown[i]
        return log.with_columns(position=shown)

    return spoil


def _clock(fast: float) -> Callable[[Log], Log]:
    def spoil(log: Log) -> Log:
        begin, length = log.time[0], len(log)
        at = np.searchsorted(log.time, begin + (log.time - begin) * (1.0 + fast), side="right") - 1
        return log.with_columns(**{name: log[name][np.clip(at, 0, length - 1)] for name in INPUTS})

    return spoil


def _inverted(*names: str) -> Callable[[Log], Log]:
    return lambda log: log.with_columns(**{name: 1.0 - log[name] for name in names})


def _gain(gain: float) -> Callable[[Log], Log]:
    return lambda log: log.with_columns(position=gain * log["position"])


#: How inputs are spoiled: what is recorded, the cause that it is, and what is done.
FAULTS: dict[str, tuple[str, str, Callable[[Log], Log]]] = {
    "position 60 ms late": ("position", "shift", _late(0.06)),
    "position 20 ms late": ("position", "shift", _late(0.02)),
    "position 30 ms early": ("position", "shift", _late(-0.03)),
    "position filtered, 20 ms": ("position", "filter", _filtered(0.02)),
    "position filtered, 8 ms": ("position", "filter", _filtered(0.008)),
    "duty cycles x 0.8": ("position", "gain of the duty cycles", _with_duties(lambda duty: 0.8 * duty)),
    "duty cycles x 1.25": (
        "position", "gain of the duty cycles", _with_duties(lambda duty: np.minimum(1.25 * duty, 1.0))
    ),
    "clock 0.3 % fast": ("position", "clock", _clock(0.003)),
    "clock 0.3 % slow": ("position", "clock", _clock(-0.003)),
    "supply valve inverted": ("position", "duty_supply inverted", _inverted(INPUTS[0])),
    "exhaust valve inverted": ("position", "duty_exhaust inverted", _inverted(INPUTS[1])),
    "both inverted": ("position", "both inverted", _inverted(*INPUTS)),
    "valves swapped": (
        "position", "swapped", lambda log: log.with_columns(duty_supply=log[INPUTS[1]], duty_exhaust=log[INPUTS[0]])
    ),
    "supply in gauge": (
        "supply", GAUGE, lambda log: log.with_columns(pressure_supply=log["pressure_supply"] - 1.01325e5)
    ),
    **{f"position x {gain:g}": ("position", "travel", _gain(gain)) for gain in (0.9, 0.95, 1.05, 1.1)},
    **{f"position x {gain:g}, far stop": ("position", "travel", _gain(gain)) for gain in (0.9, 0.95, 1.05, 1.1)},
}  # fmt: skip


class Job(NamedTuple):
    """A reading: `kind` 'sound', 'fault' or 'other', the truck and its case."""

    kind: str
    family: str
    number: int
    case: str
    recorded: str

    @property
    def name(self) -> str:
        """Its name among the stored ones."""
        return "/".join(map(str, self))


def jobs() -> list[Job]:
    """All of them."""
    sound = [case for case in CASES if case not in (LATE, ANOTHER)]
    trucks = [(family, number) for family, numbers in NUMBERS.items() for number in numbers]
    spoiled = [(family, number) for family, numbers in NUMBERS.items() for number in numbers[:SPOILED]]
    others = [(family, number) for family, numbers in NUMBERS.items() for number in numbers[1 : 1 + OTHERS]]
    return [
        *(Job("sound", *of, case, recorded) for of in trucks for case in sound for recorded in LACKING),
        *(Job("fault", *of, name, fault[0]) for of in spoiled for name, fault in FAULTS.items()),
        *(Job("other", *of, "nothing", recorded) for of in others for recorded in LACKING),
    ]


def vehicle(family: str, number: int) -> Vehicle:
    """A truck of a family, or a hybrid."""
    return truck(0, f"h:{number}") if family == "h" else truck(number, family)


def calibration(family: str, number: int, folder: Path, far: bool) -> ParameterFile:
    """The calibration of a truck; `far` from a recording that reaches the far stop."""
    path, kind, seed = (
        folder / f"{family}{number}{'_far' if far else ''}.toml",
        vehicle(family, number),
        seeds(number)[0],
    )
    if not far:
        return calibrated(kind, seed, path, conditions=True)
    if not path.exists():
        log = pressed(kind, seed, {}, seconds=10.0).log
        write_parameters(parameter_file(fit(log, measure=("position", "pressure_a"), free=("auto",))), path)
    return read_parameters(path)


def pressed(kind: Vehicle, seed: int, worn: Mapping[str, Any], seconds: float = SECONDS) -> Drive:
    """A drive that ends with the piston pressed to the far stop."""
    first = drive(kind, seconds=seconds, seed=seed, conditions=True, **worn)
    duties = np.column_stack([first.log[name] for name in INPUTS])
    end, press, vent = len(duties), 500, 300
    duties[end - press - vent : end - vent] = 1.0, 0.0
    duties[end - vent :] = 0.0, 1.0
    return drive(kind, seconds=seconds, seed=seed, conditions=True, duties=duties, **worn)


def recorded_drive(job: Job) -> Drive:
    """The recording of the worn clutch, before it is spoiled."""
    kind, seed = vehicle(job.family, job.number), seeds(job.number)[1]
    worn = {"wear": WEAR, "cycles": WEAR * STROKES_A_METRE}
    if "far stop" in job.case:
        return pressed(kind, seed, worn)
    changes, options = CASES[job.case if job.kind == "sound" else "nothing"]
    return drive(kind, seconds=SECONDS, seed=seed, change=changes, conditions=True, **worn, **options(kind))


def line(job: Job, folder: Path) -> dict[str, Any]:
    """What is stored of a reading, and of the load on line."""
    worn = recorded_drive(job)
    log = worn.log.without(*(name for name in LACKING[job.recorded] if name in worn.log))
    log = FAULTS[job.case][2](log) if job.kind == "fault" else log
    content = calibration(job.family, job.number - (job.kind == "other"), folder, far="far stop" in job.case)
    truth = worn.truth.load(GRID)
    touch, peak = (GRID >= 5e-3) & (GRID <= 8e-3), float(truth.max())

    def off(force: FloatArray) -> float:
        return 100 * float(np.sqrt(np.mean((force - truth)[touch] ** 2))) / peak

    assert content.calibration is not None
    return {
        "job": job.name,
        "read": _caught(lambda: _read(log, content, off)),
        "observed": _caught(lambda: _observed(log, content, off)),
    }


def _caught(result: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    try:
        return result()
    except ClutchidError as error:
        return {"refused": str(error)}


def _read(log: Log, content: ParameterFile, off: Callable[[FloatArray], float]) -> dict[str, Any]:
    assert content.calibration is not None
    answer = fit(log, content.actuator, FitRequest(calibration=content.calibration))
    departure, curve = answer.departure, answer.load_curve
    if departure is None:
        return {"refused": answer.message}
    test = next(iter(pressure_tests(answer).values()), None)
    travel = next(iter(travel_changes(answer).values()), None)
    rules = (departure_reasons, pressure_reasons, travel_reasons, supply_reasons)
    of_causes = {reason.text for rule in rules for reason in rule(answer)}
    others = [reason for reason in reasons(answer) if reason.text not in of_causes]
    return {
        "off": off(np.interp(GRID, curve.position, curve.force)),
        "expected": expected_error(answer),
        "trust": answer.verdict.trust,
        "otherwise": "none" if any(reason.grave for reason in others) else "with care" if others else "good",
        "nearer": float(chdtr(departure.expected, departure.distance)) if departure.expected > 0.0 else None,
        "misfit": departure.misfit,
        "innovations": of_no_fault(answer.causes).innovations if answer.causes else None,
        "pressure": [*test] if test else None,
        "travel": [travel.ratio, travel.checked] if travel else None,
        "causes": [[cause.name, cause.size, cause.innovations] for cause in answer.causes[:3]],
        "gauge": GAUGE in answer.alternatives,
    }


def _observed(log: Log, content: ParameterFile, off: Callable[[FloatArray], float]) -> dict[str, Any]:
    follower = observer(content.actuator, calibration=content.calibration)
    run = observe_recording(follower, log)
    shown = indicators(run)
    verdict = observed_verdict(shown)
    return {
        "off": off(follower.load(run.after).force(GRID)),
        "trust": verdict.trust,
        "half_width": shown.half_width,
        "mismatch": shown.mismatch,
        "flagged": {name: round(share, 4) for name, share in shown.flagged.items() if share},
        "supply": shown.supply,
        "strokes": shown.strokes,
        "pressure": [*shown.pressure] if shown.pressure else None,
    }


def stored() -> list[dict[str, Any]]:
    """The lines of the file."""
    return [json.loads(text) for text in STORED.read_text(encoding="utf-8").splitlines()] if STORED.exists() else []


def store(folder: Path, workers: int) -> None:
    """Make the readings that the file lacks, the families in turn."""
    folder.mkdir(parents=True, exist_ok=True)
    there = {row["job"] for row in stored()}
    lacking = [job for job in jobs() if job.name not in there]
    lacking.sort(key=lambda job: (NUMBERS[job.family].index(job.number), job.family))
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for row in pool.map(partial(_line, folder=folder), lacking):
            with STORED.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")


def _line(job: Job, folder: Path) -> dict[str, Any]:
    """The line of a reading, also where the truck has no calibration."""
    try:
        return line(job, folder)
    except ClutchidError as error:
        return {"job": job.name, "read": {"refused": str(error)}, "observed": {"refused": str(error)}}


def said(read: Mapping[str, Any]) -> list[str]:
    """The causes that a stored reading names, by the rules as they are now."""
    names = [GAUGE] if read["gauge"] else []
    if read["travel"]:
        ratio, checked = read["travel"]
        names += ["travel"] if (abs(ratio - 1.0) >= GAIN if checked else ratio > 1.0 + MORE) else []
    test = PressureTest(*read["pressure"]) if read["pressure"] else None
    if test and test.deviates:
        names.append("pressure contradicts" if test.contradicts else "pressure deviates")
    nearer, followed = read["nearer"] or 0.0, (read["innovations"] or np.inf) <= FOLLOWED
    if nearer > FAR or read["misfit"] > MISFIT:
        beyond, fault = nearer > BEYOND or read["misfit"] > POOR_MISFIT, cause_of(read)
        if fault or nearer > BEYOND or not followed:
            names.append(fault or ("another truck" if beyond else "far"))
    return names


def cause_of(read: Mapping[str, Any]) -> str:
    """The fault of the inputs that a stored reading names; empty without one."""
    causes = [
        InputFault(name, "" if name == "as recorded" else name, "", size, ratio, 0.0)
        for name, size, ratio in read["causes"]
    ]
    named = named_cause([*causes, InputFault("as recorded", "", "", 0.0, read["innovations"], 0.0)]) if causes else None
    return named.name if named else ""


def trust_of(read: Mapping[str, Any]) -> str:
    """The trust in a stored reading, by the rules as they are now."""
    names, careful = {*said(read)}, {"travel", GAUGE, "far", "pressure deviates"}
    if names - careful or read["otherwise"] == "none":
        return "none"
    return "with care" if names else str(read["otherwise"])


def observed_trust(load: Mapping[str, Any]) -> str:
    """The trust in a stored load on line, by the rules as they are now."""
    flagged, test = dict.fromkeys(FLAGS, 0.0) | load["flagged"], load["pressure"]
    shown = Indicators(True, load["strokes"], load["half_width"], load["mismatch"], flagged, load["supply"])
    return observed_verdict(shown._replace(pressure=PressureTest(*test) if test else None)).trust


def at_most(count: int, of: int) -> str:
    """A count, its share in %, and the upper limit of that, of 95 %."""
    if not of:
        return "-"
    upper = 100 * float(beta.ppf(0.95, count + 1, of - count)) if count < of else 100.0
    return f"{count} of {of} ({100 * count / of:.1f} %, at most {upper:.1f})"


def in_order(trusts: Mapping[str, int]) -> str:
    """Counts of good, with care and none."""
    return " / ".join(str(trusts.get(trust, 0)) for trust in ("good", "with care", "none"))


def print_sound(rows: Sequence[Mapping[str, Any]]) -> None:
    """How often each cause is named of sound recordings."""
    reads = [row["read"] for row in rows if row["job"].startswith("sound/") and "off" in row["read"]]
    named = [said(read) for read in reads]
    print(f"{len(reads)} sound readings\n")
    print("| cause | named | off: median, largest [%] | off at most 2 % | of these good otherwise |")
    print("|---|---|---|---|---|")
    for cause in [*dict.fromkeys(chain.from_iterable(named)), "any"]:
        some = [read for read, names in zip(reads, named, strict=True) if cause in names or (cause == "any" and names)]
        off, right = [read["off"] for read in some], [read for read in some if read["off"] <= 2.0]
        good = sum(read["otherwise"] == "good" for read in right)
        cells = f"{np.median(off):.1f}, {max(off):.1f} | {at_most(len(right), len(reads))} | {good}" if off else " | | "
        print(f"| {cause} | {at_most(len(some), len(reads))} | {cells} |")


def print_trust(rows: Sequence[Mapping[str, Any]], how: str, trust: Callable[[Mapping[str, Any]], str]) -> None:
    """Good loads and those of them beyond 2 %, by family and what was recorded, the pressure left out."""
    print(f"\nTrust in sound recordings without pressure, {how}\n")
    print("| family | recorded | good / with care / none | good beyond 2 % | largest [%] |")
    print("|---|---|---|---|---|")
    for family in NUMBERS:
        for recorded in LACKING:
            of = (row for row in rows if row["job"].startswith(f"sound/{family}/"))
            loads = [row[how] | {"pressure": None} for row in of if row["job"].endswith(recorded) and "off" in row[how]]
            good = [load["off"] for load in loads if trust(load) == "good"]
            beyond = at_most(sum(off > 2.0 for off in good), len(good))
            counts = in_order(Counter(map(trust, loads)))
            print(f"| {family} | {recorded} | {counts} | {beyond} | {max(good, default=np.nan):.1f} |")


def print_spoiled(rows: Sequence[Mapping[str, Any]]) -> None:
    """What readings and observers say of spoiled inputs, and of the calibration of another truck."""
    print("\n| fault | readings | refused by a check | named | trust of the others | off [%] | trust on line |")
    print("|---|---|---|---|---|---|---|")
    others = {"nothing": ("", "another truck", None)}
    for case, (_, cause, _) in (FAULTS | others).items():
        kind = "other" if case in others else "fault"
        of = [row for row in rows if row["job"].split("/")[0] == kind and row["job"].split("/")[3] == case]
        reads = [row["read"] for row in of if "off" in row["read"]]
        off = [read["off"] for read in reads]
        cells = [
            "the calibration of another truck" if case in others else case,
            str(len(of)),
            str(len(of) - len(reads)),
            str(sum(cause in said(read) for read in reads)),
            in_order(Counter(map(trust_of, reads))),
            f"{min(off, default=np.nan):.1f} to {max(off, default=np.nan):.1f}",
            in_order(Counter(observed_trust(row["observed"]) for row in of if "off" in row["observed"])),
        ]
        print(f"| {' | '.join(cells)} |")


def main() -> None:
    """Print the tables, or make what they lack."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--store", type=Path, metavar="FOLDER", help="make the readings that the file lacks")
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    if chosen.store:
        store(chosen.store, chosen.workers)
    rows = stored()
    print_sound(rows)
    print_trust(rows, "read", trust_of)
    print_trust(rows, "observed", observed_trust)
    print_spoiled(rows)


if __name__ == "__main__":
    main()
