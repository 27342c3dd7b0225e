"""Recordings of a vehicle in the order of its life, each with its reading or the reason why it has none."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Literal, NamedTuple

import numpy as np

from clutchid.estimation.assess.comparison import Measurement, change_of, comparison
from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.result import Fit
from clutchid.log import FloatArray
from clutchid.names import natural
from clutchid.strokes.vented_rest import RestShift

Axis = Literal["strokes", "km", "days", "recordings"]

#: A clock before this day has restarted, and is not used.
_CLOCKS = datetime(2000, 1, 1, tzinfo=UTC)

#: Difference between the clock of a file and the table that is not warned of: time zones, and the end of a drive.
_TOLERANCE = timedelta(days=1)

#: Length of a date without a time of day.
_DAY = timedelta(days=1)

#: Warning of a recording whose place in the order is not known.
_NO_TIME = "no time in the file, the table or the name; put after the others."

#: A date in the name of a file, with or without the time of day.
_DATE = re.compile(
    r"(?<!\d)(20\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?([0-2]\d|3[01])(?:[T_-]?([01]\d|2[0-3])[-_.:]?([0-5]\d))?(?!\d)"
)


@dataclass(frozen=True, slots=True)
class Listed:
    """A row of the table of recordings; missing entries are empty, None or NaN."""

    recording: str
    vehicle: str = ""
    type: str = ""
    begin: datetime | None = None
    odometer: float = float("nan")
    strokes: float = float("nan")


class Dated(NamedTuple):
    """A recording with its place in a life; unknown entries are None or NaN.

    Attributes
    ----------
    name
        Of the recording.
    begin
        Its time.
    odometer : km
        Distance.
    strokes
        Number of strokes of the clutch.
    source
        Which of file, table and name the time is from.
    warnings
        What is missing or contradicts in its time, one sentence each.
    """

    name: str
    begin: datetime | None
    odometer: float
    strokes: float
    source: str
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """Recordings in order: `order` are their indices, `s` where they are on the axis, `warnings` what contradicts."""

    order: tuple[int, ...]
    dated: tuple[Dated, ...]
    axis: Axis
    s: FloatArray
    warnings: tuple[str, ...] = field(default=())


def arranged(names: Sequence[str], clocks: Sequence[str], table: Mapping[str, Listed]) -> History:
    """The order of recordings by their own clock, else the table, else a date in their name, else their name.

    Where all have strokes, these are the axis of the trend, else km, else days, else their number.

    Parameters
    ----------
    names, clocks
        Stem of each recording, and the start time in its file (ISO 8601), or an empty string.
    table
        Rows of the table of recordings by the stem.
    """
    dated = [_dated(name, clock, table.get(name)) for name, clock in zip(names, clocks, strict=True)]
    warnings = [f"{recording.name}: {sentence}" for recording in dated for sentence in recording.warnings]
    missing = [recording.name for recording in dated if recording.begin is None]
    if 0 < len(missing) < len(dated):
        warnings.append(f"{_some(missing)}: {_NO_TIME}")
        dated = [row if row.begin else row._replace(warnings=(*row.warnings, _NO_TIME)) for row in dated]
    if len(missing) == len(dated) > 1:
        warnings.append("no recording has a time; they are taken in the order of their names.")
    order = sorted(range(len(dated)), key=lambda i: _place(dated[i]))
    axis, s = _axis([dated[i] for i in order], warnings)
    return History(tuple(order), tuple(dated), axis, s, tuple(warnings))


def _dated(name: str, clock: str, row: Listed | None) -> Dated:
    warnings: list[str] = []
    of_file, of_table, of_name = _instant(clock), row.begin if row else None, _date_in(name)
    if of_file is not None and of_file < _CLOCKS:
        warnings.append(f"its clock says {of_file:%Y-%m-%d}, so it had restarted, and is not used.")
        of_file = None
    if of_file and of_table and abs(of_file - of_table) > _TOLERANCE:
        warnings.append(
            f"the file is of {of_file:%Y-%m-%d %H:%M}, the table says {of_table:%Y-%m-%d %H:%M}; the file counts."
        )
    begin = of_file or of_table
    if begin and of_name and not of_name - _TOLERANCE <= begin <= of_name + _DAY + _TOLERANCE:
        where = "file" if of_file else "table"
        warnings.append(f"its name is of {of_name:%Y-%m-%d}, the {where} of {begin:%Y-%m-%d}; the {where} counts.")
    begin = begin or of_name
    source = "file" if of_file else "table" if of_table else "name" if of_name else ""
    odometer, strokes = (row.odometer, row.strokes) if row else (np.nan, np.nan)
    return Dated(name, begin, odometer, strokes, source, tuple(warnings))


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


def _place(recording: Dated) -> tuple[bool, float, list[tuple[bool, int, str]]]:
    """Sort key: time, then name; recordings without a time last."""
    return recording.begin is None, recording.begin.timestamp() if recording.begin else 0.0, natural(recording.name)


def _axis(dated: Sequence[Dated], warnings: list[str]) -> tuple[Axis, FloatArray]:
    """Axis that all recordings have and that does not go back: strokes, km or days; else their number."""
    columns: list[tuple[Axis, str, Callable[[Dated], float]]] = [
        ("strokes", "strokes", lambda recording: recording.strokes),
        ("km", "odometer_km", lambda recording: recording.odometer),
        ("days", "time", lambda recording: recording.begin.timestamp() / 86400.0 if recording.begin else np.nan),
    ]
    for axis, name, of in columns:
        values = np.array([of(recording) for recording in dated])
        if not np.isfinite(values).all():
            continue
        back = np.flatnonzero(np.diff(values) < 0.0).tolist()
        if back:
            where = [dated[i + 1].name for i in back]
            warnings.append(f"{name} goes back at {_some(where)}, and is not used for the trend.")
            continue
        if values.size == 1 or values[-1] > values[0]:
            return axis, values - (values[0] if axis == "days" else 0.0)
    return "recordings", np.arange(len(dated), dtype=np.float64)


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more


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


class WearReading(NamedTuple):
    """Result of one recording.

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
    """

    status: str
    message: str
    trust: str
    measurement: Measurement | None
    leak: Leak | None = None
    departs: bool = False
    rest: RestShift | None = None
    reason: str = ""

    @property
    def has_result(self) -> bool:
        """Whether the recording was read."""
        return self.status in ("ok", "warning")

    @property
    def unmeasured(self) -> str:
        """Reason why it gives no measurement, in a sentence; empty where it gives one."""
        return "" if self.measurement is not None else self.reason or self.message


def leak_of(fit: Fit) -> Leak | None:
    """The leak that a reading finds; None if it finds none, or its model has no leak."""
    leak = next((change for change in fit.changes if change.name == "C_A0"), None)
    return Leak(leak.after - leak.before, leak.std, leak.probability) if leak else None


def unmeasured(fit: Fit) -> str:
    """Reason why a recording fitted from a calibration gives no measurement, in a sentence; empty if it gives one.

    A load that is only uncertain gives one with its band.
    """
    if fit.status == "failed" or not fit.converged:
        return f"its search did not converge: {fit.message}".rstrip(".") + "."
    judged, compared = verdict(fit), comparison(fit)
    if judged.flawed:
        return " ".join(judged.reasons)
    if compared is None:
        return "the calibration has no load in its file, so that there is nothing to compare with; save it again."
    if change_of(compared) is None:
        furthest = 1e3 * compared.reach
        return (
            f"the position of half load, or its interval, is not determined within the {furthest:.1f} mm that were "
            "reached; record longer strokes."
        )
    return ""
