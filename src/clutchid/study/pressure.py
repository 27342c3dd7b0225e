"""Pressure in chamber A from the load: Eq. (26), and the full balance of forces with friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.estimation.result import Recording
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.static import balanced_pressure, static_load, static_pressure

#: Time in s over which velocity and acceleration are computed from the measured position.
_SMOOTHING = 0.06


@dataclass(frozen=True, slots=True, eq=False)
class Pressures:
    """Pressure in chamber A in Pa over a recording, by four methods, and the measured one if available.

    `static` is Eq. (26), `balanced` Eq. (1) solved for p_A with friction and acceleration; each along the simulated
    motion, where the balance is the simulated pressure, and along the measured position with velocity and acceleration
    derived from it.
    """

    static_simulated: FloatArray
    balanced_simulated: FloatArray
    static_measured: FloatArray
    balanced_measured: FloatArray
    measured: FloatArray | None

    def rms(self, name: str) -> float | None:
        """Rms error in Pa of the pressure `name` against the measured one; None if that is missing."""
        if self.measured is None:
            return None
        difference = getattr(self, name) - self.measured
        finite = difference[np.isfinite(difference)]
        return float(np.sqrt(np.mean(finite**2))) if finite.size else None


def pressures(actuator: Actuator, recording: Recording) -> Pressures:
    """Eq. (26) and the full balance for a recording that was simulated with `actuator`."""
    from clutchid.model.friction import deflection_rate, friction_force

    simulated, measured = recording.simulated, recording.measured
    p, force = actuator.parameters, actuator.load.force
    y, v, acceleration = measured_motion(measured)
    z = _deflection(v, measured.time, p.K_z, p.F_C)
    friction = friction_force(v, z, deflection_rate(v, z, p.K_z, p.F_C), p.D_v, p.K_z, p.D_zdot)
    balance = (acceleration, simulated["pressure_b"], force(y), friction, 0.0, p.A_A, p.A_B, p.P_0, p.M)
    return Pressures(
        static_pressure(force(simulated["position"]), p.P_0, p.A_A), simulated["pressure_a"],
        static_pressure(force(y), p.P_0, p.A_A), balanced_pressure(*balance), measured.columns.get("pressure_a"),
    )  # fmt: skip


def static_estimate(log: Log, actuator: Actuator, slow: float) -> tuple[FloatArray, FloatArray]:
    """Position in m and load in N by Eq. (25) from the measured pressure, where slower than `slow` m/s."""
    if "pressure_a" not in log:
        return np.zeros(0), np.zeros(0)
    y, v, _ = measured_motion(log)
    keep = (np.abs(v) <= slow) & np.isfinite(log["pressure_a"]) & np.isfinite(y)
    p = actuator.parameters
    return y[keep], np.asarray(static_load(log["pressure_a"][keep], p.P_0, p.A_A), dtype=np.float64)


def measured_motion(log: Log) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position, velocity and acceleration from the measured position: a sliding quadratic over `_SMOOTHING` s.

    Examples
    --------
    >>> t = np.arange(0, 1, 1e-3)
    >>> y, v, a = measured_motion(Log(t, {"position": 0.5 * t**2}))
    >>> [round(float(x[500]), 6) for x in (y, v, a)]
    [0.125, 0.5, 1.0]
    """
    finite = np.isfinite(log["position"])
    n = len(log)
    step = float(log.time[-1] - log.time[0]) / max(1, n - 1)
    if finite.sum() < 3 or step <= 0.0:
        return log["position"], np.zeros(n), np.zeros(n)
    even = log.time[0] + step * np.arange(n)
    position = np.interp(even, log.time[finite], log["position"][finite])
    half = max(1, round(_SMOOTHING / (2 * step)))
    offsets = step * np.arange(-half, half + 1)
    kernels = np.linalg.pinv(np.vander(offsets, 3, increasing=True)) * np.array([[1.0], [1.0], [2.0]])
    padded = np.pad(position, half, mode="edge")
    y, v, a = (np.interp(log.time, even, np.correlate(padded, kernel, "valid")) for kernel in kernels)
    return y, v, a


def _deflection(v: FloatArray, time: FloatArray, K_z: float, F_C: float) -> FloatArray:
    """Seal deflection by Eq. (3) along a known velocity; exact for piecewise constant v."""
    from clutchid.model.friction import deflection_rate

    dt, rate = np.diff(time), v - deflection_rate(v, 1.0, K_z, F_C)  # z_dot = v - rate z
    decay = np.exp(-rate[:-1] * dt)
    gain = v[:-1] * np.where(rate[:-1] > 0.0, (1.0 - decay) / np.maximum(rate[:-1], 1e-12), dt)
    z = np.zeros_like(v)
    for k in range(dt.size):
        z[k + 1] = decay[k] * z[k] + gain[k]
    return z
