"""What the sensors record of a motion: their lags, to first order, and their offsets."""

from __future__ import annotations

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.log import FloatArray, Log
from clutchid.parameters import Parameters

_KERNELS = "clutchid.simulation.comparison"


def lagged(x: FloatArray, tau: float, step: float) -> FloatArray:
    """What a sensor with a lag of first order shows of `x`, which goes straight from sample to sample.

    Parameters
    ----------
    x : shape (n,) or (n, m)
        Samples first. Before the first, x has changed as it does after it.
    tau : s
        Time constant; below 0 the sensor is early, and its rate is taken for the lag.
    step : s
        Time from sample to sample.

    Returns
    -------
    shown : as x

    Examples
    --------
    A ramp is shown 2 ms late:

    >>> lagged(0.25 * np.arange(4.0), 2e-3, 1e-3)
    array([-0.5 , -0.25,  0.  ,  0.25])
    """
    columns = np.ascontiguousarray(x if x.ndim == 2 else x[:, None], dtype=np.float64)
    shown = np.empty_like(columns)
    kernels_in(_KERNELS).follow(columns, tau / step, shown)
    return shown.reshape(x.shape)


def lag_slope(x: FloatArray, shown: FloatArray, tau: float, step: float) -> FloatArray:
    """Derivative of `lagged` to tau, in units of x per second; `shown` is ``lagged(x, tau, step)``, shape (n,)."""
    slope = np.empty(x.size)
    columns = (np.ascontiguousarray(values, dtype=np.float64)[:, None] for values in (x, shown))
    kernels_in(_KERNELS).follow_slope(*columns, tau / step, slope)
    return slope / step


def seen(values: FloatArray, time: FloatArray, lag: float, offset: float) -> FloatArray:
    """What a sensor with a lag in s and an offset records of `values` over `time`; where they are NaN it is NaN."""
    if time.size < 2:
        return values + offset
    record = np.full_like(values, np.nan)
    step = float(np.median(np.diff(time)))
    known = np.flatnonzero(np.isfinite(values))
    for part in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        record[part] = lagged(values[part], lag, step)
    return record + offset


def sensed(simulated: Log, p: Parameters) -> Log:
    """A simulation as the sensors would record it, with the bands of its pressure.

    Parameters
    ----------
    simulated : Log
        With position and pressure_a.
    p : Parameters
        Lags ``tau_y`` and ``tau_p`` in s, offsets ``e_y`` in m and ``e_p`` in Pa.

    Examples
    --------
    A sensor that is 2 ms late sees a piston at 0.25 m/s half a millimetre behind:

    >>> t = np.array([0.0, 1e-3])
    >>> pressure = np.full(2, 3e5)
    >>> motion = Log(t, {"position": 0.25 * t, "pressure_a": pressure})
    >>> f"{sensed(motion, Parameters(tau_y=2e-3))['position'][0] * 1e3:.2f} mm"
    '-0.50 mm'
    """
    shift = seen(simulated["pressure_a"], simulated.time, p.tau_p, p.e_p) - simulated["pressure_a"]
    bands = [key for key in ("pressure_a", "pressure_a low", "pressure_a high") if key in simulated]
    position = seen(simulated["position"], simulated.time, p.tau_y, p.e_y)
    return simulated.with_columns(position=position, **{key: simulated[key] + shift for key in bands})


def undone(log: Log, p: Parameters) -> Log:
    """A recording with lags and offsets of its sensors undone: later samples, moved to when they were true."""
    lags = {"position": (p.tau_y, p.e_y), "pressure_a": (p.tau_p, p.e_p)}
    return log.with_columns(
        **{
            name: np.interp(log.time + lag, log.time, log[name]) - offset
            for name, (lag, offset) in lags.items()
            if name in log
        }
    )
