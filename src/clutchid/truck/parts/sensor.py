"""Sensors of position and pressure: white noise and vibration; or a curved scale, coloured noise and a gain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from clutchid.log import FloatArray
from clutchid.truck.parts.part import GUESS, Sensor
from clutchid.truck.rows import number
from clutchid.truck.settings import SAMPLE

_SHARED = ("q_y", "s_y", "tau_y", "e_y", "q_p", "s_p", "tau_p", "e_p", "zero")


@dataclass(frozen=True, kw_only=True)
class VibratingRows:
    """A position sensor with vibration of an engine order."""

    a_vib: float = number(3e-5, "m", "position: engine-order vibration, amplitude", 0, 1e-3)
    order: float = number(3.0, "1", "position: engine order of the vibration", 0.5, 12, "six cylinders")


@dataclass(frozen=True, kw_only=True)
class CurvedRows:
    """A position sensor with a curved scale and coloured noise, and a pressure sensor with a gain."""

    e_lin: float = number(0.007, "1", "position: variation of the gain over the stroke", -0.05, 0.05, GUESS)
    s_c_y: float = number(1.5e-5, "m", "position: coloured noise, rms", 0, 1e-3, GUESS)
    tau_c: float = number(4e-3, "s", "position and pressure: correlation time of the coloured noise", 1e-5, 1, GUESS)
    e_gain: float = number(0.0, "1", "pressure: error of the gain", -0.1, 0.1, GUESS)


def vibrating_noise(truck: Any, n: int, rng: np.random.Generator) -> FloatArray:
    """White noise and engine-order vibration of the position sensor in m; engine speed 600 to 1900 rpm."""
    anchors = np.arange(n // 500 + 3)
    speed = np.interp(np.arange(n) / 500, anchors, rng.uniform(600, 1900, anchors.size)) / 60
    phase = 2 * np.pi * np.cumsum(speed) * SAMPLE * truck.order + rng.uniform(0, 2 * np.pi)
    vibration = truck.a_vib * (np.sin(phase) + 0.3 * np.sin(0.5 * phase))
    noise: FloatArray = truck.s_y * rng.standard_normal(n) + vibration
    return noise


def offset_pressure(truck: Any, pressure: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Measured pressure in Pa from the lagged one: offset, noise and quantisation."""
    noisy: FloatArray = pressure + truck.e_p + truck.s_p * rng.standard_normal(pressure.size)
    return truck.q_p * np.round(noisy / truck.q_p) if truck.q_p > 0 else noisy


def coloured(n: int, tau: float, rng: np.random.Generator) -> FloatArray:
    """Noise of standard deviation 1 whose correlation decays within `tau` in s (first-order Gauss-Markov)."""
    from scipy.signal import lfilter

    decay = float(np.exp(-SAMPLE / tau))
    first = rng.standard_normal()
    return lfilter([np.sqrt(1 - decay**2)], [1, -decay], rng.standard_normal(n), zi=[decay * first])[0]


def coloured_noise(truck: Any, n: int, rng: np.random.Generator) -> FloatArray:
    """White and coloured noise of the position sensor in m."""
    noise: FloatArray = truck.s_y * rng.standard_normal(n) + truck.s_c_y * coloured(n, truck.tau_c, rng)
    return noise


def gained_pressure(truck: Any, pressure: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Measured pressure in Pa from the lagged one: gain (about ambient), offset, coloured noise and quantisation."""
    true = truck.P_0 + (1 + truck.e_gain) * (pressure - truck.P_0)
    noisy: FloatArray = true + truck.e_p + truck.s_p * coloured(pressure.size, truck.tau_c, rng)
    return truck.q_p * np.round(noisy / truck.q_p) if truck.q_p > 0 else noisy


VIBRATING = Sensor(
    name="white noise and vibration", rows=VibratingRows, shared=_SHARED, numbers=lambda _: {"e_lin": 0.0},
    position_noise=vibrating_noise, measured_pressure=offset_pressure,
)  # fmt: skip
CURVED = Sensor(
    name="curved scale and coloured noise", rows=CurvedRows, shared=_SHARED, position_noise=coloured_noise,
    measured_pressure=gained_pressure,
    prepared=lambda drawn: {n: v for n, v in drawn.items() if n != "bend"} | {"e_lin": drawn["bend"] * drawn["e_lin"]},
)  # fmt: skip
