"""The wear of a clutch as a JSON object."""

from __future__ import annotations

from typing import Any

from clutchid.reports.wear_text import change_words, recordings_words, wear_lines
from clutchid.wear.life import Wear
from clutchid.wear.settings import FALSE_ALARMS


def wear_json(wear: Wear) -> dict[str, Any]:
    """The keys of every result, and `wear`: the trend at the end, alarms, how often they are false, what is left."""
    counted = any(wear.counted)
    troubled = wear.warnings or wear.alarms or any(one.status != "ok" for one in wear.readings)
    at_end = {
        name: {key: float(values[-1]) for key, values in band._asdict().items()} for name, band in wear.then.items()
    }
    return {
        "status": "failed" if not counted else "warning" if troubled else "ok",
        "message": change_words(wear) if counted else recordings_words(wear),
        "parameters": {},
        "load_curve": None,
        "errors": None,
        "logs": {
            dated.name: {
                "status": one.status,
                "message": one.message,
                "trust": one.trust,
                "outcome": outcome,
                "reason": reason,
            }
            for dated, one, outcome, reason in zip(wear.dated, wear.readings, wear.outcomes, wear.reasons, strict=True)
        },
        "warnings": list(wear.warnings),
        "wear": {
            "vehicle": wear.vehicle,
            "axis": wear.axis,
            "quantities": at_end if counted else {},
            "alarms": [
                {**alarm._asdict(), "begin": alarm.begin.isoformat() if alarm.begin else None} for alarm in wear.alarms
            ],
            "false_alarms": FALSE_ALARMS,
            "limit_m": wear.limit,
            "left": wear.left._asdict() if wear.left else None,
            "text": wear_lines(wear),
        },
    }
