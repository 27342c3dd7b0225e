"""What a slow recording lacks, in the interval of a load that is read from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from clutchid.estimation.result import Fit
from clutchid.log import Log
from clutchid.names import base_of
from clutchid.numerics.interval import QUANTILE
from clutchid.recordings.signals.duty_cycle import is_slow

#: Standard deviation of a load that is read from a slow recording, as a share of it, beside that of a recording with
#: every change of the duty cycles. Provenance: `benchmarks/slow_logs.py`, docs/derivations.md, "What a slow log
#: lacks".
MISSED = 0.02


def with_slow_logs(fit: Fit, logs: Sequence[Log]) -> Fit:
    """`fit` of a load with the interval of slow recordings; as it is if all `logs` have every change of the inputs.

    Times at which valves open that are not recorded change the air that passes, and the load by a share of itself.
    """
    if not any(map(is_slow, logs)):
        return fit
    load, curve = fit.actuator.load, fit.load_curve
    weights = dict(zip(load.names, load.theta, strict=True))
    missed = MISSED * np.array([weights.get(base_of(name), 0.0) for name in fit.parameters])
    estimates = dict(fit.parameters)
    for name, by in zip(fit.parameters, np.abs(missed).tolist(), strict=True):
        e = fit.parameters[name]
        std = float(np.hypot(e.std, by))
        if by > 0.0:
            estimates[name] = replace(e, std=std, low=e.value - QUANTILE * std, high=e.value + QUANTILE * std)
    half = np.hypot(0.5 * (curve.high - curve.low), QUANTILE * MISSED * curve.force)
    return replace(
        fit,
        parameters=estimates,
        covariance=fit.covariance + np.outer(missed, missed),
        load_curve=replace(curve, low=curve.force - half, high=curve.force + half),
    )
