"""Read the load of one recording from a calibration; every failure is a value."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from clutchid.errors import ClutchidError, DataError, ParameterError
from clutchid.estimation.assess.comparison import change_of, compared, comparison, half_load_band, measured
from clutchid.estimation.assess.reasons import departs, reasons
from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import calibrated_curve
from clutchid.files import digest
from clutchid.log import Log
from clutchid.measurements import NoFramesError
from clutchid.names import as_text
from clutchid.processes import LostWork
from clutchid.strokes.vented_rest import Zero, from_rest
from clutchid.verbs.fitting import fitted
from clutchid.verbs.observing import ANYWAY, observed
from clutchid.verbs.reading import REFUSED, Reading
from clutchid.verbs.start import content_of
from clutchid.wear.history import (
    NO_HALF_LOAD,
    RecordingJob,
    WearReading,
    leak_of,
    not_converged,
    observed_leak,
    unmeasured,
)
from clutchid.wear.trend import LaterCalibration

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile


def read_recording(reading: Reading, by: str, job: RecordingJob) -> WearReading:
    """Read the load of a recording from position alone with its calibration; a fault is a status.

    Parameters
    ----------
    reading
        How it is read, without recordings.
    by : 'estimate' (or 'fit'), 'observe' or 'auto'
        What reads the load; 'auto' observes it, and estimates it where the supply pressure is not recorded or the
        observer has another reason not to trust its load.
    job
        A recording with a file and a calibration.
    """
    assert job.path is not None, "others are not read"
    assert job.start is not None, "others are not read"
    read = _read(replace(reading, logs=(job.path,)), by, job.path, job.start)
    return read._replace(message=as_text(read.message), reason=as_text(read.reason))  # its sentences name the file


def _read(reading: Reading, by: str, path: Path, start: Path) -> WearReading:
    clock = checksum = ""
    apart = True  # until it is a recording of an actuator
    try:
        checksum = digest(path)
        content = _calibration(start, digest(start))
        try:
            (log,) = reading.read(content.actuator)
        except NoFramesError:  # the DBC is that of other recordings of the fleet
            (log,) = replace(reading, dbc=()).read(content.actuator)
        clock, apart = str(log.metadata.get("start", "")), False
        if by in ("observe", "auto"):
            read = _observed(log, content, reading.zero, screened=by == "auto")
        else:
            read = _fitted(log, content, reading.zero)
    except ClutchidError as error:
        status = "bad_input" if isinstance(error, DataError | ParameterError) else "failed"
        apart = apart and status == "bad_input"  # what cannot be opened here may be a recording all the same
        return WearReading(status, _alone(str(error)), clock=clock, sha256=checksum, apart=apart)
    except Exception as error:  # a fleet goes on
        sentence = f"an error that clutchid did not expect, {type(error).__name__}: {error}."
        return WearReading("failed", sentence, clock=clock, sha256=checksum)
    return read._replace(clock=clock, sha256=checksum)


def _alone(message: str) -> str:
    """The message of a refused recording; it names the command with --force, as reading many recordings has none."""
    alone = " Correct the recording or its channel map, or estimate this recording alone with --force."
    return message.replace(f"\n{REFUSED}", alone).removesuffix(ANYWAY)


def unless_lost(job: RecordingJob, read: WearReading | LostWork) -> WearReading:
    """A recording as a worker process read it; without a result if the process was lost."""
    return WearReading(*read, sha256=checksum_of(job.path)) if isinstance(read, LostWork) else read


def counted_once(named: Iterable[tuple[str, WearReading]]) -> Iterator[WearReading]:
    """Recordings by name; a duplicate counts once, and becomes a warning without a measurement."""
    first: dict[str, str] = {}
    for name, read in named:
        checksum = read.sha256 if read.has_result else ""
        if checksum in first:
            yield as_copy(read, first[checksum])
            continue
        if checksum:
            first[checksum] = name
        yield read


def as_copy(read: WearReading, name: str) -> WearReading:
    """The reading of a recording whose samples are those of another one."""
    sentence = f"the same recording as {name}; it counts once."
    return read._replace(status="warning", message=sentence, measurement=None, reason=sentence, apart=True)


def checksum_of(path: Path | None) -> str:
    """SHA-256 of a file, or an empty string where it cannot be read."""
    try:
        return digest(path) if path else ""
    except DataError:
        return ""


def _fitted(log: Log, content: ParameterFile, zero: Zero) -> WearReading:
    """The load as `clutchid estimate` reads it."""
    request = FitRequest(calibration=content.calibration, zero=zero)
    fit = fitted(Reading((log,)), content.actuator, request).raised()
    judged, change = verdict(fit), comparison(fit)
    half, trust = change.half_now if change else NO_HALF_LOAD, judged.trust
    message = fit.message if trust == "good" or not judged.reasons else judged.reasons[0]
    # a load that is only uncertain counts in the trend by its band, which is no reason to warn
    doubtful = any(reason.grave or not reason.banded for reason in reasons(fit))
    status = "warning" if fit.warnings or doubtful else "ok"
    reason = not_converged(fit) or unmeasured(judged, change)
    measurement = None if reason else measured(change, log)
    changes = tuple(dict.fromkeys(change.group for change in fit.changes))
    rest = next((recording.rest for recording in fit.recordings.values()), None)
    return WearReading(
        status, message, trust, measurement, leak_of(fit), departs(fit), rest, reason, half_load=half, changes=changes,
        curve=fit.load_curve, by="estimate",
    )  # fmt: skip


def _observed(log: Log, content: ParameterFile, zero: Zero, *, screened: bool = False) -> WearReading:
    """The load as `clutchid observe` has it at the end of the recording.

    If `screened`, a load that the observer has a reason not to trust is estimated instead; what the calibration lacks
    is no reason, because an estimate lacks it too.
    """
    from clutchid.documents.observation_rows import observe_sentence
    from clutchid.estimation.assess.observed import MISMATCH, indicators, observed_verdict
    from clutchid.observer.run import loads

    try:
        run = observed(Reading((log,), zero=zero), content)
    except ClutchidError:
        if screened:  # an observer needs more samples
            return _fitted(log, content, zero)
        raise
    shown = indicators(run)
    after, judged = loads(run).after, observed_verdict(shown)
    reach = float(np.nanmax(run.travel["position"]))
    change = compared(run.observer.actuator, run.observer.calibration, after, reach)
    reason = unmeasured(judged, change)
    if screened and (reason or observed_verdict(shown._replace(unvented=())).trust != "good"):
        return _fitted(log, content, zero)
    half = change.half_now if change else half_load_band(after, reach)
    status = "warning" if run.log.warnings or any(run.health.values()) else "ok"
    measurement = None if reason else measured(change, run.log, "observe")
    rest = from_rest(run.log, content.rest, zero).shift
    return WearReading(
        status, observe_sentence(run), judged.trust, measurement, observed_leak(run), shown.mismatch > MISMATCH.none,
        rest, reason, half_load=half, curve=after, by="observe",
    )  # fmt: skip


#: Offset of a calibration whose load cannot be compared with that of the first one: not known.
_UNKNOWN = LaterCalibration(0.0, 5e-3, 0.0, 1.0)


def later_calibrations(starts: Sequence[Path]) -> dict[Path, LaterCalibration]:
    """The calibrations of a vehicle after its first one against that, from their own loads.

    The error of the first one is that of all changes of the vehicle; that of a later one is its offset in the trend.
    """
    first, *others = (_calibration(path, digest(path)) for path in starts)
    later = {}
    for path, other in zip(starts[1:], others, strict=True):
        calibration, change = other.calibration, None
        if calibration and (load := calibrated_curve(other.actuator, calibration)):
            reach = calibration.travel.reach if calibration.travel else float(load.position[-1])
            change = compared(first.actuator, first.calibration, load, reach)
        values = change_of(change) if change else None
        later[path] = LaterCalibration(*values) if values else _UNKNOWN
    return later


@lru_cache(maxsize=64)
def _calibration(path: Path, _checksum: str) -> ParameterFile:
    """A calibration, read once a process; the workers of a scheduler outlive a change of its file."""
    return content_of(path)
