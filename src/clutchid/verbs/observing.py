"""`observe`: load and pressure of a recording on line, from a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from clutchid.arguments import checked
from clutchid.errors import DataError
from clutchid.log import Log
from clutchid.strokes.vented_rest import Zero
from clutchid.verbs.reading import LogOrPath, Reading, reading_of
from clutchid.verbs.start import CalibrationSource, calibration_file

# imported on use: a command that only reads files starts faster
if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile
    from clutchid.measurements.map.channel_map import ChannelMap
    from clutchid.observer.configuration import Observer
    from clutchid.observer.run import ObservedRecording
    from clutchid.observer.state import ObserverState


#: Last sentence of the refusal of a recording that is too slow.
ANYWAY = " Or go on with --force (in Python force=True)."


@checked
def observe(
    log: LogOrPath,
    start: CalibrationSource,
    *,
    method: str = "joint",
    resume: str | PathLike[str] | None = None,
    zero: Zero = "subtract",
    force: bool = False,
    ambient: float | None = None,
    channels: ChannelMap | str | PathLike[str] | None = None,
    dbc: Sequence[str | PathLike[str]] = (),
    supply_std: float | None = None,
    supply_sensor_std: float | None = None,
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
        'joint', 'states' or 'paper', see docs/commands/observe.md.
    resume : path, optional
        A state that was saved with `clutchid.observer.write_state`.
    zero : 'subtract' or 'keep'
        Whether a vented rest that has moved is subtracted from the position.
    force, ambient, channels, dbc
        As in `clutchid.fit`.
    supply_std : 1, optional
        Standard deviation of a supply pressure that is not recorded from that of the calibration, as a share of it,
        from 0 to 0.5; by default 0.03. It widens the bands of load and pressure.
    supply_sensor_std : 1, optional
        The same for a recorded supply pressure, due to the errors of the sensors in both recordings; by default
        from 0.5 % of 10 bar each. It widens the bands of the load.

    Returns
    -------
    observed : ObservedRecording
        ``observed.estimates()`` is a `Log` of all samples, ``observed.load_by_stroke()`` one with a row a stroke, and
        ``observed.health`` has seconds by fault.

    Raises
    ------
    DataError, ParameterError
        If the recording cannot be read, a check of it is bad, or recording, calibration, method and state do not fit
        each other.

    Examples
    --------
    After one stroke the observer knows the load, without the pressure sensor:

    >>> import clutchid
    >>> log = clutchid.bundled_recording().slice(0, 4000)
    >>> run = clutchid.observe(log.without("pressure_a"), clutchid.calibrate(log, free="load,P_S"))
    >>> f"{run.strokes[-1].curve.force.max() / 1e3:.1f} kN, {run.estimates()['pressure_a'].max() / 1e5:.1f} bar"
    '4.3 kN, 5.2 bar'
    """
    reading = reading_of(log, ambient=ambient, channels=channels, dbc=dbc, force=force, zero=zero)
    asked = ObserveRequest(method, None if resume is None else Path(resume), supply_std, supply_sensor_std)
    return observed(reading, calibration_file(start), asked)


class ObserveRequest(NamedTuple):
    """Request of an observation: the method, the state to go on from, and spreads of the supply, as of `observe`."""

    method: str = "joint"
    resume: Path | None = None
    supply_std: float | None = None
    supply_sensor_std: float | None = None


#: The request where none is made.
USUAL_OBSERVER = ObserveRequest()


def observed(reading: Reading, content: ParameterFile, request: ObserveRequest = USUAL_OBSERVER) -> ObservedRecording:
    """Read and check a recording, and follow it with the observer of a calibration, or from a saved state.

    Raises
    ------
    DataError, ParameterError
        As `observe`.
    """
    from clutchid.observer.run import observe_recording, too_slow, unused_conditions

    (log,) = reading.checked(content.actuator, rest=content.rest)
    slow = too_slow(log, content.actuator)
    if slow and not reading.force:
        raise DataError(f"{slow}{ANYWAY}")
    observer, state = observer_of(log, content, request, reading.zero)
    warnings = (*log.warnings, *filter(None, (slow,)), *unused_conditions(observer, log))
    return observe_recording(observer, replace(log, warnings=warnings), state)


def observer_of(
    log: Log, content: ParameterFile, request: ObserveRequest, zero: Zero
) -> tuple[Observer, ObserverState]:
    """The observer of a calibration for a recording, of which the first samples suffice, and the state to start from.

    Raises
    ------
    DataError, ParameterError
        As `observe`.
    """
    from clutchid.observer.configuration import observer, start
    from clutchid.observer.prior import SUPPLY_STD
    from clutchid.observer.run import check_pace, spacing
    from clutchid.observer.state_file import read_state, saved_spacing

    method, resume, supply_std, of_sensor = request
    every = spacing(log) if resume is None else saved_spacing(resume)
    share = SUPPLY_STD if supply_std is None else supply_std
    observing = observer(content.actuator, method, every, content.calibration, zero, share, of_sensor)
    check_pace(observing, log)
    return observing, start(observing) if resume is None else read_state(observing, resume)
