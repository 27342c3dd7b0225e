"""Read the load of one recording from a calibration; every failure is a value."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clutchid.errors import ClutchidError, DataError, ParameterError
from clutchid.estimation.assess.comparison import HalfLoad, Measurement, comparison, half_load_band, measured
from clutchid.estimation.assess.reasons import departs
from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.request import FitRequest
from clutchid.files import digest
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.log import Log
from clutchid.measurements.opening import NoFramesError
from clutchid.names import as_text
from clutchid.processes import LostWork
from clutchid.strokes.vented_rest import RestShift, Zero, from_rest
from clutchid.verbs.fitting import fitted
from clutchid.verbs.observing import ANYWAY, observed
from clutchid.verbs.reading import REFUSED, Reading
from clutchid.verbs.start import start_file
from clutchid.wear.history import Leak, WearReading, leak_of, unmeasured

if TYPE_CHECKING:
    from clutchid.estimation.parameter_file import ParameterFile

#: Why a recording that was observed gives no measurement.
_ONLY_ITS_END = "the load of an observer at the end of a recording is no measurement of the wear; --verb track has one."

#: No half-load position.
_NO_HALF_LOAD = HalfLoad(np.nan, np.nan, np.nan)


class RecordingResult(NamedTuple):
    """A recording that was read.

    Attributes
    ----------
    path
        Of its file.
    reading
        What came of it.
    clock
        Start time in the file; empty if unknown.
    sha256
        Checksum of the file.
    curve : N over m
        The load; None without one.
    half_load : m
        Position where the load reaches half its peak.
    changes
        Since the calibration, one sentence each.
    """

    path: Path
    reading: WearReading
    clock: str = ""
    sha256: str = ""
    curve: LoadCurve | None = None
    half_load: HalfLoad = _NO_HALF_LOAD
    changes: tuple[str, ...] = ()


def read_recording(reading: Reading, verb: str, start: Path, path: Path) -> RecordingResult:
    """Read the load of a recording from position alone with the calibration `start`; a fault is a status.

    Parameters
    ----------
    reading
        How it is read, without recordings.
    verb : 'fit' or 'observe'
        What reads the load.
    """
    read = _read(replace(reading, logs=(path,)), verb, start, path)
    wear = read.reading  # its sentences name the file
    return read._replace(reading=wear._replace(message=as_text(wear.message), reason=as_text(wear.reason)))


def _read(reading: Reading, verb: str, start: Path, path: Path) -> RecordingResult:
    clock = checksum = ""
    try:
        checksum = digest(path)
        content = _calibration(start, digest(start))
        try:
            (log,) = reading.read(content.actuator)
        except NoFramesError:  # the DBC is that of other recordings of the fleet
            (log,) = replace(reading, dbc=()).read(content.actuator)
        clock = str(log.metadata.get("start", ""))
        read = (_observed if verb == "observe" else _fitted)(log, content, path, reading.zero)
    except ClutchidError as error:
        status = "bad_input" if isinstance(error, DataError | ParameterError) else "failed"
        return without_result(path, status, _alone(str(error)), clock, checksum)
    except Exception as error:  # a fleet goes on
        sentence = f"an error that clutchid did not expect, {type(error).__name__}: {error}."
        return without_result(path, "failed", sentence, clock, checksum)
    return read._replace(clock=clock, sha256=checksum)


def _alone(message: str) -> str:
    """The message of a refused recording; it names the command with --force, as reading many recordings has none."""
    alone = " Correct the recording or its channel map, or read it alone by estimate with --force."
    return message.replace(f"\n{REFUSED}", alone).removesuffix(ANYWAY)


def without_result(path: Path, status: str, message: str, clock: str = "", sha256: str = "") -> RecordingResult:
    """A recording that gives no load, with the reason."""
    return RecordingResult(path, WearReading(status, message, "none", None), clock, sha256)


def unless_lost(path: Path, read: RecordingResult | LostWork) -> RecordingResult:
    """A recording as a worker process read it; without a result if the process was lost."""
    return without_result(path, *read, sha256=checksum_of(path)) if isinstance(read, LostWork) else read


def counted_once(named: Iterable[tuple[str, RecordingResult]]) -> Iterator[RecordingResult]:
    """Recordings by name; a duplicate counts once, and becomes a warning without a measurement."""
    first: dict[str, str] = {}
    for name, read in named:
        checksum = read.sha256 if read.reading.has_result else ""
        if checksum in first:
            sentence = f"the same recording as {first[checksum]}; it counts once."
            again = read.reading._replace(status="warning", message=sentence, measurement=None, reason=sentence)
            yield read._replace(reading=again)
            continue
        if checksum:
            first[checksum] = name
        yield read


def checksum_of(path: Path) -> str:
    """SHA-256 of a file, or an empty string where it cannot be read."""
    try:
        return digest(path)
    except DataError:
        return ""


def _fitted(log: Log, content: ParameterFile, path: Path, zero: Zero) -> RecordingResult:
    """The load as `clutchid estimate` reads it."""
    request = FitRequest(calibration=content.calibration, zero=zero)
    fit = fitted(Reading((log,)), content.actuator, request).raised()
    curve = fit.load_curve
    judged, compared = verdict(fit), comparison(fit)
    half, trust = compared.half_now if compared else _NO_HALF_LOAD, judged.trust
    message = fit.message if trust == "good" or not judged.reasons else judged.reasons[0]
    status = "warning" if fit.warnings or trust != "good" else "ok"
    # a load that is only uncertain counts in the trend by its band
    reason = unmeasured(fit)
    measurement = None if reason else measured(fit, log)
    changes = tuple(dict.fromkeys(change.group for change in fit.changes))
    rest = next((recording.rest for recording in fit.recordings.values()), None)
    wear = WearReading(status, message, trust, measurement, leak_of(fit), departs(fit), rest, reason)
    return RecordingResult(path, wear, curve=curve, half_load=half, changes=changes)


def _observed(log: Log, content: ParameterFile, path: Path, zero: Zero) -> RecordingResult:
    """The load as `clutchid observe` has it at the end of the recording, which is no measurement of the wear."""
    from clutchid.documents.observation_rows import observe_sentence
    from clutchid.estimation.assess.observed import indicators, observed_verdict
    from clutchid.observer.run import loads

    run = observed(Reading((log,), zero=zero), content)
    after = loads(run).after
    half = half_load_band(after, float(np.nanmax(run.log["position"])))
    status = "warning" if run.log.warnings or any(run.health.values()) else "ok"
    trust, shift = observed_verdict(indicators(run)).trust, from_rest(run.log, content.rest, zero).shift
    at_end = WearReading(status, observe_sentence(run), trust, None, rest=shift, reason=_ONLY_ITS_END)
    return RecordingResult(path, at_end, curve=after, half_load=half)


@lru_cache(maxsize=64)
def _calibration(path: Path, _checksum: str) -> ParameterFile:
    """A calibration, read once a process; the workers of a scheduler outlive a change of its file."""
    return start_file(path)


def packed_result(result: RecordingResult) -> tuple[str, bytes | None]:
    """A result as text and its load as bytes, for a table; its path and checksum are not in it."""
    curve = None if result.curve is None else np.ascontiguousarray(result.curve.table().T, dtype="<f8").tobytes()
    return json.dumps([result.reading, result.clock, result.half_load, result.changes]), curve


def restored(recording: str, sha256: str, text: str, curve: bytes | None) -> RecordingResult:
    """The result whose `packed_result` form is a text and bytes."""
    reading, clock, half, changes = json.loads(text)
    types = {"measurement": Measurement, "leak": Leak, "rest": RestShift}
    parts = {
        name: types[name](*part) if part and name in types else part
        for name, part in zip(WearReading._fields, reading, strict=True)
    }
    load = None if curve is None else LoadCurve(*np.frombuffer(curve, dtype="<f8").reshape(4, -1))
    return RecordingResult(Path(recording), WearReading(**parts), clock, sha256, load, HalfLoad(*half), tuple(changes))
