"""Standard deviations of measurement noise and process noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from clutchid.measured import MEASURED
from clutchid.states import STATES

_STATE_NOISE: Mapping[str, float] = MappingProxyType({name: state.noise for name, state in STATES.items()})


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
