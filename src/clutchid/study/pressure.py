"""Pressure in chamber A from the load: Eq. (26), and the full balance of forces with friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

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
    motion, and along the measured position with velocity and acceleration derived from it.
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
    simulated, measured = recording.simulated, recording.measured
    p, force = actuator.parameters, actuator.load.force
    y, v, z = (simulated[name] for name in ("position", "velocity", "deflection"))
    text = _texts(actuator.model)
    numbers = actuator.array()
    a = np.gradient(v, simulated.time)
    friction = text["f_f"](v, z, text["z_dot"](v, z, numbers), numbers)
    stop = text["f_s"](y, v, numbers)
    y_m, v_m, a_m = measured_motion(measured)
    friction_m = text["f_f"](v_m, *_deflection(text["z_dot"], v_m, measured.time, numbers), numbers)
    common = (p.A_A, p.A_B, p.P_0, p.M)
    return Pressures(
        static_pressure(force(y), p.P_0, p.A_A),
        balanced_pressure(a, simulated["pressure_b"], force(y), friction, stop, *common),
        static_pressure(force(y_m), p.P_0, p.A_A),
        balanced_pressure(a_m, simulated["pressure_b"], force(y_m), friction_m, 0.0, *common),
        measured.columns.get("pressure_a"),
    )


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


def _deflection(
    rate: Callable[..., FloatArray], v: FloatArray, time: FloatArray, numbers: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Seal deflection and its rate along a known velocity; exact for piecewise constant v."""
    offset = rate(v, np.zeros_like(v), numbers)
    slope = rate(v, np.ones_like(v), numbers) - offset
    dt = np.diff(time, append=time[-1])
    decay = np.exp(slope * dt)
    gain = np.where(slope == 0.0, dt, np.expm1(slope * dt) / np.where(slope == 0.0, 1.0, slope)) * offset
    z = np.zeros_like(v)
    for k in range(v.size - 1):
        z[k + 1] = decay[k] * z[k] + gain[k]
    return z, offset + slope * z


@cache
def _texts(model: str) -> dict[str, Callable[..., FloatArray]]:
    """Friction, deflection rate and stop force from the equations of the model, for arrays."""
    import sympy as sp

    from clutchid.model.compiled import system as equations

    system = equations(model)
    text = {str(symbol): expression for symbol, expression in system.definitions}
    y, v, _, _, z = system.states
    z_dot = sp.Symbol("z_dot", real=True)
    arguments = {"z_dot": (v, z), "f_f": (v, z, z_dot), "f_s": (y, v)}
    return {
        name: sp.lambdify([*states, list(system.parameters)], text[name], "numpy") for name, states in arguments.items()
    }
