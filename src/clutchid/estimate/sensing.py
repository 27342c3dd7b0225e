"""What the sensors record of a motion: their lags, to first order, and their offsets."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray, Log
from clutchid.parameters import Parameters


def seen_position(position: FloatArray, velocity: FloatArray, p: Parameters) -> FloatArray:
    """Position in m that the sensor records, where the piston is at `position` with `velocity`."""
    return position - p.tau_y * velocity + p.e_y


def seen_pressure(pressure: FloatArray, time: FloatArray, p: Parameters) -> FloatArray:
    """Pressure in Pa that the sensor records of `pressure` over `time`; of a single sample its lag is not known."""
    rate = np.gradient(pressure, time) if time.size > 1 else np.zeros_like(pressure)
    return pressure - p.tau_p * rate + p.e_p


def sensed(simulated: Log, p: Parameters) -> Log:
    """A simulation as the sensors would record it, with the bands of its pressure.

    Parameters
    ----------
    simulated : Log
        With position, velocity and pressure_a.
    p : Parameters
        Lags ``tau_y`` and ``tau_p`` in s, offsets ``e_y`` in m and ``e_p`` in Pa.

    Raises
    ------
    Nothing: what is not known stays NaN.

    Examples
    --------
    A sensor that is 2 ms late sees a piston at 0.25 m/s half a millimetre behind:

    >>> t = np.array([0.0, 1e-3])
    >>> pressure = np.full(2, 3e5)
    >>> motion = Log(t, {"position": 0.25 * t, "velocity": np.full(2, 0.25), "pressure_a": pressure})
    >>> f"{sensed(motion, Parameters(tau_y=2e-3))['position'][0] * 1e3:.2f} mm"
    '-0.50 mm'
    """
    shift = seen_pressure(simulated["pressure_a"], simulated.time, p) - simulated["pressure_a"]
    bands = [key for key in ("pressure_a", "pressure_a low", "pressure_a high") if key in simulated]
    position = seen_position(simulated["position"], simulated["velocity"], p)
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
