"""Prediction errors of the position by a filter whose gains are fixed: simulations without any derivative."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.codegen.kernels import kernel, kernels_in
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import Model, kernels
from clutchid.simulation.run import KernelArrays, inputs_of, start_state
from clutchid.simulation.sensors import lag_coefficients
from clutchid.simulation.windows import Track


def prediction_errors(track: Track, actuator: Actuator, gains: FloatArray) -> FloatArray | None:
    """Standardised prediction errors of the position (n,), NaN without a measurement; None if a simulation diverges.

    Parameters
    ----------
    gains : (n, n_states + 3)
        Gain of each state and sensor output by the position's innovation, and its variance, of another pass over the
        same samples: `Filtered.gains` of the position.
    """
    segment, arrays, names = track.segment, KernelArrays.of(actuator), actuator.states
    lag, offset = actuator.value("tau_y"), actuator.value("e_y")
    x = start_state(segment, actuator)
    x = np.append(x, x[names.index("y")] - lag * x[names.index("v")])
    recorded, errors = track.measured["position"][segment.start : segment.stop], np.empty(len(segment))
    values = np.where(np.isfinite(recorded), recorded - offset, np.nan)
    model = arrays.parameters, arrays.breakpoints, arrays.load
    intervals = inputs_of(segment, arrays.model), segment.dt, segment.substeps, lag_coefficients(lag, segment.dt)
    finite = kernels_in(__name__).follow_with_gains(
        _run(arrays.model), x, names.index("y"), model, intervals, values, gains, errors
    )
    return errors / np.sqrt(gains[:, -1]) if finite else None


@cache
def _run(model: Model) -> Any:
    """The kernel ``run`` of `model`, of one type for all models."""
    from numba import types

    from clutchid.codegen.linked import Callback

    x, matrix = (types.Array(types.float64, n, "C") for n in (1, 2))
    fixed = types.Array(types.float64, 1, "C", readonly=True)
    counts, flags = (types.Array(kind, 1, "C") for kind in (types.int32, types.uint8))
    return Callback(kernels(model).run, (x, matrix, x, x, counts, flags, matrix, fixed, matrix, matrix))


@kernel
def follow_with_gains(
    run: Callable[..., int],
    x: FloatArray,
    at_position: int,
    model: tuple[FloatArray, FloatArray, FloatArray],
    intervals: tuple[FloatArray, FloatArray, NDArray[np.int32], FloatArray],
    values: FloatArray,
    gains: FloatArray,
    errors: FloatArray,
) -> bool:
    """Follow the samples of a segment; whether all states are finite.

    Parameters
    ----------
    run
        Generated function of the model variant.
    x : (n_states + 1,)
        States and the output of the position's sensor, in place.
    model
        Parameters, breakpoints and coefficients of the load.
    intervals
        Inputs, length in s, steps of integration, and coefficients of the sensor's lag.
    values, errors : (n,)
        Measurements less the offset, NaN for none, and their prediction errors.
    """
    p, breakpoints, load = model
    u, length, substeps, lags = intervals
    n = x.size - 1
    state, passed, none, measured = x[:n].copy(), np.empty((2, n)), np.zeros(2, np.uint8), np.zeros((2, 2))
    output = x[n]
    for i in range(values.size):
        if i > 0:
            before, interval = state[at_position], slice(i - 1, i)
            if run(
                state, u[i - 1 : i + 1], p, length[interval], substeps[interval], none, measured, breakpoints, load,
                passed,
            ) >= 0:  # fmt: skip
                return False
            output = lags[i - 1, 0] * output + lags[i - 1, 1] * before + lags[i - 1, 2] * state[at_position]
        errors[i] = values[i] - output
        if not math.isnan(errors[i]):
            for j in range(n):
                state[j] += gains[i, j] * errors[i]
            output += gains[i, n] * errors[i]
    return True
