"""Columns of a reading in tables: names end with their unit, and what is unknown is None."""

from __future__ import annotations

from collections.abc import Sequence

from clutchid.wear.history import WearReading

#: Version of the columns of all tables; columns may be added under the same number.
METADATA = {"schema_version": "1"}

#: A number with its interval, by the ends of their names.
SIDES = ("", "_low", "_high")

#: Columns of the points of a load.
LOAD_COLUMNS = ("position_m", "force_N", "low_N", "high_N")

#: Columns of text, and of numbers.
TEXT_COLUMNS = ("status", "message", "trust", "by", "changes", "sha256")
NUMBER_COLUMNS = (
    *(f"half_load{side}_mm" for side in SIDES), "shift_mm", "shift_std_mm", "load_change_percent",
    "load_change_std_percent", "temperature_K", *(f"rest_shift{side}_mm" for side in SIDES), "leak_m3_per_Pa_s",
    "leak_std_m3_per_Pa_s", "leak_probability",
)  # fmt: skip


def banded(name: str, sides: Sequence[float], unit: str = "", factor: float = 1.0) -> dict[str, float]:
    """A number with its interval."""
    return {f"{name}{end}{unit}": factor * value for end, value in zip(SIDES, sides, strict=True)}


def reading_columns(reading: WearReading) -> dict[str, str | float | None]:
    """A reading by `TEXT_COLUMNS` and `NUMBER_COLUMNS`; what it does not have is left out."""
    measured, leak, rest = reading.measurement, reading.leak, reading.rest
    columns: dict[str, str | float | None] = {
        "status": reading.status, "message": reading.message, "trust": reading.trust, "by": reading.by,
        "changes": ", ".join(reading.changes), "sha256": reading.sha256 or None,
        **banded("half_load", reading.half_load, "_mm", 1e3),
    }  # fmt: skip
    if measured:
        columns |= {
            "shift_mm": 1e3 * measured.shift, "shift_std_mm": 1e3 * measured.shift_std,
            "load_change_percent": 100.0 * measured.load, "load_change_std_percent": 100.0 * measured.load_std,
            "temperature_K": measured.temperature,
        }  # fmt: skip
    if rest:
        columns |= banded("rest_shift", (rest.value, rest.low, rest.high), "_mm", 1e3)
    if leak:
        columns |= {
            "leak_m3_per_Pa_s": leak.conductance, "leak_std_m3_per_Pa_s": leak.std,
            "leak_probability": leak.probability,
        }  # fmt: skip
    return columns
