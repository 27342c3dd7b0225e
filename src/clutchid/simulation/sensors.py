"""Models of the sensors: first-order lags and offsets."""

from __future__ import annotations

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.log import FloatArray, Log, holes, sample_interval
from clutchid.parameters import Parameters
from clutchid.strokes.sampled import runs

_KERNELS = "clutchid.simulation.comparison"


def lagged(x: FloatArray, tau: float, step: float) -> FloatArray:
    """Output of a sensor with a first-order lag for `x`, linear between samples.

    Parameters
    ----------
    x : shape (n,) or (n, m)
        Samples first. Before the first sample x is extrapolated linearly.
    tau : s
        Time constant, at least 0. Below 0.01 sample intervals the lag is a shift in time, by the rate of x.
    step : s
        Sample interval.

    Returns
    -------
    output : as x

    Examples
    --------
    The output for a ramp is 2 ms late:

    >>> lagged(0.25 * np.arange(4.0), 2e-3, 1e-3)
    array([-0.5 , -0.25,  0.  ,  0.25])
    """
    columns = np.ascontiguousarray(x if x.ndim == 2 else x[:, None], dtype=np.float64)
    output = np.empty_like(columns)
    kernels_in(_KERNELS).apply_lag(columns, tau / step, output)
    return output.reshape(x.shape)


def lag_coefficients(tau: float, dt: FloatArray) -> FloatArray:
    """Recursion of a first-order lag: ``output[k+1] = a output[k] + b x[k] + c x[k+1]``, x linear in between.

    Parameters
    ----------
    tau : s
        Time constant, at least 0. Below 0.01 of an interval the lag is a shift in time, ``a = 0`` and ``b = tau / dt``.
    dt : s
        Length of each interval, shape (n,).

    Returns
    -------
    coefficients : (n, 6)
        a, b and c, with sum 1, and their derivatives with respect to tau in 1/s.

    Examples
    --------
    After an interval as long as the lag, 37 % of the previous output is left:

    >>> a, b, c = lag_coefficients(1e-3, np.array([1e-3]))[0, :3]
    >>> f"{a:.2f} {b:.2f} {c:.2f}"
    '0.37 0.26 0.37'
    """
    coefficients = np.empty((dt.size, 6))
    kernels_in(_KERNELS).lag_coefficients(tau, np.ascontiguousarray(dt), coefficients)
    return coefficients


def sensor_output(values: FloatArray, time: FloatArray, lag: float, offset: float) -> FloatArray:
    """Output of a sensor with a lag in s and an offset for `values` at `time`; NaN where they are NaN.

    Nothing lasts across a hole in time: the values behind it belong to another segment, and start anew.
    """
    if time.size < 2:
        return values + offset
    record = np.full_like(values, np.nan)
    step = sample_interval(time)
    finite = np.isfinite(values)
    for a, b in runs(finite[:-1] & finite[1:] & ~holes(time)):
        record[a : b + 1] = lagged(values[a : b + 1], lag, step)
    alone = finite & np.isnan(record)
    record[alone] = values[alone]
    return record + offset


def with_sensors(simulated: Log, p: Parameters) -> Log:
    """A simulation as the sensors would record it, including the interval of its pressure.

    Parameters
    ----------
    simulated : Log
        With position and pressure_a.
    p : Parameters
        Lags ``tau_y`` and ``tau_p`` in s, offsets ``e_y`` in m and ``e_p`` in Pa.

    Examples
    --------
    With a lag of 2 ms a piston at 0.25 m/s is recorded half a millimetre behind:

    >>> t = np.array([0.0, 1e-3])
    >>> pressure = np.full(2, 3e5)
    >>> motion = Log(t, {"position": 0.25 * t, "pressure_a": pressure})
    >>> f"{with_sensors(motion, Parameters(tau_y=2e-3))['position'][0] * 1e3:.2f} mm"
    '-0.50 mm'
    """
    shift = sensor_output(simulated["pressure_a"], simulated.time, p.tau_p, p.e_p) - simulated["pressure_a"]
    bands = [key for key in ("pressure_a", "pressure_a low", "pressure_a high") if key in simulated]
    position = sensor_output(simulated["position"], simulated.time, p.tau_y, p.e_y)
    return simulated.with_columns(position=position, **{key: simulated[key] + shift for key in bands})


def without_sensors(log: Log, p: Parameters) -> Log:
    """A recording corrected for lags and offsets of its sensors: later samples, shifted back in time."""
    lags = {"position": (p.tau_y, p.e_y), "pressure_a": (p.tau_p, p.e_p)}
    parts = np.split(np.arange(len(log)), np.flatnonzero(holes(log.time)) + 1)
    columns = {
        name: np.concatenate([np.interp(log.time[at] + lag, log.time[at], log[name][at]) for at in parts]) - offset
        for name, (lag, offset) in lags.items()
        if name in log
    }
    return log.with_columns(**columns)
