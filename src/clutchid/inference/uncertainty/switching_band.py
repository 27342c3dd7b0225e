"""Prediction interval of a simulated pressure, from the errors of simulations of recordings with pressure."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import INPUTS, FloatArray, Log

#: Limits in s of the time since a valve was last switched that define the groups. Errors are largest in the first
#: milliseconds, where a valve that opens one sample late changes the pressure by tenths of a bar.
_SINCE = (0.003, 0.006, 0.01, 0.02, 0.03, 0.05, 0.1)

#: A duty cycle of an on/off valve is this close to 0 or 1, in at least this fraction of the samples.
_ON_OFF_TOLERANCE, _ON_OFF_SHARE = 0.02, 0.95


def switching_band(simulated: Log, pairs: Sequence[tuple[Log, Log]]) -> Log:
    r"""`simulated` with an interval of its pressure that contains 95 % of the samples of others.

    .. math:: |p_A - \hat p_A| \le q_g, \quad q_g \text{ the } \lceil 0.95 \, (n_g + 1) \rceil \text{-th smallest of }
              n_g \text{ known errors in group } g

    Samples are grouped by whether the supply valve is on and by the time since it was last switched, `_SINCE`. This is
    split conformal prediction: its only assumption is that the other recordings contain similar strokes. It treats
    samples as independent; with few strokes the interval itself is uncertain.

    Parameters
    ----------
    simulated : Log
        With duty cycles and pressure_a in Pa, simulated.
    pairs : several (measured, simulated)
        Recordings of the same actuator with the pressure measured, and their simulations with the same parameters.

    Returns
    -------
    log : Log
        `simulated` with ``pressure_a low`` and ``pressure_a high``.

    Raises
    ------
    DataError
        If the valves are not on/off, or no measured pressure can be compared.

    References
    ----------
    Lei, G'Sell, Rinaldo, Tibshirani and Wasserman, Distribution-free predictive inference for regression, JASA 113
    (2018) 1094-1111.

    Examples
    --------
    A simulation with a constant error of 1 kPa:

    >>> t = np.arange(0.0, 0.5, 1e-3)
    >>> duty = {"duty_supply": 1.0 * (t > 0.2), "duty_exhaust": 1.0 * (t <= 0.2)}
    >>> log = Log(t, {**duty, "pressure_a": np.full(t.size, 2e5)})
    >>> banded = switching_band(log, [(log.with_columns(pressure_a=log["pressure_a"] + 1e3), log)])
    >>> float(banded["pressure_a high"].max()), float(banded["pressure_a low"].min())
    (201000.0, 199000.0)
    """
    for log in (simulated, *(run for _, run in pairs)):
        _check_switched(log)
    groups = np.concatenate([_group(run) for _, run in pairs]) if pairs else np.zeros(0, dtype=np.int64)
    errors = [np.abs(measured["pressure_a"] - run["pressure_a"]) for measured, run in pairs if "pressure_a" in measured]
    error = np.concatenate(errors) if len(errors) == len(pairs) and errors else np.zeros(0)
    finite = np.isfinite(error)
    if not finite.any():
        raise DataError(f"{simulated.name}: no recording with a measured pressure to determine the interval from.")
    groups, error = groups[finite], error[finite]
    half = np.full(len(simulated), quantile(error, 1.0))
    simulated_groups = _group(simulated)
    for group in np.unique(groups):
        half[simulated_groups == group] = quantile(error[groups == group], 0.95)
    pressure = simulated["pressure_a"]
    return simulated.with_columns(**{"pressure_a low": pressure - half, "pressure_a high": pressure + half})


def quantile(error: FloatArray, level: float) -> float:
    """Value that the next of such errors does not exceed with probability `level`; the largest if there are too few.

    Examples
    --------
    >>> quantile(np.arange(1.0, 101.0), 0.95)
    96.0
    """
    place = min(math.ceil((error.size + 1) * level), error.size)
    return float(np.sort(error)[place - 1])


def _group(log: Log) -> NDArray[np.int64]:
    """Group number of every sample; before the first switching the time is infinite."""
    on = log["duty_supply"] > 0.5
    switched = log.time[1:][np.diff(on.astype(np.int8)) != 0]
    last = np.searchsorted(switched, log.time, side="right") - 1
    since = np.where(last >= 0, log.time - switched[np.maximum(last, 0)] if switched.size else 0.0, np.inf)
    # a sample at a limit belongs to the later group, irrespective of rounding
    return np.searchsorted(np.array(_SINCE) - 1e-9, since, side="right") + (len(_SINCE) + 1) * on


def _check_switched(log: Log) -> None:
    for name in INPUTS:
        duty = log[name][np.isfinite(log[name])]
        switched = (duty < _ON_OFF_TOLERANCE) | (duty > 1.0 - _ON_OFF_TOLERANCE)
        if duty.size and float(np.mean(switched)) < _ON_OFF_SHARE:
            raise DataError(
                f"{log.name}: {name} is neither 0 nor 1 in {100 * (1 - np.mean(switched)):.0f} % of its samples; this "
                "interval is for on/off valves. For others use that of a fit by shooting."
            )
