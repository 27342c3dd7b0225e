"""Workflows that the proving ground knows by name; the paper's method is the first entrant."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial

from clutchid.errors import ParameterError
from clutchid.estimate import Fit, fit
from clutchid.log import Log
from clutchid.parameters import unknown_name
from clutchid.simulation import Partition, simulate
from clutchid.study.proving.answers import Answer, Workflow


def paper_method(partition: Partition | None, calibration: Log, worn: Sequence[Log]) -> list[Answer]:
    """The paper: position only, Appendix A, three splines; the calibration recording is not looked at."""
    del calibration
    return [_answer(fit(log, partition=partition), log) for log in worn]


def _answer(result: Fit, log: Log) -> Answer:
    """The load of a fit, and the pressure of a ballistic simulation with it."""
    curve = result.load_curve
    starts = result.recordings[log.name].starts
    pressure = simulate(result.actuator, log, starts=starts, on_failure="return").log["pressure_a"]
    kept = {
        "parameters": {name: asdict(estimate) for name, estimate in result.parameters.items()},
        "position_rms_m": result.errors.position_rms,
        "message": result.message,
        "warnings": list(result.warnings),
    }
    return Answer(curve.position, curve.force, curve.low, curve.high, pressure, kept)


#: Workflows by name.
WORKFLOWS: dict[str, Workflow] = {
    "paper": partial(paper_method, None),
    "paper-every-200": partial(paper_method, Partition(every=200)),
    "paper-every-200-q": partial(paper_method, Partition(every=200, carry="q")),
    "paper-8-parts": partial(paper_method, Partition(parts=8)),
}


def workflow(name: str) -> Workflow:
    """A workflow by its name, or one of your own as ``MODULE:FUNCTION``.

    Raises
    ------
    ParameterError
        If there is none; the text names the nearest known one, or what is wrong with the module.
    """
    if name in WORKFLOWS:
        return WORKFLOWS[name]
    module, colon, function = name.partition(":")
    if not colon:
        raise ParameterError(unknown_name(name, WORKFLOWS, "workflow") + " An own one is MODULE:FUNCTION.")
    try:
        found: Workflow = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError) as error:
        raise ParameterError(f"--workflow {name}: {error}; write MODULE:FUNCTION of an importable module.") from error
    if not callable(found):
        raise ParameterError(f"--workflow {name}: is no function; it takes a calibration log and worn logs.")
    return found
