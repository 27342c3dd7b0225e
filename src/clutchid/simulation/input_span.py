"""The part of a recording that can be simulated: from the first to the last sample with both duty cycles.

In a file with several time grids each starts and ends at stamps of its own, so that the first and last samples of the
position often have no duty cycle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchid.errors import DataError
from clutchid.log import INPUTS, FloatArray, Log

#: An end without inputs that is shorter than this, in s, is no loss: time grids start and end at different stamps.
LONG = 0.5


def input_span(log: Log) -> slice:
    """Samples of `log` from the first to the last one with both duty cycles; holes between them are inside.

    Raises
    ------
    DataError
        If the recording lacks a duty cycle, or no sample has both.

    Examples
    --------
    >>> nan = np.nan
    >>> duty = {"duty_supply": np.array([nan, 0.0, nan, 1.0, 1.0]), "duty_exhaust": np.array([0.0, 0.0, 0.0, 0.0, nan])}
    >>> input_span(Log(np.arange(5.0), duty))
    slice(1, 4, None)
    """
    missing = [name for name in INPUTS if name not in log]
    if missing:
        raise DataError(f"{log.name}: no column '{missing[0]}'; a simulation needs both duty cycles.")
    known = np.flatnonzero(np.isfinite(log[INPUTS[0]]) & np.isfinite(log[INPUTS[1]]))
    if not known.size:
        raise DataError(
            f"{log.name}: no sample has both duty cycles, so that nothing can be simulated; record "
            f"{' and '.join(INPUTS)} over the same time as the position."
        )
    return slice(int(known[0]), int(known[-1]) + 1)


def with_inputs(log: Log) -> Log:
    """`log` without the samples before the first and after the last one with both duty cycles, as a view.

    It has a warning where `LONG` s or more are cut off.

    Raises
    ------
    DataError
        As `input_span`.
    """
    span = input_span(log)
    if span.stop - span.start == len(log):
        return log
    return replace(log.slice(span.start, span.stop), warnings=(*log.warnings, *cut_warnings(log, span)))


def cut_warnings(log: Log, span: slice) -> tuple[str, ...]:
    """A warning where the ends of `log` outside `span` take `LONG` s or more."""
    first, last = float(log.time[span.start]), float(log.time[span.stop - 1])
    before, after = first - float(log.time[0]), float(log.time[-1]) - last
    ends = [f"before {first:.3f} s"] if before >= LONG else []
    ends += [f"after {last:.3f} s"] if after >= LONG else []
    return (f"{log.name}: no duty cycles {' and '.join(ends)}; these samples are left out.",) if ends else ()


def at_samples(simulated: Log, log: Log) -> Log:
    """A simulation at the samples of `log`, whose stamps it has, or some of them; NaN where it has not.

    The duty cycles of these samples are those of `log`.
    """
    at = np.minimum(np.searchsorted(simulated.time, log.time), len(simulated) - 1)
    known = simulated.time[at] == log.time

    def column(name: str, values: FloatArray) -> FloatArray:
        return np.where(known, values[at], log[name] if name in INPUTS else np.nan)

    columns = {name: column(name, values) for name, values in simulated.columns.items()}
    return replace(simulated, time=log.time, columns=columns)
