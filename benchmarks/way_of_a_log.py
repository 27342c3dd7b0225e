"""The way of a recording from `fit` to the first residual: ``python benchmarks/way_of_a_log.py``.

Every function of clutchid that is handed the recording, or a plan, track or problem that holds it, is noted until the
first simulated sample is compared with a measured one. Printed are the modules in the order in which they are entered,
imports from a higher layer of the contract that it goes through, and how often it comes back to a module.
"""

from __future__ import annotations

import os
import sys
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import clutchid
from clutchid import Actuator, Fit, Log, fit
from clutchid.estimation.simulation_error.problem import Problem, ProblemSegment
from clutchid.simulation.plan import Plan
from clutchid.simulation.windows import Track
from clutchid.smoother.problem import FitProblem

os.environ["OMP_NUM_THREADS"] = "1"  # windows that other threads simulate are not seen here

ROOT = Path(__file__).resolve().parents[1]

#: Functions that compare a simulation with what was measured.
RESIDUALS = (
    "smoother.rows.window_rows",
    "estimation.simulation_error.problem._compared",
    "filter.filtering.follow",
)


class Arrived(Exception):
    """The first residual is reached."""


def layers() -> dict[str, int]:
    """Height of each package in the import contract, the ground at 0."""
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ][0]
    rows = [[name.strip() for name in row.split("|")] for row in reversed(contract["layers"])]
    return {name.removeprefix("clutchid."): height for height, row in enumerate(rows) for name in row}


def carries(value: Any) -> bool:
    """Whether a value is the recording, or holds it."""
    if isinstance(value, (Log, Plan, Track, FitProblem, Problem, ProblemSegment)):
        return True
    if isinstance(value, Mapping):
        return any(map(carries, value.values()))
    return isinstance(value, (list, tuple)) and any(map(carries, value))


def way(log: Log, actuator: Actuator | None, options: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(caller, callee) modules of every call that hands the recording on, until the first residual."""
    calls: list[tuple[str, str]] = []

    def note(frame: FrameType, event: str, _: Any) -> None:
        module = frame.f_globals.get("__name__", "")
        if event != "call" or not module.startswith("clutchid.") or "<" in frame.f_code.co_name:
            return
        given = frame.f_code.co_varnames[: frame.f_code.co_argcount + frame.f_code.co_kwonlyargcount]
        if module == "clutchid.log" or not any(carries(frame.f_locals.get(name)) for name in given):
            return
        caller = frame.f_back
        while caller is not None and not str(caller.f_globals.get("__name__", "")).startswith("clutchid."):
            caller = caller.f_back
        origin = caller.f_globals["__name__"].removeprefix("clutchid.") if caller else "user"
        calls.append((origin, module.removeprefix("clutchid.")))
        if f"{calls[-1][1]}.{frame.f_code.co_name}" in RESIDUALS:
            raise Arrived

    sys.setprofile(note)
    try:
        fit(log, actuator, **options)
    except Arrived:
        pass
    finally:
        sys.setprofile(None)
    return calls


def described(title: str, calls: Sequence[tuple[str, str]], height: Mapping[str, int]) -> str:
    """The way in words."""
    order = list(dict.fromkeys(module for _, module in calls))
    upwards = {
        (origin, module)
        for origin, module in calls
        if origin != "user"
        and height[module.partition(".")[0]] > height[origin.partition(".")[0]]
        and f"from clutchid.{module} import"
        in Path(sys.modules[f"clutchid.{origin}"].__file__ or "").read_text("utf-8")
    }
    sequence = [module for i, (_, module) in enumerate(calls) if i == 0 or calls[i - 1][1] != module]
    returns = len(sequence) - len(order)
    lines = [f"{title}: {len(order)} modules, {len(upwards)} imports upwards, {returns} returns"]
    lines += [f"  {number:2d}  {module}" for number, module in enumerate(order, 1)]
    lines += [f"  upwards: {origin} -> {module}" for origin, module in sorted(upwards)]
    return "\n".join(lines)


def main() -> None:
    """Print the way of a plain fit, of a calibration's search, and of a load read from position alone."""
    height = layers()
    log = clutchid.bundled_recording().slice(0, 5000)
    rich = Actuator(model="energy-balance-stribeck", load=clutchid.Load.on_b_splines())
    both = ("position", "pressure_a")
    once: Fit = fit(log, rich, measure=both, free=("load", "C_vs"), method="shooting")
    ways = {
        "plain fit": (None, {}),
        "calibration": (rich, {"measure": both, "free": ("auto",)}),
        "load from position alone": (once.actuator, {"calibration": once.calibration}),
    }
    for title, (actuator, options) in ways.items():
        print(described(title, way(log, actuator, options), height))


if __name__ == "__main__":
    main()
