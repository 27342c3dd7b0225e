"""Read, inspect, fit, observe, report: the workflow from files to a result, for the command line, pages and fleets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.arguments import checked
from clutchid.errors import DataError, ExportError, ParameterError
from clutchid.log import INPUTS, Log
from clutchid.names import printable

# imported on use: a command that only reads files starts faster
if TYPE_CHECKING:
    from clutchid.estimation import Fit
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.estimation.request import FitRequest
    from clutchid.model.actuator import Actuator
    from clutchid.model.compiled import Model
    from clutchid.model.equipment import Equipment
    from clutchid.numerics.progress import Progress
    from clutchid.observer.observer import Observer
    from clutchid.observer.recording import ObservedRecording
    from clutchid.observer.state import ObserverState
    from clutchid.strokes.vented_rest import VentedRest, Zero


#: The last line of what refuses a recording for a check that is bad.
REFUSED = "Correct the recording or its channel map, or go on with --force."


@dataclass(frozen=True, slots=True)
class FileOptions:
    """Options for reading files: ambient pressure in Pa if stated, channel map, DBC files of bus logs.

    `added` in Pa is what gauge pressures get without a stated ambient pressure.
    """

    ambient: float | None = None
    channel_map: Path | None = None
    dbc: tuple[Path, ...] = ()
    added: float | None = None


def read_recordings(
    paths: Sequence[Path],
    files: FileOptions,
    equipment: Equipment | None = None,
    required: Sequence[str] | None = None,
    measured: Sequence[str] = (),
    verify: Sequence[Path] = (),
) -> list[Log]:
    """Read recordings with the `required` columns, and behind them those to `verify` with.

    By default these are the time, the position, and the duty cycles of the existing valves; with a channel map also
    those `measured`, which the recordings to verify with may lack.

    Raises
    ------
    DataError
        The text lists the problems of all files.
    """
    from clutchid.measurements import read, read_each

    channels = None
    if files.channel_map is not None:
        from clutchid.measurements.map.channel_map import read_map

        channels = read_map(files.channel_map)
    needed = required or ("time", "position", *(equipment.recorded if equipment else INPUTS))
    fitted = needed
    if channels is not None:
        from clutchid.measurements.map.picking import OPTIONAL

        fitted = (*needed, *(name for name in measured if name in OPTIONAL))

    def one(item: tuple[Path, Sequence[str]]) -> Log:
        path, names = item
        log = read(path, ambient=files.ambient, added=files.added, channels=channels, dbc=files.dbc, required=names)
        return equipment.driven(log) if equipment else log

    return read_each([*((path, fitted) for path in paths), *((path, needed) for path in verify)], one)


def inspected(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    force: bool = False,
    rest: VentedRest | None = None,
    zero: Zero = "subtract",
) -> list[Log]:
    """Recordings with the findings of the checks before a fit among their warnings.

    What is checked is what will be fitted: with `zero` "subtract" the travel from the vented `rest` of a calibration.

    Raises
    ------
    DataError
        If a check is bad, unless with `force`; the text has the sentences of `clutchid look`.
    """
    from clutchid.preparation.inspection import inspect
    from clutchid.strokes.values import values_of
    from clutchid.strokes.vented_rest import from_rest

    values = [values_of(log, actuator) for log in logs]
    found = [inspect(from_rest(each.log, rest, zero).log, actuator) for each in values]
    bad = [str(DataError.of(one.name, list(one.bad))) for one in found if one.bad]
    if bad and not force:
        raise DataError("\n".join([*bad, REFUSED]))
    return [
        replace(log, warnings=(*each.warned.warnings, *one.warnings))
        for log, each, one in zip(logs, values, found, strict=True)
    ]


def start_file(path: Path, model: Model | None) -> ParameterFile:
    """The parameter file to start from; it defines the model, but for one of the user's own, which must be the same.

    Raises
    ------
    ParameterError
        If the file cannot be understood, or a different `model` is given.
    """
    from clutchid.estimation.parameter_file import read_parameters
    from clutchid.model.own import OwnModel

    content = read_parameters(path, model if isinstance(model, OwnModel) else None)
    if model is not None and model != content.actuator.model:
        known = content.actuator.model
        raise ParameterError(f"--model {model}: {path} is for the model '{known}'; leave --model out.")
    return content


def start_of(path: Path | None, model: Model | None, request: FitRequest) -> tuple[Actuator, FitRequest]:
    """The actuator to start from, and the request with calibration and search of its file, if it supports them.

    Raises
    ------
    ParameterError
        As `start_file`.
    """
    from clutchid.estimation.automatic import AUTOMATIC
    from clutchid.estimation.parameter_file import started
    from clutchid.model.actuator import Actuator

    if path is None:
        return Actuator(model=model or (AUTOMATIC if request.automatic else "isothermal")), request
    content = start_file(path, model)
    return content.actuator, started(content, request)


def fit_recordings(
    logs: Sequence[Log],
    actuator: Actuator,
    request: FitRequest,
    verify: Sequence[Log] = (),
    progress: Progress | None = None,
    *,
    force: bool = False,
) -> Fit:
    """Inspect recordings, and fit them as requested.

    With `force` a recording that a check finds bad is fitted as well.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`.
    """
    from clutchid.estimation.fit import fit_request
    from clutchid.numerics.progress import report as reported

    reported(progress, "checks")
    checked = inspected([*logs, *verify], actuator, force=force, rest=request.counted_from, zero=request.zero)
    return fit_request(checked[: len(logs)], actuator, request, checked[len(logs) :], progress).raised()


def fast_enough(log: Log, content: ParameterFile, *, force: bool = False) -> Log:
    """The recording with warnings about its rate and its supply pressure.

    Raises
    ------
    DataError
        If it is too slow for an observer, unless with `force`.
    """
    from clutchid.observer.prior import unused_supply
    from clutchid.observer.recording import too_slow

    slow = too_slow(log, content.actuator)
    if slow and not force:
        raise DataError(f"{slow} Or go on with --force.")
    found = (slow, unused_supply(log, content.actuator, content.calibration))
    return replace(log, warnings=(*log.warnings, *filter(None, found)))


def observer_of(
    log: Log, content: ParameterFile, method: str, resume: Path | None, zero: Zero
) -> tuple[Observer, ObserverState]:
    """The observer of a calibration for a recording, of which the first samples suffice, and the state to start from.

    Raises
    ------
    DataError, ParameterError
        As `observed`.
    """
    from clutchid.observer.observer import observer, start
    from clutchid.observer.recording import check_pace, spacing
    from clutchid.observer.state_file import read_state, saved_spacing

    every = spacing(log) if resume is None else saved_spacing(resume)
    one = observer(content.actuator, method, every, content.calibration, zero)
    check_pace(one, log)
    return one, start(one) if resume is None else read_state(one, resume)


def observed(
    log: Log, content: ParameterFile, method: str = "joint", resume: Path | None = None, zero: Zero = "subtract"
) -> ObservedRecording:
    """Follow a recording with the observer of a calibration, from its first sample or from a saved state.

    Raises
    ------
    DataError, ParameterError
        If recording, calibration, method and state do not fit each other.
    """
    from clutchid.observer.recording import observe_recording

    one, state = observer_of(log, content, method, resume, zero)
    return observe_recording(one, log, state)


def check_save(path: Path) -> None:
    """Check, before a long computation, that `save` can write a file with this name.

    Raises
    ------
    ExportError
        If the suffix is unknown, or MATLAB cannot use the name.
    """
    from clutchid.estimation.parameter_file import MATLAB_SUFFIXES
    from clutchid.reports.matlab import check_name

    suffix = path.suffix.lower()
    if suffix in MATLAB_SUFFIXES:
        check_name(path)
    elif suffix not in ("", ".toml"):
        raise ExportError(
            f"{path}: the suffix '{path.suffix}' is not known; a fit is saved as .toml, for --start and simulate, or "
            "as .mat or .m, for MATLAB."
        )


@checked
def parameter_file(fit: Fit) -> ParameterFile:
    """Contents of a parameter file for a fit, with the trust of its verdict.

    Parameters
    ----------
    fit : Fit
        Of any method and status.

    Returns
    -------
    content : ParameterFile
        `clutchid.write_parameters` writes it; `clutchid.estimate` takes it as a calibration.

    Examples
    --------
    >>> import clutchid
    >>> fit = clutchid.fit(clutchid.bundled_recording().slice(0, 4000))
    >>> content = clutchid.parameter_file(fit)
    >>> content.actuator == fit.actuator, content.fit["free"]
    (True, ['theta_1', 'theta_2', 'theta_3'])
    """
    from clutchid.estimation.assess.verdict import verdict
    from clutchid.estimation.parameter_file import parameter_file as with_trust

    return with_trust(fit, verdict(fit).trust)


def save(fit: Fit, path: Path) -> None:
    """Write the result as a parameter file, or for MATLAB if the suffix is ``.mat`` or ``.m``.

    Raises
    ------
    ExportError
        If the suffix is unknown or the file cannot be written; an existing file is unchanged.
    """
    from clutchid.estimation.parameter_file import MATLAB_SUFFIXES, write_parameters
    from clutchid.reports.matlab import write_matlab

    check_save(path)
    if path.suffix.lower() in MATLAB_SUFFIXES:
        write_matlab(fit, path)
    else:
        write_parameters(parameter_file(fit), path)


def report(fit: Fit, command: str, path: Path) -> None:
    """Write the page of the result, with the `command` that repeats it.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is unchanged.
    """
    from clutchid.reports.fit_page import fit_page

    fit_page(fit, printable(command), path)
