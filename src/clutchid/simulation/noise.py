"""Standard deviations of measurement noise, and process noise: the model's own error between samples."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from clutchid.log import FloatArray
from clutchid.log.states import MEASURED, NOISE_SPAN, STATES
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import kernels
from clutchid.simulation.plan import Segment

#: Limits of a re-estimated noise scale, as multiples of the usual one: a sensor may be better than usual, but the model
#: error within a window is not.
_MIN_SCALE, _MAX_SCALE = 1.0, 10.0

_STATE_NOISE: Mapping[str, float] = MappingProxyType({name: state.noise for name, state in STATES.items()})


def noise_scale(errors: FloatArray, usual: float, state_variance: float = 0.0) -> float:
    """Noise scale of a sensor: standard deviation from the median absolute error, within limits of the `usual` one.

    `state_variance` is the part of the variance of the `errors` that the uncertainty of the states makes.
    """
    size = np.abs(errors[np.isfinite(errors)])
    square = (1.4826 * float(np.median(size))) ** 2 - state_variance if size.size else 0.0
    return float(np.clip(np.sqrt(max(0.0, square)), _MIN_SCALE * usual, _MAX_SCALE * usual))


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of the samples of each measured column, of the states, and of the flow of air.

    `flow` is the relative error of the flow through an open valve, random in each window; `outlier` the number of
    standard deviations beyond which the loss is linear. `memory` is the correlation time of the model error in s:
    samples within it have the information of one. `unknown_start` are standard deviations of states at a start that is
    not vented, in place of those of their rows.
    """

    measured: Mapping[str, float] = field(
        default_factory=lambda: {name: sensor.noise for name, sensor in MEASURED.items()}
    )
    states: Mapping[str, float] = field(default_factory=lambda: _STATE_NOISE)
    flow: float = 0.02
    outlier: float = 4.0
    memory: float = 0.0
    unknown_start: Mapping[str, float] = field(default_factory=dict)

    def of_samples(self, name: str, spacing: float) -> float:
        """Standard deviation assigned to each sample of a measured column at intervals of `spacing` s."""
        return self.measured[name] * math.sqrt(max(1.0, self.memory / spacing))

    def inflated(self, factor: float) -> Noise:
        """All standard deviations multiplied by `factor`, which makes the problem more nearly linear."""
        return replace(
            self,
            measured={name: value * factor for name, value in self.measured.items()},
            states={name: value * factor for name, value in self.states.items()},
            flow=self.flow * factor,
        )


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
    unknown = {n: noise.unknown_start.get(n, row.unknown_start) for n, row in actuator.state_rows.items()}
    sigma = {n: row.start if segment.vented else unknown[n] for n, row in actuator.state_rows.items()}
    if with_pressure and np.isfinite(segment.pressure_start):
        sigma["p_A"] = max(sigma["p_A"] if segment.vented else 0.0, noise.measured["pressure_a"])
    return np.array(list(sigma.values()))
