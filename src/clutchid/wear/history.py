"""Recordings of a vehicle in the order of its life, each with its reading or the reason why it has none."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from clutchid.estimation.assess.comparison import By, Comparison, HalfLoad, Measurement, change_of
from clutchid.estimation.assess.verdict import Verdict
from clutchid.estimation.result import Fit
from clutchid.inference.uncertainty.estimates import LoadCurve
from clutchid.log import FloatArray
from clutchid.messages import listed
from clutchid.names import natural
from clutchid.strokes.vented_rest import RestShift

if TYPE_CHECKING:
    from clutchid.observer.run import ObservedRecording

Axis = Literal["strokes", "km", "days", "recordings"]

#: A clock before this day has restarted, and is not used.
_CLOCKS = datetime(2000, 1, 1, tzinfo=UTC)

#: Difference between the clock of a file and the table that is not warned of: time zones, and the end of a drive.
_TOLERANCE = timedelta(days=1)

#: Length of a date without a time of day.
_DAY = timedelta(days=1)

#: Warning of a recording whose place in the order is not known.
_NO_TIME = "no time in the file, the table or the name; placed after the others."

#: A date in the name of a file, with or without the time of day.
_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?([0-2]\d|3[01])(?:[T_-]?([01]\d|2[0-3])[-_.:]?([0-5]\d))?(?!\d)"
)


@dataclass(frozen=True, slots=True)
class RecordingJob:
    """A recording of a vehicle that is to be read; unknown entries are empty, None or NaN.

    Attributes
    ----------
    recording, vehicle, type
        Names of the recording, of its vehicle and of the type of that.
    begin
        Its time, by the table of recordings or, in a history, by what is known best.
    odometer : km
        Distance of the vehicle.
    strokes
        Number of strokes of the clutch.
    path, start
        Its file, and the calibration to start from.
    problem
        Why it cannot be read.
    inputs, file
        What its result depends on: version and calibration, and size and time of its file.
    warnings
        What is missing or contradicts in its time, one sentence each.
    tags
        Further columns of a table of recordings and their values, such as its depot.
    """

    recording: str
    vehicle: str = ""
    type: str = ""
    begin: datetime | None = None
    odometer: float = float("nan")
    strokes: float = float("nan")
    path: Path | None = None
    start: Path | None = None
    problem: str = ""
    inputs: str = ""
    file: str = ""
    warnings: tuple[str, ...] = ()
    tags: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """Recordings in order: `order` are their indices, `s` where they are on the axis, `warnings` what contradicts.

    `apart` are the indices of the files without a place in it.
    """

    order: tuple[int, ...]
    apart: tuple[int, ...]
    dated: tuple[RecordingJob, ...]
    axis: Axis
    s: FloatArray
    warnings: tuple[str, ...] = ()


def arranged(jobs: Sequence[RecordingJob], readings: Sequence[WearReading]) -> History:
    """The order of recordings by their own clock, else the table, else a date in their name, else their name.

    Where all have strokes, these are the axis of the trend, else km, else days, else their number. A file without a
    reading has no place: what it lacks, or has in its name by chance, says nothing about the life of the clutch.

    Parameters
    ----------
    jobs, readings
        Each recording as a table has it, and what its reading gave, which has the start time in its file (ISO 8601).
    """
    rows = [dated(job, reading.clock) for job, reading in zip(jobs, readings, strict=True)]
    everything = sorted(range(len(rows)), key=lambda i: _place(rows[i]))
    order, apart = (tuple(i for i in everything if readings[i].has_place is has) for has in (True, False))
    for i in apart:
        rows[i] = replace(rows[i], warnings=())
    warnings = [f"{rows[i].recording}: {sentence}" for i in sorted(order) for sentence in rows[i].warnings]
    missing = [i for i in sorted(order) if rows[i].begin is None]
    if 0 < len(missing) < len(order):
        warnings.append(f"{listed([rows[i].recording for i in missing], 3)}: {_NO_TIME}")
        for i in missing:
            rows[i] = replace(rows[i], warnings=(*rows[i].warnings, _NO_TIME))
    if len(missing) == len(order) > 1:
        warnings.append("no recording has a time; they are taken in the order of their names.")
    axis, s = _axis([rows[i] for i in order], warnings)
    return History(order, apart, tuple(rows), axis, s, tuple(warnings))


def dated(job: RecordingJob, clock: str) -> RecordingJob:
    """A recording with its time by the clock of its file, else the table, else its name, and what contradicts in it."""
    warnings: list[str] = []
    of_file, of_table, of_name = _instant(clock), job.begin, _date_in(job.recording)
    if of_file is not None and of_file < _CLOCKS:
        warnings.append(f"its clock shows {of_file:%Y-%m-%d}: it was reset, so its date is not used.")
        of_file = None
    if of_file and of_table and abs(of_file - of_table) > _TOLERANCE:
        warnings.append(
            f"the file is dated {of_file:%Y-%m-%d %H:%M} and the table says {of_table:%Y-%m-%d %H:%M}; the date of "
            "the file is used."
        )
    begin = of_file or of_table
    if begin and of_name and not of_name - _TOLERANCE <= begin <= of_name + _DAY + _TOLERANCE:
        where = "file" if of_file else "table"
        warnings.append(
            f"its name says {of_name:%Y-%m-%d} and the {where} says {begin:%Y-%m-%d}; the date of the {where} is used."
        )
    return replace(job, begin=begin or of_name, warnings=tuple(warnings))


def _instant(text: str) -> datetime | None:
    """An ISO time; UTC where it has no zone."""
    try:
        instant = datetime.fromisoformat(text)
    except ValueError:
        return None
    return instant if instant.tzinfo else instant.replace(tzinfo=UTC)


def _date_in(name: str) -> datetime | None:
    match = _DATE.search(name)
    if match is None:
        return None
    try:
        return datetime(*(int(digits or 0) for digits in match.groups()), tzinfo=UTC)  # type: ignore[misc, arg-type]
    except ValueError:  # the 31st of a short month
        return None


def _place(job: RecordingJob) -> tuple[bool, float, list[tuple[bool, int, str]]]:
    """Sort key: time, then name; recordings without a time last."""
    return job.begin is None, job.begin.timestamp() if job.begin else 0.0, natural(job.recording)


def _axis(dated: Sequence[RecordingJob], warnings: list[str]) -> tuple[Axis, FloatArray]:
    """Axis that all recordings have and that does not go back: strokes, km or days; else their number."""
    columns: list[tuple[Axis, str, Callable[[RecordingJob], float]]] = [
        ("strokes", "strokes", lambda job: job.strokes),
        ("km", "odometer_km", lambda job: job.odometer),
        ("days", "time", lambda job: job.begin.timestamp() / 86400.0 if job.begin else np.nan),
    ]
    for axis, name, of in columns:
        values = np.array([of(recording) for recording in dated])
        if not np.isfinite(values).all():
            continue
        back = np.flatnonzero(np.diff(values) < 0.0).tolist()
        if back:
            where = [dated[i + 1].recording for i in back]
            warnings.append(f"{name} decreases at {listed(where, 3)} and is not used for the trend.")
            continue
        if values.size == 1 or (values.size and values[-1] > values[0]):
            return axis, values - (values[0] if axis == "days" else 0.0)
    return "recordings", np.arange(len(dated), dtype=np.float64)


class Leak(NamedTuple):
    """A leak of chamber A since its calibration.

    Attributes
    ----------
    conductance, std : m³/(Pa·s)
        Estimate and standard deviation.
    probability : 1
        That it has changed.
    """

    conductance: float
    std: float
    probability: float


#: No half-load position.
NO_HALF_LOAD = HalfLoad(np.nan, np.nan, np.nan)


class WearReading(NamedTuple):
    """Result of reading one recording.

    Attributes
    ----------
    status, message
        As in every result.
    trust
        Of its load: 'good', 'with care' or 'none'.
    measurement
        Change of the load since the calibration; None where there is none.
    leak
        That of chamber A, if one is probable.
    departs
        Whether the truck is farther from its calibration than a change explains.
    rest : m
        How far the vented rest has moved since, if that is known.
    reason
        Why a recording that was read gives no measurement; empty where it gives one.
    clock
        Start time in the file; empty if unknown.
    sha256
        Checksum of the file.
    half_load : m
        Position where the load reaches half its peak.
    changes
        Since the calibration, one sentence each.
    curve : N over m
        The load; None without one.
    apart
        Whether the file is in no count of its vehicle: it is no recording of an actuator, or a copy of another one.
    by
        What read the load; None where nothing did.
    """

    status: str
    message: str
    trust: str = "none"
    measurement: Measurement | None = None
    leak: Leak | None = None
    departs: bool = False
    rest: RestShift | None = None
    reason: str = ""
    clock: str = ""
    sha256: str = ""
    half_load: HalfLoad = NO_HALF_LOAD
    changes: tuple[str, ...] = ()
    curve: LoadCurve | None = None
    apart: bool = False
    by: By | None = None

    @property
    def has_place(self) -> bool:
        """Whether it has a place in the life of its vehicle."""
        return self.has_result and not self.apart

    @property
    def has_result(self) -> bool:
        """Whether the recording was read."""
        return self.status in ("ok", "warning")

    @property
    def unmeasured(self) -> str:
        """Reason why it gives no measurement, in a sentence; empty where it gives one."""
        return "" if self.measurement is not None else self.reason or self.message


#: Fields of a reading that are records of their own.
_PARTS = {"measurement": Measurement, "leak": Leak, "rest": RestShift, "half_load": HalfLoad}


def packed_reading(reading: WearReading) -> tuple[str, bytes | None]:
    """A reading as text, and its load as bytes, for a table."""
    load = reading.curve
    curve = None if load is None else np.ascontiguousarray(load.table().T, dtype="<f8").tobytes()
    return json.dumps(reading._replace(curve=None)), curve


def restored(text: str, curve: bytes | None) -> WearReading:
    """The reading whose `packed_reading` form is a text and bytes."""
    reading = WearReading(*json.loads(text))
    parts = {name: kind(*getattr(reading, name)) for name, kind in _PARTS.items() if getattr(reading, name)}
    load = None if curve is None else LoadCurve(*np.frombuffer(curve, dtype="<f8").reshape(4, -1))
    return reading._replace(**parts, changes=tuple(reading.changes), curve=load)


def leak_of(fit: Fit) -> Leak | None:
    """The leak that a reading finds; None if it finds none, or its model has no leak."""
    leak = next((change for change in fit.changes if change.name == "C_A0"), None)
    return Leak(leak.after - leak.before, leak.std, leak.probability) if leak else None


def observed_leak(run: ObservedRecording) -> Leak | None:
    """The leak at the end of a recording that was observed; None if the observer flags none."""
    from scipy.special import ndtr

    from clutchid.observer.by_stroke import estimates_of
    from clutchid.observer.configuration import LEAK_FOUND
    from clutchid.observer.prior import LEAK

    if not run.observer.leaks(run.after):
        return None
    estimate = estimates_of(run.observer, run.after)[LEAK]
    conductance = estimate.value - run.observer.actuator.parameters.C_A0
    return Leak(conductance, estimate.std, float(ndtr(LEAK_FOUND)))


def not_converged(fit: Fit) -> str:
    """Why a fit that failed or did not converge gives no measurement, in a sentence; empty if it converged."""
    converged = fit.status != "failed" and fit.converged
    return "" if converged else f"its search did not converge: {fit.message}".rstrip(".") + "."


def unmeasured(judged: Verdict, compared: Comparison | None) -> str:
    """Why a load read from a calibration gives no measurement, in a sentence; empty if it gives one.

    A load that is only uncertain gives one with its band.
    """
    if judged.flawed:
        return " ".join(judged.reasons)
    if compared is None:
        return (
            "the file of the calibration has no load, so there is nothing to compare with; save the calibration again."
        )
    if change_of(compared) is None:
        furthest = 1e3 * compared.reach
        return (
            f"the position of half load, or its interval, is not determined within the {furthest:.1f} mm that were "
            "reached; record longer strokes."
        )
    return ""
