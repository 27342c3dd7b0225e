"""Branches of the exported C that the checks of its requirements take: ``python benchmarks/coverage_c.py``.

An observer with a calibration that knows its rest, its innovations and its supply pressure is exported in float, with
one rate and with two; `test/requirements.c` runs on this computer, compiled by gcc for gcov. A branch counts where one
of the two takes it. The command prints the table and the branches that neither takes, and fails where the observer and
its filter are below 95 %. The model is reported and has no limit: its branches are phases of pulses and guards of roots
and divisions in equations that are printed from one text, and `tests/c` compares them with Python.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from clutchid.exports.c99 import CStyle, compiler, observer_c99, source_files
from clutchid.exports.requirements import requirement_drive, requirement_files
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.model import Actuator, Load
from clutchid.observer import observer, start
from clutchid.observer.configuration import Observer
from clutchid.parameters import Parameters
from clutchid.strokes.vented_rest import vented_rest

#: Share of the branches that the checks must take, but for those of the equations.
LEAST, MODEL = 0.95, "clutch_model.c"

#: Functions of the model that no task calls, and why the export has them.
UNCALLED = {
    "rhs": "the right-hand side without derivatives is for simulation: the FMU of the actuator calls it",
    "step": "so is its step",
    "clutch_model_run": "so is a run of steps",
}

#: Reasons of branches that no check takes, by their function; the rest is named without one.
REASONS = {
    "numbers_known": "a second line of defence: the states are no numbers before the parameters are",
    "take": "as `numbers_known`",
    "possible": "as `numbers_known`",
    "is_sound": "as `numbers_known`",
    "write_block": "a stroke that ends while a block is written, and a jump whose zero no rest has shown",
    "look_at_curve": "a load that is nowhere above 0",
    "clutch_filter_continue_correction": "a phase beyond the last one",
    "clutch_model_constants": "guards of roots and divisions by what parameters keep above 0",
    "clutch_model_hold": "pulses in phases that need other shifts and travel times of the valves",
    "rhs_columns": "as `clutch_model_constants`",
    "place": "offsets of sensors, which this calibration does not estimate",
    "predict": "as `place`",
    "centred_window": "a filter without load weights",
    "clutch_filter_refresh": "every load weight of this calibration adapts",
    "clutch_filter_end_interval": "as `place`, for lags",
    "add_drift": "a drift of a parameter that is known exactly",
    "learn_stroke": "a divergence that is followed by the end of its stroke before a correction",
    "begin": "a calibration that does not subtract the shift of its rest, with a stored one",
    "take_sample": "a supply that is forgotten at the begin of a stretch",
    "begin_stretch": "a state that starts at a parameter that does not adapt, and a load below 0",
    "move_alone": "a late sample after held duty cycles; the random sequences of tests/exports have it",
    "forget": "with two rates, a motion that ends while a correction is under way",
    "follow": "as `forget`",
    "correct": "a correction that is complete before its samples are over",
    "leaks": "this calibration estimates a leak",
}

#: Reason of a rule, whose text is Python's and has its tests there.
PRINTED = "printed from a rule that tests/strokes and tests/observer try in Python"


class Branch(NamedTuple):
    """A branch by its file, function and line of text; `number` counts those of the same text."""

    file: str
    function: str
    text: str
    number: int


def calibrated() -> Observer:
    """An observer with everything that a calibration can know."""
    load = Load.on_b_splines(Load((9.0e5, -0.3e5, 0.6e5)))
    actuator = Actuator(Parameters(tau_y=1e-3, T_pwm=5e-3, s_pwm=0.3e-3), load, "energy-balance-stribeck")
    rest = vented_rest(requirement_drive(observer(actuator)))
    conditions = RecordedConditions(supply=9.5e5, supply_estimated=actuator.value("P_S"))
    calibration = Calibration((), np.zeros((0, 0)), conditions=conditions, nis=0.05, rest=rest)
    return observer(actuator, calibration=calibration)


def branches(observed: Observer, style: CStyle, folder: Path) -> dict[Branch, bool]:
    """Every branch of the generated C, and whether the checks take it."""
    files = source_files(observer_c99(observed, start(observed), style, "coverage"))
    for path, text in {**files, **requirement_files(observed, style)}.items():
        (folder / Path(path).name).write_text(text)
    sources = [name for name in files if name.endswith(".c")]
    command = [compiler() or "cc", "-std=c99", "-O0", "--coverage", "-o", "checks", "requirements.c", *sources, "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    subprocess.run(["./checks"], cwd=folder, check=True)
    subprocess.run(["gcov", "-b", "-c", *folder.glob("*.gcda")], cwd=folder, check=True, capture_output=True)
    taken = {}
    for file in sources:
        report, function, text, numbers = folder / f"{file}.gcov", "", "", Counter[tuple[str, str]]()
        for line in report.read_text().splitlines() if report.exists() else ():
            if name := re.match(r"function (\w+)", line):
                function = name[1]
            elif branch := re.match(r"branch\s+\d+ (?:never executed|taken (\d+))", line):
                numbers[function, text] += 1
                taken[Branch(file, function, text, numbers[function, text])] = int(branch[1] or 0) > 0
            elif source := re.match(r"[^:]+:\s*\d+:(.*)", line):
                text = source[1].strip()
    return taken


def main() -> int:
    """Print the table; 1 where too few branches are taken."""
    observed, taken = calibrated(), Counter[Branch]()
    for rates in ("one", "two"):
        with tempfile.TemporaryDirectory() as folder:
            taken.update(branches(observed, CStyle(real="float", rates=rates), Path(folder)))
    counted = {branch: times > 0 for branch, times in taken.items() if branch.function not in UNCALLED}
    logic = [value for branch, value in counted.items() if branch.file != MODEL]
    print("\n| file | branches | taken | share |\n|---|---|---|---|")
    for file in sorted({branch.file for branch in counted}):
        of_file = [value for branch, value in counted.items() if branch.file == file]
        print(f"| `{file}` | {len(of_file)} | {sum(of_file)} | {np.mean(of_file):.1%} |")
    print(f"| observer and filter | {len(logic)} | {sum(logic)} | {np.mean(logic):.1%} |")
    print(f"| all | {len(counted)} | {sum(counted.values())} | {np.mean(list(counted.values())):.1%} |")
    print("\nNot counted:\n")
    for function, reason in UNCALLED.items():
        print(f"- `{function}`, {sum(branch.function == function for branch in taken)} branches: {reason}.")
    print("\nNot taken:\n\n| function | branches | line | reason |\n|---|---|---|---|")
    missed = Counter((b.function, b.text if b.file != MODEL else "") for b, value in counted.items() if not value)
    for (function, text), number in missed.items():
        line = text[:90].replace("|", "\\|")
        reason = REASONS.get(function, PRINTED if function.startswith("rule_") else "")
        print(f"| `{function}` | {number} | {f'`{line}`' if line else 'equations'} | {reason} |")
    return 0 if np.mean(logic) >= LEAST else 1


if __name__ == "__main__":
    sys.exit(main())
