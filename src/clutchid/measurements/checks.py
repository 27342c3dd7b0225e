"""Convert the values of a file to a recording in SI, and report all problems together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError, ParameterError
from clutchid.log import COLUMNS, INPUTS, FloatArray, Log
from clutchid.log.units import UNITS, to_si
from clutchid.measurements.clock import hole_starts, usual_interval
from clutchid.measurements.columns import Heading
from clutchid.measurements.source import Places, Table
from clutchid.messages import SHOWN, listed, quantity

#: Ambient pressure in Pa that is added to gauge pressures where none is known: the standard atmosphere, ISO 2533.
AMBIENT = 1.013e5

#: Up to this share of a column, samples that are none of their quantity are dropouts or codes for none, which
#: `clutchid.strokes.values` leaves out; more are a wrong unit, sign or channel: percent, a gauge pressure.
_FEW = 0.01

#: A duty cycle may be as far outside 0 to 1: real numbers are rounded, on a bus to 0.01 % and more.
DUTY_ROUNDING = 1e-3

_ABSOLUTE = ("pressure_a", "pressure_b")


@dataclass(frozen=True, eq=False, slots=True)
class _Column:
    """One column: as written, in SI (as written if the unit is unknown), and location of its samples."""

    heading: Heading
    written: FloatArray
    values: FloatArray
    places: Places

    def shown(self, row: int) -> str:
        """The sample as written, with its unit."""
        return quantity(self.written[row], self.heading.unit)


def check(table: Table, ambient: float, *, holes_end: bool) -> tuple[dict[str, FloatArray], list[str], list[str]]:
    """The columns of `table` in SI by name, including `time`, and all problems and warnings of their samples.

    Parameters
    ----------
    table
        Columns called by quantities, each once.
    ambient : Pa
        Absolute pressure, above 0, that is added to gauge pressures.
    holes_end
        Whether a hole in time ends a segment, and is said.
    """
    columns: dict[str, _Column] = {}
    for heading in table.headings:
        written = table.numbers[heading.index]
        columns[str(heading.name)] = _Column(heading, written, in_si(heading, written, ambient), table.places)
    problems = [*table.problems, *(text for name, column in columns.items() for text in _problems(name, column))]
    warnings = _gaps([columns[name] for name in INPUTS if name in columns])
    warnings += _hole_warning(columns["time"]) if holes_end and "time" in columns and columns["time"].heading.si else []
    return {name: column.values for name, column in columns.items()}, problems, warnings


def check_duties(log: Log) -> None:
    """Check the duty cycles of a log, which may have been made in Python, as those of a file.

    Raises
    ------
    DataError
        With the sentences of a file.

    Examples
    --------
    >>> try:
    ...     check_duties(Log([0.0, 0.1], {"duty_supply": [0.0, 100.0]}))
    ... except DataError as error:
    ...     print(error)
    log: column 'duty_supply' is not a duty cycle: sample 1 has 100; looks like percent: write duty_supply [%].
    The columns of a clutchid.Log are in SI; clutchid.Log.from_frame(frame) converts units in headings.
    """
    places = Places("sample", 0)
    problems = [
        problem
        for name in INPUTS
        if name in log
        for problem in _duty(_Column(Heading(0, name, name, COLUMNS[name]), log[name], log[name], places))
    ]
    if problems:
        way = "The columns of a clutchid.Log are in SI; clutchid.Log.from_frame(frame) converts units in headings."
        raise DataError(f"{DataError.of(log.name, problems)}\n{way}")


def check_ambient(ambient: float | None) -> None:
    """Check that `ambient` in Pa is an absolute pressure, if it is known.

    Raises
    ------
    ParameterError
        If it is not above 0.
    """
    if ambient is not None and not (math.isfinite(ambient) and ambient > 0):
        raise ParameterError(
            f"ambient = {ambient:g} Pa: an absolute pressure must be above 0, at sea level {AMBIENT:g}."
        )


def outside_duty(values: FloatArray) -> NDArray[np.bool_]:
    """Whether each value is no duty cycle, as it is outside 0 to 1 by more than rounding."""
    return (values < -DUTY_ROUNDING) | (values > 1 + DUTY_ROUNDING)


def in_si(heading: Heading, written: FloatArray, ambient: float) -> FloatArray:
    """The values of a column in SI; as written if the unit is unknown."""
    if heading.si is None or heading.unit is None:
        return written
    with np.errstate(over="ignore", invalid="ignore"):
        return to_si(written, heading.unit, heading.si, ambient)


def _problems(name: str, column: _Column) -> Iterable[str]:
    """All problems of the values of one column."""
    infinite = np.flatnonzero(np.isinf(column.values))
    if infinite.size:
        yield (
            f"column '{column.heading.text}' is infinite in {column.places.ranges(infinite)}; "
            "write a finite number, or leave the cell empty where the sample is missing."
        )
    if name in INPUTS and column.heading.si is not None:
        yield from _duty(column)
    elif name in _ABSOLUTE and column.heading.si is not None:
        yield from _pressure(column)


def _duty(column: _Column) -> Iterable[str]:
    values = column.values
    outside = np.flatnonzero(np.isfinite(values) & outside_duty(values))
    if outside.size <= _FEW * np.isfinite(values).sum():
        return
    finite = values[np.isfinite(values)]
    per_cent = column.heading.unit == "1" and finite.size and finite.min() >= 0 and 2 < finite.max() <= 100
    if per_cent:
        advice = f"looks like percent: write {column.heading.name} [%]."
    else:
        advice = (
            f"allowed is {'0 to 100 %' if column.heading.unit == '%' else '0 to 1'}: correct the values or the unit."
        )
    where = column.places.each(outside, lambda row: f"has {column.shown(row)}")
    yield f"column '{column.heading.text}' is not a duty cycle: {where}; {advice}"


def _pressure(column: _Column) -> Iterable[str]:
    low = np.flatnonzero(np.isfinite(column.values) & (column.values <= 0))
    if low.size <= _FEW * np.isfinite(column.values).sum():
        return
    unit = column.heading.unit or ""
    gauge = UNITS[unit].gauge
    advice = (
        "check the unit and --ambient."
        if gauge
        else f"if it is gauge pressure, write {column.heading.name} [{unit}(g)]."
    )
    where = column.places.each(low, lambda row: f"has {column.shown(row)}")
    yield f"column '{column.heading.text}' is not above 0 as an absolute pressure: {where}; {advice}"


def _gaps(columns: Sequence[_Column]) -> list[str]:
    """Warning about samples in which one of these inputs is missing."""
    gaps = {column.heading.text: rows for column in columns if (rows := np.isnan(column.values)).any()}
    if not gaps:
        return []
    names = " or ".join(f"'{text}'" for text in gaps)
    where = columns[0].places.ranges(np.flatnonzero(np.any([*gaps.values()], axis=0)))
    return [f"input {names} is missing in {where}: the recording is used before and after each gap."]


def _hole_warning(column: _Column) -> list[str]:
    """Warning about holes in a time that is repaired."""
    time, places = column.values, column.places
    after = hole_starts(time)
    if not after.size:
        return []
    shown = [
        f"{quantity(time[i + 1] - time[i], 's')} between {places.word}s {places.number(i)} and {places.number(i + 1)}"
        for i in after[:SHOWN].tolist()
    ]
    usual = quantity(usual_interval(time), "s")
    return [f"no samples for {listed(shown, total=after.size)} (usual interval {usual}): each gap ends a segment."]
