"""Standard deviations of measurement noise and process noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from clutchid.log import FloatArray
from clutchid.log.measured import MEASURED
from clutchid.log.states import STATES

#: Limits of a re-estimated noise scale, as multiples of the usual one: a sensor may be better than usual, but the model
#: error within a window is not.
MIN_SCALE, MAX_SCALE = 1.0, 10.0

_STATE_NOISE: Mapping[str, float] = MappingProxyType({name: state.noise for name, state in STATES.items()})


def noise_scale(errors: FloatArray, usual: float, state_variance: float = 0.0) -> float:
    """Noise scale of a sensor: standard deviation from the median absolute error, within limits of the `usual` one.

    `state_variance` is the part of the variance of the `errors` that the uncertainty of the states makes.
    """
    size = np.abs(errors[np.isfinite(errors)])
    square = (1.4826 * float(np.median(size))) ** 2 - state_variance if size.size else 0.0
    return float(np.clip(np.sqrt(max(0.0, square)), MIN_SCALE * usual, MAX_SCALE * usual))


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of the samples of each measured column, of the states, and of the flow of air.

    `flow` is the relative error of the flow through an open valve, random in each window; `outlier` the number of
    standard deviations beyond which the loss is linear. `memory` is the correlation time of the model error in s:
    samples within it have the information of one.
    """

    measured: Mapping[str, float] = field(
        default_factory=lambda: {name: sensor.noise for name, sensor in MEASURED.items()}
    )
    states: Mapping[str, float] = field(default_factory=lambda: _STATE_NOISE)
    flow: float = 0.02
    outlier: float = 4.0
    memory: float = 0.0

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
