"""Sensors of family B: coloured noise of the position, and a pressure sensor with an error of its gain."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.truck.law import SAMPLE
from clutchid.truck.second.parameters import TruckB


def coloured(n: int, tau: float, rng: np.random.Generator) -> FloatArray:
    """Noise of standard deviation 1 whose correlation decays within `tau` in s (first-order Gauss-Markov)."""
    from scipy.signal import lfilter

    kept = float(np.exp(-SAMPLE / tau))
    first = rng.standard_normal()
    noise: FloatArray = lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(n), zi=[kept * first])[0]
    return noise


def position_noise(truck: TruckB, n: int, rng: np.random.Generator) -> FloatArray:
    """White and coloured noise of the position sensor in m."""
    noise: FloatArray = truck.s_y * rng.standard_normal(n) + truck.s_c_y * coloured(n, truck.tau_c, rng)
    return noise


def measured_pressure(truck: TruckB, pressure: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Measured pressure in Pa from the lagged one: gain (about ambient), offset, coloured noise and quantisation."""
    true = truck.P_0 + (1 + truck.e_gain) * (pressure - truck.P_0)
    noisy: FloatArray = true + truck.e_p + truck.s_p * coloured(pressure.size, truck.tau_c, rng)
    return truck.q_p * np.round(noisy / truck.q_p) if truck.q_p > 0 else noisy
