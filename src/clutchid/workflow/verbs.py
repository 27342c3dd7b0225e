"""The verbs of the command line in Python, as far as they concern single recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from clutchid.arguments import checked
from clutchid.errors import DataError
from clutchid.estimation.fit import LogOrPath, MethodName, fit_any, recordings_of, request_of
from clutchid.estimation.parameter_file import ParameterFile, read_parameters, started
from clutchid.estimation.result import Fit
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log import Log
from clutchid.measurements import AMBIENT
from clutchid.model.actuator import Actuator
from clutchid.numerics.progress import Progress
from clutchid.simulation.partition import Partition
from clutchid.strokes.vented_rest import Zero
from clutchid.workflow import fast_enough, observed, parameter_file

if TYPE_CHECKING:
    from clutchid.exports.c99 import Rates, Real
    from clutchid.exports.exporting import Export, Target
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.observer.recording import ObservedRecording
    from clutchid.rig import CoulombFriction, LugreFit


@checked
def calibrate(
    logs: LogOrPath | Sequence[LogOrPath],
    actuator: Actuator | None = None,
    *,
    measure: str | Sequence[str] = ("position", "pressure_a"),
    free: str | Sequence[str] = ("auto",),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    partition: Partition | None = None,
    verify: LogOrPath | Sequence[LogOrPath] = (),
    method: MethodName | None = None,
    priors: Mapping[str, Prior] | None = None,
    profile: str | Sequence[str] = (),
    bootstrap: int = 0,
    zero: Zero = "subtract",
    on_failure: Literal["raise", "return"] = "raise",
    progress: Progress | None = None,
) -> Fit:
    """Calibrate an actuator from recordings with pressure: its load, and all that they can determine beside it.

    It is `clutchid.fit` with other defaults of `measure` and `free`.

    Parameters
    ----------
    logs : Log or path, or several
        Recordings with position, duty cycles and `pressure_a`, all of one state of wear.
    actuator : Actuator, optional
        Model and start values; by default the energy balance with Stribeck friction, Appendix A, and a load on
        B-splines.
    measure : 'position', 'pressure_a'
        Measured columns to compare with; a calibration needs the pressure among them.
    free : names
        Free parameters; 'auto' means all that recordings with pressure can determine.
    bounds, partition, verify, method, priors, profile, bootstrap, zero, on_failure, progress
        As in `clutchid.fit`.

    Returns
    -------
    fit : Fit
        `clutchid.estimate` starts from it, also from a file: ``write_parameters(parameter_file(fit), path)``.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`.

    Examples
    --------
    4 s of driving give the supply pressure to better than 1.5 bar, and a load that may be trusted:

    >>> import clutchid
    >>> cal = clutchid.calibrate(clutchid.bundled_recording().slice(0, 4000))
    >>> cal.verdict.trust, bool(8e5 < cal.parameters["P_S"].value < 10e5), bool(cal.parameters["P_S"].std < 0.75e5)
    ('good', True, True)
    """
    request = request_of(measure, free, bounds, partition, method, priors, profile, bootstrap, zero)
    return fit_any(logs, actuator, request, verify, on_failure, progress)


@checked
def estimate(
    logs: LogOrPath | Sequence[LogOrPath],
    start: Fit | ParameterFile | str | PathLike[str],
    *,
    measure: str | Sequence[str] = ("position",),
    free: str | Sequence[str] = ("load",),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    partition: Partition | None = None,
    verify: LogOrPath | Sequence[LogOrPath] = (),
    method: MethodName | None = None,
    priors: Mapping[str, Prior] | None = None,
    profile: str | Sequence[str] = (),
    bootstrap: int = 0,
    zero: Zero = "subtract",
    on_failure: Literal["raise", "return"] = "raise",
    progress: Progress | None = None,
) -> Fit:
    """Estimate the load of a clutch from position alone, and what has changed since its calibration.

    It is `clutchid.fit` from a calibration.

    Parameters
    ----------
    logs : Log or path, or several
        Recordings with position and duty cycles, all of one state of wear.
    start : Fit, ParameterFile or path
        The calibration: the result of `clutchid.calibrate`, or a file with it.
    measure : 'position', 'pressure_a'
        Measured columns to compare with.
    free : names
        Free parameters; 'load' means all load weights.
    bounds, partition, verify, method, priors, profile, bootstrap, zero, on_failure, progress
        As in `clutchid.fit`.

    Returns
    -------
    fit : Fit
        ``fit.comparison`` has the load against that of the calibration, ``fit.changes`` what else has changed.

    Raises
    ------
    DataError, ParameterError, SolveError
        As `clutchid.fit`; also if the file of the calibration cannot be read.

    Examples
    --------
    The supply pressure from 4 s with pressure, then the load from the position of the next 4 s alone:

    >>> import clutchid
    >>> log = clutchid.bundled_recording()
    >>> cal = clutchid.calibrate(log.slice(0, 4000), free="load,P_S")
    >>> later = clutchid.estimate(log.slice(4000, 8000).without("pressure_a"), cal)
    >>> f"{later.load_curve.force.max() / 1e3:.0f} kN"
    '4 kN'
    """
    request = request_of(measure, free, bounds, partition, method, priors, profile, bootstrap, zero)
    content = _content(start)
    return fit_any(logs, content.actuator, started(content, request), verify, on_failure, progress)


def _content(start: Fit | ParameterFile | str | PathLike[str]) -> ParameterFile:
    """The parameters and the calibration to start from."""
    if isinstance(start, ParameterFile):
        return start
    return parameter_file(start) if isinstance(start, Fit) else read_parameters(start)


@checked
def export(
    calibration: Fit | ParameterFile | str | PathLike[str],
    out: str | PathLike[str],
    *,
    to: Sequence[Target] = ("c",),
    method: str = "joint",
    modes: int | None = None,
    real: Real = "float",
    rates: Rates = "one",
    name: str = "clutch",
    resume: str | PathLike[str] | None = None,
    check: LogOrPath | None = None,
    model: bool = False,
) -> Export:
    """Write the on-line observer of a calibration as C99 for a control unit, and compare it with the one in Python.

    Parameters
    ----------
    calibration : Fit, ParameterFile or path
        The calibration: the result of `clutchid.calibrate`, or a file with it.
    out
        Folder to write; it is made.
    to : 'c', 'fmu2', 'matlab', 'a2l', 'dbc'
        What is written.
    method, modes
        Method of the observer, and how many modes of the load adapt in place of its weights.
    real : 'float' or 'double'
        Type of every number in C.
    rates : 'one' or 'two'
        Everything in the task of a sample, or corrections in a slower task.
    name
        Before every name in C, a C identifier.
    resume
        File with the state of an observer, from which the export goes on.
    check : Log or path, optional
        Recording on which C and Python are compared; by default a short simulated drive.
    model
        Whether the actuator with its load is written as an FMU too.

    Returns
    -------
    export : Export
        The files, and the differences of C and Python.

    Raises
    ------
    DataError, ParameterError, ExportError
        If an input is bad, the method has no covariance, or a file cannot be written.

    Examples
    --------
    C and Python differ by less than a thousandth of the peak load, in single precision:

    >>> import clutchid, tempfile
    >>> cal = clutchid.calibrate(clutchid.bundled_recording().slice(0, 4000), free="load,P_S")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     done = clutchid.export(cal, folder)
    >>> "src/clutch.c" in done.files, done.parity.load < 1e-3
    (True, True)
    """
    from clutchid.exports.c99 import CStyle
    from clutchid.exports.exporting import write_export
    from clutchid.exports.parity import begun
    from clutchid.observer.observer import observer, start
    from clutchid.observer.state_file import read_state, saved_spacing

    style, content = CStyle(name, real, rates), _content(calibration)
    spacing = 1e-3 if resume is None else saved_spacing(resume)
    one = observer(content.actuator, method, spacing, content.calibration, modes=modes)
    state = begun(one, start(one) if resume is None else read_state(one, resume))
    log = None if check is None else recordings_of([check], content.actuator)[0]
    title = f"{'a fit' if isinstance(calibration, Fit | ParameterFile) else Path(calibration).name}, method {method}"
    return write_export(one, state, Path(out), style, title, to=to, check=log, model=model)


@checked
def observe(
    log: LogOrPath,
    start: Fit | ParameterFile | str | PathLike[str],
    *,
    method: str = "joint",
    resume: str | PathLike[str] | None = None,
    zero: Zero = "subtract",
) -> ObservedRecording:
    """Follow the load and the pressure of a recording from position and duty cycles alone, sample by sample.

    For samples as they come, and for blocks of them, see `clutchid.observer`.

    Parameters
    ----------
    log : Log or path
        Recording with position and duty cycles at 1 kHz.
    start : Fit, ParameterFile or path
        The calibration.
    method : name
        'joint', 'joint-reduced', 'states', 'paper', 'rls' or 'adaptive', see docs/commands/observe.md.
    resume : path, optional
        A state that was saved with `clutchid.observer.write_state`.
    zero : 'subtract' or 'keep'
        Whether a vented rest that has moved is subtracted from the position.

    Returns
    -------
    found : ObservedRecording
        ``found.estimates()`` is a `Log` of all samples, ``found.load_by_stroke()`` one with a row a stroke, and
        ``found.health`` has seconds by fault.

    Raises
    ------
    DataError, ParameterError
        If recording, calibration, method and state do not fit each other.

    Examples
    --------
    After one stroke the observer knows the load, without the pressure sensor:

    >>> import clutchid
    >>> log = clutchid.bundled_recording().slice(0, 4000)
    >>> found = clutchid.observe(log.without("pressure_a"), clutchid.calibrate(log, free="load,P_S"))
    >>> f"{found.strokes[-1].curve.force.max() / 1e3:.1f} kN, {found.estimates()['pressure_a'].max() / 1e5:.1f} bar"
    '4.3 kN, 5.2 bar'
    """
    content = _content(start)
    (recording,) = recordings_of([log], content.actuator)
    ready = fast_enough(content.actuator.equipment.driven(recording), content)
    return observed(ready, content, method, None if resume is None else Path(resume), zero)


@checked
def cut(
    recording: LogOrPath,
    *,
    seconds: float = 60.0,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
) -> Log:
    """The strokes of a long recording with the most information about the load, as one recording with holes.

    Parameters
    ----------
    recording : Log or path
        Of any length; a file is read in pieces.
    seconds : s
        Greatest total length of the strokes.
    ambient : Pa, optional
        Ambient pressure for gauge units, by default 101,300 Pa.
    channels, dbc
        As in `clutchid.read`.

    Returns
    -------
    log : Log
        Strokes in order of time; where samples were left out, its time has a hole.

    Raises
    ------
    DataError
        If there is no usable stroke of at most that length.

    Examples
    --------
    The strokes of half a minute that say most about the load, in less than 8 s:

    >>> import clutchid
    >>> best = clutchid.cut(clutchid.bundled_recording(), seconds=8.0)
    >>> bool(len(best) <= 8000), f"{best['position'].max() * 1e3:.0f} mm"
    (True, '23 mm')
    """
    from clutchid.measurements import read_pieces
    from clutchid.strokes import choose, joined
    from clutchid.strokes import cut as sections_of

    if isinstance(recording, Log):
        name, pieces = recording.name, iter([recording])
    else:
        name, pieces = str(recording), read_pieces(recording, ambient=ambient, channels=channels, dbc=dbc)
    chosen = choose(sections_of(pieces), seconds)
    if not chosen:
        raise DataError(f"{name}: no usable stroke of at most {seconds:g} s was found.")
    return joined(chosen)


@checked
def friction(
    logs: LogOrPath | Sequence[LogOrPath],
    *,
    law: Literal["coulomb", "lugre"] = "coulomb",
    ambient: float | None = None,
    area: float | None = None,
    fixed: Mapping[str, float] | None = None,
    inertia: float = 0.0,
) -> CoulombFriction | list[LugreFit]:
    """Friction of a seal from recordings of a test rig, with position, force and, where measured, pressure.

    Parameters
    ----------
    logs : Log or path, or several
        Recordings with the columns position and force.
    law : 'coulomb' or 'lugre'
        Coulomb friction at each constant pressure, see `clutchid.rig.coulomb_friction`; or F_C, K_z, D_v and D_zdot of
        each recording, see `clutchid.rig.fit_lugre`.
    ambient : Pa, optional
        Ambient pressure, by default 101,300 Pa.
    area : m², optional
        Slope of the force over the pressure, if known; for 'coulomb'.
    fixed : {name: value}, optional
        Parameters that are not estimated, in SI; for 'lugre'.
    inertia : kg
        Mass between the load cell and the friction; for 'lugre'.

    Returns
    -------
    found : CoulombFriction or list of LugreFit
        By `law`; of LuGre one for each recording.

    Raises
    ------
    DataError, ParameterError
        If a recording lacks a column or has no usable strokes.

    Examples
    --------
    A seal that brakes with 5 N each way:

    >>> import clutchid
    >>> import numpy as np
    >>> t = np.arange(0.0, 40.0, 0.01)
    >>> y, way = 0.04 * np.abs((t / 4 + 1) % 2 - 1), np.where(t % 8.0 < 4.0, 1.0, -1.0)
    >>> found = clutchid.friction(clutchid.Log(t, {"position": y, "force": 5.0 * way}))
    >>> f"{found.levels[0].friction.value:.1f} N"
    '5.0 N'
    """
    from clutchid.measurements import read
    from clutchid.rig import coulomb_friction, fit_lugre

    outside, needed = AMBIENT if ambient is None else ambient, ("time", "position", "force")
    several = [logs] if isinstance(logs, Log | str | PathLike) else logs
    recordings = [one if isinstance(one, Log) else read(one, ambient=outside, required=needed) for one in several]
    if law == "lugre":
        return [fit_lugre(one, fixed=fixed or {}, inertia=inertia) for one in recordings]
    return coulomb_friction(recordings, ambient=outside, area=area)
