"""Residuals of a simulated recording: fit in %, whiteness, and correlation with the inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import HOLE, INPUTS, FloatArray, Log
from clutchid.log.states import MEASURED
from clutchid.numerics.whiteness import LAGS, Colour, block_means, colour, effective_samples

#: Interval in s at which the slow autocorrelation is evaluated: the lags then reach half a second.
_SLOW_INTERVAL = 0.02

#: For white noise, more than 2 of 25 lags lie outside the 99 % bounds in only 1 of 500 recordings.
MOST_OUTSIDE = 2.5 / 25

#: For white noise, the largest of 51 correlations exceeds this multiple of its 99 % bound in only 1 of 100 recordings
#: (Bonferroni).
COLOURED = 3.724 / 2.576

#: A smaller correlation with an input explains less than 1 % of the whitened residual at either rate.
LEAST_CORRELATION = 0.1

#: The number of effective samples is reported if autocorrelation reduces it by at least a tenth.
_FEWER = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class ColumnDiagnosis:
    """Residual, measured less simulated, of one column; in SI.

    `fit_percent` is 100 where the simulation is exact and 0 where it is as good as the mean. `effective_samples` is
    the number of independent samples with the same information as the autocorrelated `samples`. `fast` is the
    autocorrelation at the sample rate of the column, `slow` at an interval of 20 ms or more.
    """

    samples: int
    fit_percent: float
    rms: float
    mean: float
    effective_samples: float
    fast: Colour
    slow: Colour

    @property
    def autocorrelated(self) -> float:
        """Rms of the autocorrelated part, that which neighbouring samples share."""
        return self.rms * float(np.sqrt(max(np.nan_to_num(self.fast.first), 0.0)))


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Residuals of the recording `name` by measured column: position and, if measured, pressure_a."""

    name: str
    columns: Mapping[str, ColumnDiagnosis]


def diagnose(measured: Log, simulated: Log) -> Diagnosis:
    """Diagnose the residuals of a simulated recording.

    Parameters
    ----------
    measured : Log
        Position in m, pressure_a in Pa if measured, and the duty cycles.
    simulated : Log
        The same columns at the same times. NaN in either is left out, element by element.

    Returns
    -------
    diagnosis : Diagnosis

    Raises
    ------
    DataError
        If the times differ, or no position can be compared.

    Examples
    --------
    A simulation that is 0.1 mm too low over a stroke of 10 mm:

    >>> t = np.arange(0.0, 1.0, 1e-3)
    >>> stroke = Log(t, {"position": 0.01 * t})
    >>> found = diagnose(stroke, stroke.with_columns(position=stroke["position"] - 1e-4)).columns["position"]
    >>> f"{found.fit_percent:.1f} %, {found.mean * 1e3:+.1f} mm"
    '96.5 %, +0.1 mm'
    """
    if simulated.time.shape != measured.time.shape or not np.allclose(simulated.time, measured.time, rtol=0, atol=1e-6):
        raise DataError(
            f"{measured.name}: recorded and simulated times differ ({len(measured)} and {len(simulated)} samples); "
            "compare a recording with its own simulation."
        )
    columns = {}
    for name in MEASURED:
        if name in measured and name in simulated:
            finite = np.isfinite(measured[name]) & np.isfinite(simulated[name])
            if finite.any():
                columns[name] = _diagnosed(measured, np.where(finite, measured[name] - simulated[name], np.nan), name)
    if "position" not in columns:
        raise DataError(
            f"{measured.name}: no sample has both a measured and a simulated position; check the recording."
        )
    return Diagnosis(measured.name, columns)


def fit_percent(measured: FloatArray, simulated: FloatArray) -> float:
    r"""Fit of a simulation in %, by the formula of MATLAB's `compare`.

    .. math:: 100 \, (1 - |y - \hat y| / |y - \bar y|)

    Parameters
    ----------
    measured, simulated : any unit
        NaN in either is left out.

    Returns
    -------
    fit : %
        100 for a perfect fit, 0 if it is as good as the mean, negative if worse; NaN for a constant.

    Examples
    --------
    >>> fit_percent(np.array([0.0, 2.0, 4.0]), np.array([0.0, 2.0, 3.0]))
    64.64466094067262
    """
    finite = np.isfinite(measured) & np.isfinite(simulated)
    y, error = measured[finite], (measured - simulated)[finite]
    if y.size == 0 or not np.ptp(y) > 0.0:
        return float("nan")
    return float(100 * (1 - np.sqrt(np.sum(error**2) / np.sum((y - y.mean()) ** 2))))


def _diagnosed(log: Log, residual: FloatArray, name: str) -> ColumnDiagnosis:
    finite = np.isfinite(residual)
    error = residual[finite]
    block, interval, even, inputs = _evenly(log, residual, finite)
    slow_inputs = {key: block_means(values, block) for key, values in inputs.items()}
    fast = colour(even, inputs, interval)
    slow = colour(block_means(even, block), slow_inputs, block * interval) if block > 1 else fast
    return ColumnDiagnosis(
        error.size,
        fit_percent(log[name], log[name] - residual),
        float(np.sqrt(np.mean(error**2))),
        float(error.mean()),
        effective_samples(even, block),
        fast,
        slow,
    )


def _evenly(
    log: Log, residual: FloatArray, finite: NDArray[np.bool_]
) -> tuple[int, float, FloatArray, dict[str, FloatArray]]:
    """Samples per slow interval, the interval in s, and residual and inputs on a uniform time grid of that interval.

    The interval is the usual one of the samples that can be compared, so a column with a lower rate keeps its rate. A
    hole is filled with NaN up to a limited length, which bounds the memory.
    """
    time = log.time[finite]
    steps = np.diff(time)
    interval = float(np.median(steps)) if steps.size else 1.0
    block = max(1, round(_SLOW_INTERVAL / interval))
    longest = min((LAGS + 1) * block, 1 + 4 * time.size // max(1, int(np.sum(steps > HOLE * interval))))
    place = np.concatenate([[0], np.cumsum(np.clip(np.rint(steps / interval), 1, longest).astype(np.int64))])

    def spread(values: FloatArray) -> FloatArray:
        even = np.full(int(place[-1]) + 1, np.nan)
        even[place] = values[finite]
        return even

    return block, interval, spread(residual), {key: spread(log[key]) for key in INPUTS if key in log}


def remarks(diagnosis: Diagnosis) -> list[str]:
    """Remarks on the residuals, one sentence each; empty if they look like white noise."""
    sentences = []
    for name, column in diagnosis.columns.items():
        who = f"{diagnosis.name}: the residual of {name}"
        sentences += _of_colour(column, who) + _of_inputs(column, who)
    return sentences


def _of_colour(column: ColumnDiagnosis, who: str) -> list[str]:
    worst = max((column.fast, column.slow), key=lambda rate: np.nan_to_num(rate.share_outside))
    if not worst.share_outside > MOST_OUTSIDE:
        return []
    text = f"{who} is coloured: {100 * worst.share_outside:.0f} % of the lags up to {worst.lag[-1] * 1e3:.0f} ms lie "
    text += "outside the 99 % bounds"
    if column.effective_samples < _FEWER * column.samples:
        text += f"; its {column.samples} samples are equivalent to {column.effective_samples:.0f} independent ones"
    return [f"{text}."]


def _of_inputs(column: ColumnDiagnosis, who: str) -> list[str]:
    sentences = []
    for name in INPUTS:
        rates = [rate.inputs[name] for rate in (column.fast, column.slow) if name in rate.inputs]
        certain = [rate for rate in rates if abs(rate.strongest) > COLOURED * rate.strongest_bound]
        best = max(certain, key=lambda rate: abs(rate.strongest), default=None)
        if best is not None and abs(best.strongest) > LEAST_CORRELATION:
            # the fast rate gives the lag more precisely where both rates find the same one
            lags = [rate.strongest_lag for rate in certain]
            lag = 1e3 * next(at for at in lags if abs(at - best.strongest_lag) <= column.slow.interval)
            how = f"follows {name} after {lag:.0f} ms" if lag > 0 else f"correlates with {name}"
            if lag < 0:
                how = f"precedes {name} by {-lag:.0f} ms"
            what = "an error of the model at this valve, which the verdict weighs"
            what = "the position controller reacts to it" if lag < 0 else what
            sentences.append(
                f"{who} {how} (correlation {best.strongest:+.2f}, 99 % bound {best.strongest_bound:.2f}): {what}."
            )
    return sentences
