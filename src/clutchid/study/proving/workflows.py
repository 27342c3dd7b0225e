"""Named workflows of the proving ground; the first is the paper's method."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial

from clutchid.documents.changes import notes_of
from clutchid.errors import ParameterError, SolveError
from clutchid.estimation import Fit
from clutchid.estimation.automatic import AUTOMATIC
from clutchid.estimation.fit import MethodName
from clutchid.estimation.request import FitRequest
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.names import unknown_name
from clutchid.simulation import Partition, simulate
from clutchid.study.proving.scores import Answer, Workflow
from clutchid.verbs.fitting import fit


def paper_method(partition: Partition | None, calibration: Log, worn: Sequence[Log]) -> list[Answer]:
    """The paper: position only, Appendix A, three splines; the calibration recording is not used."""
    del calibration
    return [_answer(fit(log, request=FitRequest(partition=partition)), log) for log in worn]


def calibrated(
    model: str,
    adapt: Callable[[Fit, Log], Fit],
    calibration: Log,
    worn: Sequence[Log],
    *,
    method: MethodName = "shooting",
) -> list[Answer]:
    """Calibrate once with pressure, then estimate the load of every worn recording from position alone."""
    both = ("position", "pressure_a")
    once = fit(calibration, Actuator(model=model), measure=both, free=("auto",), method=method)
    return [_answer(adapt(once, log), log) for log in worn]


def adapted(once: Fit, log: Log, method: MethodName = "shooting") -> Fit:
    """Default: only the load is free, corrected by the position-only bias on the calibration recording."""
    return fit(log, once.actuator, request=FitRequest(calibration=once.calibration), method=method)


def by_simulation(partition: Partition | None, once: Fit, log: Log) -> Fit:
    """The paper's simulation error method with the calibrated actuator; no prior on the load."""
    return fit(log, once.actuator, request=FitRequest(partition=partition))


def not_adapted(once: Fit, log: Log) -> Fit:
    """The load of the new clutch, without adaptation."""
    return replace(fit(log, once.actuator, free=()), load_curve=once.load_curve)


def uncorrected(once: Fit, log: Log) -> Fit:
    """As `adapted`, without the bias correction."""
    assert once.calibration is not None
    return fit(log, once.actuator, request=FitRequest(calibration=replace(once.calibration, position_only=None)))


def with_mean_valves(once: Fit, log: Log) -> Fit:
    """As `adapted`, with valves averaged over the period, as in the paper."""
    return adapted(replace(once, actuator=once.actuator.replace({"T_pwm": 0.0})), log)


def _answer(result: Fit, log: Log) -> Answer:
    """Load and pressure of a fit; pressure from the fit if it follows the position, else by ballistic simulation."""
    if result.status == "failed":
        raise SolveError(result.message)
    curve = result.load_curve
    recording = result.recordings[log.name]
    if result.follows:
        pressure = recording.simulated["pressure_a"]
    else:
        simulation = simulate(result.actuator, log, starts=recording.starts, on_failure="return")
        pressure = simulation.log["pressure_a"]
    details = {
        "parameters": {name: asdict(estimate) for name, estimate in result.parameters.items()},
        "position_rms_m": result.errors.position_rms,
        "message": result.message,
        "warnings": list(result.warnings),
        "notes": notes_of(result),
    }
    return Answer(curve.position, curve.force, curve.low, curve.high, pressure, details)


#: Workflows by name.
_WORKFLOWS: dict[str, Workflow] = {
    "paper": partial(paper_method, None),
    "paper-every-200": partial(paper_method, Partition(every=200)),
    "paper-every-200-q": partial(paper_method, Partition(every=200, carry="q")),
    "paper-8-parts": partial(paper_method, Partition(parts=8)),
    "calibrated": partial(calibrated, AUTOMATIC, adapted),
    "calibrated-uncorrected": partial(calibrated, AUTOMATIC, uncorrected),
    "calibrated-mean-valves": partial(calibrated, AUTOMATIC, with_mean_valves),
    "calibrated-no-stribeck": partial(calibrated, "energy-balance", adapted),
    "calibrated-isothermal": partial(calibrated, "isothermal-stribeck", adapted),
    "calibrated-not-adapted": partial(calibrated, AUTOMATIC, not_adapted),
    "calibrated-every-200": partial(calibrated, AUTOMATIC, partial(by_simulation, Partition(every=200))),
    "calibrated-prediction-error": partial(
        calibrated, AUTOMATIC, partial(adapted, method="prediction-error"), method="prediction-error"
    ),
    "calibrated-ballistic": partial(calibrated, AUTOMATIC, partial(by_simulation, None)),
}


def workflow(name: str) -> Workflow:
    """A workflow by its name, or a user-defined one as ``MODULE:FUNCTION``.

    Raises
    ------
    ParameterError
        If there is none; the text gives the nearest known name, or the problem of the module.
    """
    if name in _WORKFLOWS:
        return _WORKFLOWS[name]
    module, colon, function = name.partition(":")
    if not colon:
        raise ParameterError(
            unknown_name(name, _WORKFLOWS, "workflow") + " For your own workflow write MODULE:FUNCTION."
        )
    if not all(part.isidentifier() for part in (*module.split("."), function)):
        raise ParameterError(
            f"--workflow {name}: write MODULE:FUNCTION of an importable module, such as mine.tuned:run."
        )
    try:
        run: Workflow = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError) as error:
        raise ParameterError(f"--workflow {name}: {error}; write MODULE:FUNCTION of an importable module.") from error
    if not callable(run):
        raise ParameterError(f"--workflow {name}: is not a function; it must accept a calibration log and worn logs.")
    return run
