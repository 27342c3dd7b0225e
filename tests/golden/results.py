"""Golden results: every way to a result, run once and flattened to names and numbers.

Run as a program it prints one group as JSON, so that a test has it from a process of its own with one thread:

    OMP_NUM_THREADS=1 python tests/golden/results.py GROUP
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import clutchid
from clutchid import Actuator, Fit, Log, Partition, fit, simulate
from clutchid.log import FloatArray

Numbers = dict[str, Any]

#: Libraries whose rounding enters the results.
LIBRARIES = ("numba", "llvmlite", "numpy", "scipy", "sympy")

PRESSURE = ("position", "pressure_a")


def machine() -> dict[str, str]:
    """What the last bits depend on: the processor that the compiler writes for, and the libraries."""
    import llvmlite.binding as llvm

    features = ",".join(sorted(name for name, there in llvm.get_host_cpu_features().items() if there))
    known = hashlib.sha256(features.encode()).hexdigest()[:16]
    return {"processor": f"{llvm.get_host_cpu_name()} {known}", **{name: version(name) for name in LIBRARIES}}


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
    """Names and leaves of nested dictionaries and lists; a long list of numbers is one leaf."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from flat(inner, f"{name}/{key}")
    elif isinstance(value, (list, tuple)) and any(isinstance(inner, (dict, list, tuple, str)) for inner in value):
        for i, inner in enumerate(value):
            yield from flat(inner, f"{name}/{i}")
    else:
        yield name, list(value) if isinstance(value, tuple) else value


def of_columns(columns: Mapping[str, FloatArray]) -> Numbers:
    """Every column as some of its samples and the hash of all."""
    return {
        name: {"sha256": hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest(), "samples": sampled(values)}
        for name, values in columns.items()
        if name not in ("duty_supply", "duty_exhaust")
    }


def sampled(values: FloatArray) -> list[float]:
    """Every 997th row of a column or of a matrix, as one list."""
    rows: list[float] = np.asarray(values)[::997].ravel().tolist()
    return rows


def of_fit(result: Fit) -> Numbers:
    """The JSON object of a fit, its parameter file (with the covariance) and its simulations."""
    from clutchid.reports.fit_json import fit_json

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "fit.toml"
        clutchid.write_parameters(clutchid.parameter_file(result), path)
        text = path.read_text(encoding="utf-8")
    kept = tomllib.loads(text)
    del kept["fit"]["versions"], kept["fit"]["created"]
    return {
        "json": fit_json(result),
        "file": kept,
        "keys of the file": [line.partition(" = ")[0] for line in text.splitlines() if " = " in line],
        "simulated": {name: of_columns(recording.simulated.columns) for name, recording in result.recordings.items()},
    }


def simulation() -> Numbers:
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
        name: {"log": of_columns(run.log.columns), "sensitivities": of_columns(run.sensitivities)}
        for name, run in runs.items()
    }


def paper() -> Numbers:
    """The paper's method: ballistic, partitioned, with pressure, several recordings, one of them verified."""
    log, other = part(0.0, 15.0), part(15.0, 25.0)
    return {
        "ballistic": of_fit(fit(log)),
        "every 200, q": of_fit(fit(log, partition=Partition(every=200, carry="q"))),
        "both measured": of_fit(fit(log, measure=PRESSURE, free=("load", "P_S"), verify=[other])),
        "two recordings": of_fit(fit([log, other], free=("load", "F_C"), bounds={"F_C": (100.0, 300.0)})),
    }


def shooting() -> Numbers:
    """Shooting without a calibration: three splines, own numbers of a recording, priors, profile and bootstrap."""
    log = part(0.0, 6.0)
    options: dict[str, Any] = {"free": ("load", "C_vs", "P_S@EACH"), "measure": PRESSURE}
    prior = {"C_vs": clutchid.Prior(19e-9, 2e-9)}
    return {"three splines": of_fit(fit(log, method="shooting", priors=prior, profile=("C_vs",), **options))}


def automatic() -> Numbers:
    """A calibration by `auto`; the load of a later recording; the same where the grease differs from the calibrated."""
    once = fit(part(0.0, 10.0), measure=PRESSURE, free=("auto",))
    later, again = position_only(part(14.0, 22.0)), part(22.0, 24.0)
    read = fit(later, once.actuator, calibration=once.calibration, verify=[again], bootstrap=20)
    thicker = once.actuator.replace({"D_v": 1.3 * once.actuator.value("D_v")})
    return {
        "calibration": of_fit(once),
        "reading": of_fit(read),
        "changed": of_fit(fit(later, thicker, calibration=once.calibration)),
    }


def prediction_error() -> Numbers:
    """A calibration by prediction errors with a few free numbers, and the load of a later recording."""
    begin = Actuator(model="energy-balance-stribeck", load=clutchid.Load.on_b_splines())
    once = fit(part(0.0, 5.0), begin, measure=PRESSURE, free=("load", "C_vs", "tau_y"), method="prediction-error")
    read = fit(position_only(part(5.0, 9.0)), once.actuator, calibration=once.calibration)
    return {"calibration": of_fit(once), "reading": of_fit(read)}


def trucks() -> Numbers:
    """Virtual trucks of both families and their recordings."""
    from trucks import trucks as of_both_families

    return of_both_families()


GROUPS: dict[str, Callable[[], Numbers]] = {
    group.__name__: group for group in (simulation, paper, shooting, automatic, prediction_error, trucks)
}


def main() -> None:
    """Print one group with the machine that made it."""
    print(json.dumps({"machine": machine(), "results": dict(flat(GROUPS[sys.argv[1]]()))}))


if __name__ == "__main__":
    main()
