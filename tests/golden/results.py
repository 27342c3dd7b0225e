"""Golden results: every way to a result, evaluated where its searches have ended, flattened to names and numbers.

Run as a program it prints one group as JSON, so that a test has it from a process of its own, as it begins, with one
thread. With the argument `search` it searches, and prints the ends; without, it takes the kept ones from its input:

    cd tests && python -m golden.results GROUP search > ENDS.json
    cd tests && python -m golden.results GROUP < ASKED.json    # {"ends": ENDS, "again": [NUMBER, ...]}
"""

from __future__ import annotations

import json
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import clutchid
from clutchid import Actuator, Fit, Log, Partition, simulate
from clutchid.estimation.fit import fit_request
from clutchid.estimation.method import Method
from clutchid.estimation.request import FitRequest
from clutchid.log import FloatArray
from golden.comparison import some
from golden.ends import Recorder, Replay
from golden.trucks import trucks

Numbers = dict[str, Any]

#: Methods by name, which search or are evaluated at kept ends.
Methods = Mapping[str, Method]

PRESSURE = ("position", "pressure_a")


def part(begin: float, end: float) -> Log:
    """A part of the bundled recording, between two times in s."""
    log = clutchid.bundled_recording()
    first, last = np.searchsorted(log.time, [begin, end])
    cut = log.slice(int(first), int(last))
    return replace(cut, name=f"from_{begin:g}_s")


def position_only(log: Log) -> Log:
    """A recording without its pressure."""
    return replace(log, columns={name: values for name, values in log.columns.items() if name != "pressure_a"})


def flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Names and leaves of nested dictionaries and lists; a list of numbers is one leaf, a covariance its `parts`."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from flat(inner, f"{name}/{key}")
    elif isinstance(value, list) and value and all(isinstance(row, list) and len(row) == len(value) for row in value):
        yield from flat(parts(np.array(value, dtype=float)), name)
    elif isinstance(value, list) and any(isinstance(inner, (dict, list, str)) for inner in value):
        for i, inner in enumerate(value):
            yield from flat(inner, f"{name}/{i}")
    else:
        yield name, value


def parts(covariance: FloatArray) -> Numbers:
    """Standard deviations of a covariance (k, k), and its correlations times a vector that any of them moves."""
    std = np.sqrt(np.diag(covariance))
    finite = np.isfinite(std) & (std > 0.0)
    correlation = covariance[np.ix_(finite, finite)] / np.outer(std[finite], std[finite])
    return {"std": std.tolist(), "correlation": (correlation @ np.cos(np.arange(finite.sum()))).tolist()}


def of_fit(result: Fit) -> Numbers:
    """The JSON object of a fit with every tenth point of its curves, its parameter file, and its simulations."""
    from clutchid.documents.fit_json import fit_json

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fit.toml"
        clutchid.write_parameters(clutchid.parameter_file(result), path)
        text = path.read_text(encoding="utf-8")
    written = tomllib.loads(text)
    del written["fit"]["versions"], written["fit"]["created"]
    if result.baseline is not None:
        del written["fit"]["calibration"]  # that of the calibration
    json_object = fit_json(result)
    del json_object["starts"]  # of the search, which is not repeated
    del json_object["identifiability"]  # its order may depend on the processor where two are as well determined
    for profile in json_object["profiles"].values():  # where it was fixed, also of the search
        del profile["values"], profile["distances"]
    for curve in ("load_curve", "calibrated_load_curve", "load_change"):
        if isinstance(json_object.get(curve), dict):
            json_object[curve] = {n: v[::10] if isinstance(v, list) else v for n, v in json_object[curve].items()}
    return {
        "json": json_object,
        "file": written,
        "keys of the file": "; ".join(line.partition(" = ")[0] for line in text.splitlines() if " = " in line),
        "simulated": {name: some(recording.simulated.columns, 11) for name, recording in result.recordings.items()},
    }


def simulation(methods: Methods) -> Numbers:
    """The paper's model along a recording, ballistic and partitioned, with sensitivities; and the richest variant."""
    log = part(0.0, 5.0)
    rich = Actuator(model="energy-balance-stribeck").replace({"T_pwm": 0.01, "s_vs": 0.07, "s_ve": 0.07})
    every = Partition(every=200, carry="q")
    runs = {
        "ballistic": simulate(Actuator(), log, sensitivities=("theta_1", "C_vs", "P_0")),
        "every 200, q": simulate(Actuator(), log, partition=every, sensitivities=("theta_2",)),
        "energy balance": simulate(rich, log, partition=every, sensitivities=("theta_1", "h_A", "t_vs")),
    }
    return {
        name: {
            "log": some(run.log.columns, 11),
            "sensitivities": {
                name: some({f"state {i}": column for i, column in enumerate(values.T)}, 7)
                for name, values in run.sensitivities.items()
            },
        }
        for name, run in runs.items()
    }


def paper(methods: Methods) -> Numbers:
    """The paper's method: ballistic, partitioned, with pressure, several recordings, one of them verified."""
    log, other = part(0.0, 15.0), part(15.0, 25.0)

    def fit(logs: list[Log], request: FitRequest, verify: tuple[Log, ...] = ()) -> Numbers:
        return of_fit(fit_request(logs, None, request, verify, methods=methods))

    several = FitRequest(free=("load", "F_C"), bounds={"F_C": (100.0, 300.0)})
    return {
        "ballistic": fit([log], FitRequest()),
        "every 200, q": fit([log], FitRequest(partition=Partition(every=200, carry="q"))),
        "both measured": fit([log], FitRequest(PRESSURE, ("load", "P_S")), (other,)),
        "two recordings": fit([log, other], several),
        "a start of one sample": fit([_opening()], FitRequest()),
    }


def _opening() -> Log:
    """A recording that begins with the opening of the supply valve, so that its position at rest is one sample."""
    log = part(0.0, 6.0)
    first = int(np.argmax(log["duty_supply"] > Actuator().parameters.R_0vs))
    return replace(log.slice(first, len(log)), name="opening")


def shooting(methods: Methods) -> Numbers:
    """Shooting without a calibration: three splines, own numbers of a recording, priors, profile and bootstrap."""
    prior = {"C_vs": clutchid.Prior(19e-9, 2e-9)}
    request = FitRequest(PRESSURE, ("load", "C_vs", "P_S@EACH"), method="shooting", priors=prior, profile=("C_vs",))
    return {"three splines": of_fit(fit_request([part(0.0, 6.0)], None, request, methods=methods))}


def automatic(methods: Methods) -> Numbers:
    """A calibration by `auto`; the load of a later recording; the same where the grease differs from the calibrated."""
    once = fit_request([part(0.0, 10.0)], None, FitRequest(PRESSURE, ("auto",)), methods=methods)
    later, again = position_only(part(14.0, 22.0)), part(22.0, 24.0)
    request = FitRequest(calibration=once.calibration)
    thicker = once.actuator.replace({"D_v": 1.3 * once.actuator.value("D_v")})
    checked = replace(request, bootstrap=20)
    return {
        "calibration": of_fit(once),
        "reading": of_fit(fit_request([later], once.actuator, checked, [again], methods=methods)),
        "changed": of_fit(fit_request([later], thicker, request, methods=methods)),
    }


def prediction_error(methods: Methods) -> Numbers:
    """A calibration by prediction errors with a few free numbers, and the load of a later recording."""
    begin = Actuator(model="energy-balance-stribeck", load=clutchid.Load.on_b_splines())
    request = FitRequest(PRESSURE, ("load", "C_vs", "tau_y"), method="prediction-error")
    once = fit_request([part(0.0, 5.0)], begin, request, methods=methods)
    reading = FitRequest(calibration=once.calibration)
    read = fit_request([position_only(part(5.0, 9.0))], once.actuator, reading, methods=methods)
    return {"calibration": of_fit(once), "reading": of_fit(read)}


FITS: dict[str, Callable[[Methods], Numbers]] = {
    group.__name__: group for group in (simulation, paper, shooting, automatic, prediction_error)
}


def results(group: str, ends: Recorder | Replay) -> Numbers:
    """Results of a group whose searches are recorded or replayed."""
    return trucks(ends.drive) if group == "trucks" else FITS[group](ends.methods())


def evaluated(group: str, asked: str) -> str:
    """Results of a group at kept ends, and the searches that are done again; both texts are JSON."""
    replay = Replay(**json.loads(asked))
    leaves = dict(flat(results(group, replay)))
    return json.dumps({"results": leaves, "searched": replay.searched})


def main() -> None:
    """Print the ends of a group, or its results at those of the input, with the searches that are done again."""
    group, *search = sys.argv[1:]
    if search:
        recorder = Recorder()
        results(group, recorder)
        print(json.dumps(recorder.ends))
        return
    print(evaluated(group, sys.stdin.read()))


if __name__ == "__main__":
    main()
