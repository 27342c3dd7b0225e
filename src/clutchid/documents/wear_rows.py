"""The wear of a clutch in words and as a JSON object."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from clutchid.documents.document import LabelRow
from clutchid.documents.style import MM
from clutchid.documents.terminal import text_of
from clutchid.parameters import DEFAULTS
from clutchid.wear import FALSE_ALARMS, Alarm, Interval, Wear

#: Kinds of alarms in words.
ALARMS = {
    "replaced": "the clutch or its sensor was replaced",
    "sudden": "the load changed suddenly",
    "unknown": "the load changed because of a new clutch or a fault (the recordings so far do not show which)",
    "leak": "chamber A or its connections began to leak",
    "departed": "the actuator deviated from its calibration by more than a change of load or grease explains",
    "wrong file": "the recording is probably of another truck",
    "sensor moved": "the position sensor or its bracket moved or was replaced",
}


def rows_of(wear: Wear) -> list[LabelRow]:
    """The recordings, the change since the calibration, the alarms, and what is left."""
    rows = [("recordings", recordings_words(wear))]
    if not any(wear.counted):
        rows.append(("wear", "no recording determines it"))
    else:
        rows.append(("now", change_words(wear)))
        rows += [("alarm", alarm_words(alarm)) for alarm in wear.alarms]
        rows += [("leak", f"{leak_words(leak)}, as seals age")] if (leak := wear.aged) else []
        rows.append(("left", left_words(wear) or "unknown without a limit; give --limit or a table of wear"))
    return [LabelRow(label, text, "with care" if label == "alarm" else "", fixed=True) for label, text in rows]


def wear_lines(wear: Wear) -> list[str]:
    """The rows as lines."""
    return text_of(rows_of(wear)).splitlines()


def recordings_words(wear: Wear) -> str:
    """Number of recordings, their span, and their outcomes; and how many files of the vehicle are none."""
    outliers = wear.outcomes.count("left out")
    words = [f"{sum(wear.counted)} of {wear.recordings} count"]
    if outliers:
        words.append(f"{outliers} outlier{'s' if outliers > 1 else ''} left out")
    recordings = [row.reading for row in wear.rows if not row.reading.apart]
    failed = Counter(reading.status for reading in recordings if reading.measurement is None)
    words += [f"{number} without a measurement ({status.replace('_', ' ')})" for status, number in failed.items()]
    if wear.axis != "recordings":
        words.append(f"over {wear.s[-1] - wear.s[0]:,.0f} {wear.axis}")
    others = len(wear.rows) - len(recordings)
    beside = f"; {others} other file{'s' if others > 1 else ''}, not a recording or a copy of one" if others else ""
    return f"{', '.join(words)}{beside}"


def change_words(wear: Wear) -> str:
    """The change since the calibration at the last recording."""
    present = wear.present
    shift, load = present["shift"], present["load"]
    words = (
        f"half-load position {shift[0] / MM:+.3f} mm ({shift[1] / MM:+.3f} to {shift[2] / MM:+.3f}), "
        f"load over 5 to 8 mm {100 * load[0]:+z.1f} % ({100 * load[1]:+z.1f} to {100 * load[2]:+z.1f})"
    )
    return f"{_worn(wear, present['wear'])}; {words}" if "wear" in present else words


def _worn(wear: Wear, worn: Interval) -> str:
    """Wear of the facing with its band, as far as its table goes."""
    interval = f"({worn[1] / MM:.2f} to {worn[2] / MM:.2f})"
    end = wear.end_of_table
    if np.isnan(worn.value):
        return "wear of the facing unknown, because its band covers the whole table"
    if end is not None and worn[0] >= end:
        return f"facing worn beyond the end of its table, {end / MM:.2f} mm {interval}"
    return f"facing worn by {worn[0] / MM:.2f} mm {interval}"


def alarm_words(alarm: Alarm) -> str:
    """An alarm in words."""
    when = f" on {alarm.begin:%Y-%m-%d}" if alarm.begin else ""
    where = f"between {alarm.after} and {alarm.before}" if alarm.after else f"before {alarm.before}"
    words = f"{ALARMS[alarm.kind]} {where}{when}"
    if alarm.kind == "leak":
        _, low, high = alarm.leak_interval
        return f"{words}: {leak_words(alarm.leak)}; the truck's is {low:.1e} to {high:.1e}"
    if alarm.kind == "unknown" and np.isnan(alarm.shift):
        return f"the load may have changed {where}{when}; the next recordings will show it"
    if alarm.kind == "wrong file":
        apart = "" if np.isnan(alarm.shift) else f" by {alarm.shift / MM:+.3f} mm and {100 * alarm.load:+z.1f} %"
        return f"{ALARMS[alarm.kind]}, {alarm.before}{when}: it differs{apart} from those before and after, which agree"
    if alarm.kind == "departed":
        return f"{words}: look for a fault, or calibrate again"
    if alarm.kind == "sensor moved":
        return f"{words}: the vented rest moved by {alarm.rest / MM:+.2f} mm; this is not counted as wear"
    return f"{words}: half-load position {alarm.shift / MM:+.3f} mm, load {100 * alarm.load:+z.1f} %"


def leak_words(conductance: float) -> str:
    """A leak, and the air that it loses at 5 bar(g)."""
    from clutchid.model.valves import leak_flow  # brings SymPy, which is not needed without a leak

    lost = 1e3 * float(leak_flow(6e5, 1e5, conductance, DEFAULTS.rho_0))
    return f"{conductance:.1e} m³/(Pa·s), {lost:.2g} g/s at 5 bar(g)"


def left_words(wear: Wear) -> str:
    """Remaining life until the limit; nothing without one."""
    if wear.limit is not None and wear.sudden:
        how = "suddenly " if wear.sudden.kind == "sudden" else ""
        return f"unknown, because the load changed {how}before {wear.sudden.before}; find the cause"
    if wear.left is None or wear.limit is None:
        return ""
    what = "of wear" if "wear" in wear.then else "of shift"
    low, median, high = wear.left
    if not np.isfinite(low):
        return f"the trend does not reach {wear.limit / MM:.2f} mm {what}"
    end = f"to {wear.limit / MM:.2f} mm {what}"
    if not np.isfinite(median):
        return f"no end in sight {end} ({_rounded(low)} {wear.axis} to no end in sight, 90 %)"
    return f"{_rounded(median)} {wear.axis} {end} ({_rounded(low)} to {_rounded(high)}, 90 %)"


def _rounded(value: float) -> str:
    """Two significant digits; open where the horizon ends."""
    return f"{float(f'{value:.2g}'):,.0f}" if np.isfinite(value) else "no end in sight"


def wear_json(wear: Wear, left_out: str = "") -> dict[str, Any]:
    """The keys of every result, and `wear`: the trend at the end, alarms, how often they are false, what is left.

    `left_out` says what was not read as a recording, which troubles no result.
    """
    counted = any(wear.counted)
    rows = wear.rows
    troubled = wear.warnings or wear.alarms or any(row.reading.status != "ok" for row in rows)
    return {
        "status": "failed" if not counted else "warning" if troubled else "ok",
        "message": change_words(wear) if counted else recordings_words(wear),
        "logs": {
            job.recording: {
                "status": reading.status,
                "message": reading.message,
                "trust": reading.trust,
                "outcome": outcome,
                "reason": reason,
            }
            for job, reading, outcome, reason in rows
        },
        "warnings": [sentence for sentence in (left_out, *wear.warnings) if sentence],
        "wear": {
            "vehicle": wear.vehicle,
            "axis": wear.axis,
            "quantities": {name: last._asdict() for name, last in wear.present.items()} if counted else {},
            "alarms": [
                {**alarm._asdict(), "begin": alarm.begin.isoformat() if alarm.begin else None} for alarm in wear.alarms
            ],
            "false_alarms": FALSE_ALARMS,
            "limit_m": wear.limit,
            "left": wear.left._asdict() if wear.left else None,
            "text": wear_lines(wear),
        },
    }
