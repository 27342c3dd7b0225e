"""A band around a simulated pressure, from what the same simulation missed where the pressure was measured."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import INPUTS, FloatArray, Log

#: Times in s since a valve was last switched that divide the samples into groups: a simulation misses most in the first
#: milliseconds, where a valve that moves a sample later than its command is worth tenths of a bar.
SINCE = (0.003, 0.006, 0.01, 0.02, 0.03, 0.05, 0.1)

#: A duty cycle nearer to 0 or 1 than this is one of a valve that is switched, and so are nearly all of a recording.
NEAR, NEARLY_ALL = 0.02, 0.95


def switching_band(simulated: Log, known: Sequence[tuple[Log, Log]], level: float = 0.95) -> Log:
    r"""`simulated` with a band of its pressure that held the share `level` of the samples of other recordings.

    .. math:: |p_A - \hat p_A| \le q_g, \quad q_g \text{ the } \lceil (n_g + 1) \, level \rceil \text{-th smallest of }
              n_g \text{ known errors in group } g

    Samples are grouped by whether the supply valve is on and by the time since it was last switched, `SINCE`. This is
    split conformal prediction: it assumes nothing of the model, but that the other recordings are strokes like these,
    and it counts every sample as independent. Few strokes make a band that is itself uncertain.

    Parameters
    ----------
    simulated : Log
        With duty cycles and pressure_a in Pa, simulated.
    known : several (measured, simulated)
        Recordings of the same actuator with the pressure measured, and their simulations by the same parameters.
    level : 1
        Share of the samples that the band is to hold, in (0, 1).

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
    A simulation that was 1 kPa off all the time is trusted to 1 kPa:

    >>> t = np.arange(0.0, 0.5, 1e-3)
    >>> duty = {"duty_supply": 1.0 * (t > 0.2), "duty_exhaust": 1.0 * (t <= 0.2)}
    >>> log = Log(t, {**duty, "pressure_a": np.full(t.size, 2e5)})
    >>> banded = switching_band(log, [(log.with_columns(pressure_a=log["pressure_a"] + 1e3), log)])
    >>> float(banded["pressure_a high"].max()), float(banded["pressure_a low"].min())
    (201000.0, 199000.0)
    """
    for log in (simulated, *(run for _, run in known)):
        _check_switched(log)
    groups = np.concatenate([_group(run) for _, run in known]) if known else np.zeros(0, dtype=np.int64)
    missed = [np.abs(measured["pressure_a"] - run["pressure_a"]) for measured, run in known if "pressure_a" in measured]
    error = np.concatenate(missed) if len(missed) == len(known) and missed else np.zeros(0)
    finite = np.isfinite(error)
    if not finite.any():
        raise DataError(f"{simulated.name}: no recording with a measured pressure to take the width of a band from.")
    groups, error = groups[finite], error[finite]
    half = np.full(len(simulated), quantile(error, 1.0))
    own = _group(simulated)
    for group in np.unique(groups):
        half[own == group] = quantile(error[groups == group], level)
    pressure = simulated["pressure_a"]
    return simulated.with_columns(**{"pressure_a low": pressure - half, "pressure_a high": pressure + half})


def quantile(error: FloatArray, level: float) -> float:
    """The value that the next of such errors does not exceed with probability `level`; the largest where they are few.

    Examples
    --------
    >>> quantile(np.arange(1.0, 101.0), 0.95)
    96.0
    """
    place = min(math.ceil((error.size + 1) * level), error.size)
    return float(np.sort(error)[place - 1])


def _group(log: Log) -> NDArray[np.int64]:
    """Number of the group of every sample; before the first switching it counts as long ago."""
    on = log["duty_supply"] > 0.5
    switched = log.time[1:][np.diff(on.astype(np.int8)) != 0]
    last = np.searchsorted(switched, log.time, side="right") - 1
    since = np.where(last >= 0, log.time - switched[np.maximum(last, 0)] if switched.size else 0.0, np.inf)
    # a sample at the border belongs to the later group, whatever the last bit of its time
    return np.searchsorted(np.array(SINCE) - 1e-9, since, side="right") + (len(SINCE) + 1) * on


def _check_switched(log: Log) -> None:
    for name in INPUTS:
        duty = log[name][np.isfinite(log[name])]
        switched = (duty < NEAR) | (duty > 1.0 - NEAR)
        if duty.size and float(np.mean(switched)) < NEARLY_ALL:
            raise DataError(
                f"{log.name}: {name} is neither 0 nor 1 in {100 * (1 - np.mean(switched)):.0f} % of its samples; this "
                "band is for on/off valves. For others a fit by shooting gives one."
            )
