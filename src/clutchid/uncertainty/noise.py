"""How far measurements and the model itself are trusted."""

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
    """Standard deviations: of the samples of each measured column, of the model's states, and of the air that flows.

    `flow` is the part of the air through an open valve that the model misjudges at random in each window; `outlier` is
    the number of standard deviations beyond which a residual counts linearly only. Residuals of the model last for
    `memory` s: samples that are nearer to each other tell as much as one.
    """

    measured: Mapping[str, float] = field(
        default_factory=lambda: {name: sensor.noise for name, sensor in MEASURED.items()}
    )
    states: Mapping[str, float] = field(default_factory=lambda: _STATE_NOISE)
    flow: float = 0.02
    outlier: float = 4.0
    memory: float = 0.0

    def of_samples(self, name: str, spacing: float) -> float:
        """Standard deviation that each sample of a measured column is given where they are `spacing` s apart."""
        return self.measured[name] * math.sqrt(max(1.0, self.memory / spacing))

    def softened(self, factor: float) -> Noise:
        """Everything `factor` times less certain: a problem nearer to a linear one."""
        return replace(
            self,
            measured={name: value * factor for name, value in self.measured.items()},
            states={name: value * factor for name, value in self.states.items()},
            flow=self.flow * factor,
        )
