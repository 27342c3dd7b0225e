"""How far the model's state may go astray between two samples."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import VARIANTS, kernels
from clutchid.simulation.plan import Segment
from clutchid.uncertainty.noise import SPAN, Noise


def process_noise(segment: Segment, actuator: Actuator, noise: Noise) -> FloatArray:
    """Standard deviation of what each interval of a segment adds to the state at random.

    The noise is white: over `SPAN` seconds it adds up to what shooting allows between two windows. So does the part of
    the air through an open valve that the model misjudges, where the valve stays as open as it is.

    Parameters
    ----------
    segment : Segment
        Of n samples.
    actuator : Actuator
        Its valves and its chamber say how fast air comes in.
    noise : Noise
        Random error of the states over `SPAN`, in SI, and of the flow, as a share of it.

    Returns
    -------
    sigma : (n - 1, n_states), in SI
    """
    p, names = actuator.parameters, VARIANTS[actuator.model]
    root = np.sqrt(segment.dt)[:, None]
    sigma: FloatArray = root * np.array([noise.states[name] for name in names]) / np.sqrt(SPAN)
    u, opening = segment.inputs[:-1], kernels(actuator.model).opening
    opened = opening(u[:, 0], p.R_0vs, p.R_1vs) + opening(u[:, 1], p.R_0ve, p.R_1ve)
    volume = p.V_0A + 0.5 * p.A_A * p.y_max
    rate = p.rho_0 * p.C_vs * p.P_S * p.R * p.T_0 / volume
    at = names.index("p_A")
    sigma[:, at] = np.hypot(sigma[:, at], noise.flow * rate * opened * np.sqrt(SPAN) * root[:, 0])
    return sigma
