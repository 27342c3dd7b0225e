"""Process noise: the random error of the model between samples or windows."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.log.states import NOISE_SPAN
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.simulation.noise import Noise
from clutchid.simulation.plan import Segment


def process_noise(segment: Segment, actuator: Actuator, noise: Noise) -> FloatArray:
    """Standard deviation of the process noise of the states in each interval of a segment.

    The noise is white: over `NOISE_SPAN` seconds it accumulates to the link between two windows of multiple shooting.
    The same holds for the error in the flow through an open valve, if the opening is constant.

    Parameters
    ----------
    segment : Segment
        Of n samples.
    actuator : Actuator
        Its valves and chamber give the flow.
    noise : Noise
        Random error of the states over `NOISE_SPAN` in SI, and relative error of the flow.

    Returns
    -------
    sigma : (n - 1, n_states), in SI
    """
    # as white noise the flow error accumulates to the same value over the span
    opened = opening_of_valves(segment, actuator) * np.sqrt(segment.dt * NOISE_SPAN)
    return state_deviations(actuator, noise, segment.dt, np.hypot(noise.flow * opened, segment.open_std))


def opening_of_valves(segment: Segment, actuator: Actuator) -> FloatArray:
    """Opening of both valves together, from 0 to 2, in each interval of a segment, shape (n - 1,)."""
    p, opening = actuator.parameters, kernels(actuator.model).opening
    u = segment.inputs[: segment.dt.size]
    result: FloatArray = opening(u[:, 0], p.R_0vs, p.R_1vs) + opening(u[:, 1], p.R_0ve, p.R_1ve)
    return result


def state_deviations(actuator: Actuator, noise: Noise, span: FloatArray, open_std: FloatArray) -> FloatArray:
    """Standard deviation of the process noise accumulated over each `span` in s, shape (n, n_states), in SI.

    The states follow a random walk. The flow has the error of `open_std` seconds of a fully open valve, which enters
    the pressure of a chamber at half stroke.
    """
    p = actuator.parameters
    volume = p.V_0A + 0.5 * p.A_A * p.y_max
    air = open_std * p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0 / volume
    sigma: FloatArray = np.array([noise.states[name] for name in actuator.states]) * np.sqrt(span / NOISE_SPAN)[:, None]
    at = actuator.states.index("p_A")
    sigma[:, at] = np.hypot(sigma[:, at], air)
    return sigma


def start_deviations(segment: Segment, actuator: Actuator, with_pressure: bool, noise: Noise) -> FloatArray:
    """Standard deviations of the first state of a segment, shape (n_states,), in SI."""
    sigma = {n: row.start if segment.vented else row.unknown_start for n, row in actuator.state_rows.items()}
    if with_pressure and np.isfinite(segment.pressure_start):
        sigma["p_A"] = max(sigma["p_A"] if segment.vented else 0.0, noise.measured["pressure_a"])
    return np.array(list(sigma.values()))
