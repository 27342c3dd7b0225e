"""How far measurements and the model itself are trusted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

#: Random error of the model's state over `SPAN`, in SI: what stick-slip, ripple and heat leave unexplained.
STATE_NOISE: Mapping[str, float] = MappingProxyType({
    "y": 2e-6, "v": 2e-3, "p_A": 300.0, "p_B": 200.0, "z": 5e-6, "T_A": 0.5, "T_B": 0.5, "p_S": 1500.0, "p_G": 2000.0,
    "z_h": 5e-6,
})  # fmt: skip
SPAN = 0.1

#: Uncertainty of the state at the start of a recording that rests and is vented, and of one that does not.
START: Mapping[str, float] = MappingProxyType({
    "y": 5e-5, "v": 1e-3, "p_A": 500.0, "p_B": 500.0, "z": 1e-4, "T_A": 3.0, "T_B": 3.0, "p_S": 2e4, "p_G": 2e4,
    "z_h": 1e-4,
})  # fmt: skip
UNKNOWN_START: Mapping[str, float] = MappingProxyType({**START, "y": 1e-3, "v": 0.05, "p_A": 1e5, "z": 3e-4})


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations: of the samples of each measured column, of the model's states, and of the air that flows.

    `flow` is the part of the air through an open valve that the model misjudges at random in each window; `outlier` is
    the number of standard deviations beyond which a residual counts linearly only. Residuals of the model last for
    `memory` s: samples that are nearer to each other tell as much as one.
    """

    measured: Mapping[str, float] = field(default_factory=lambda: {"position": 5e-5, "pressure_a": 3e3})
    states: Mapping[str, float] = field(default_factory=lambda: STATE_NOISE)
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
