"""The gains of the adaptive observer, and how large they may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.errors import ParameterError
from clutchid.filter.joint_setup import Rule
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.uncertainty.coordinates import Coordinate

#: Time constant in s of the average position: the piston moves if its position is further from it than an outlier from
#: what is predicted. Provenance: docs/derivations_online.md.
AVERAGE = 0.1


@dataclass(frozen=True, slots=True)
class AdaptiveGains:
    """Gains of the adaptive observer as shares of an error that a sample takes away, each at least 0.

    Parameters
    ----------
    velocity
        Of an error of the velocity, beside what the friction takes; at most 1.
    pressure
        Of an error of the force in steady motion, if it is the pressure's, with the piston at 0.
    load
        The same, if it is the load's, where its prior is widest. `pressure` and `load` are less than 2 together.
    """

    velocity: float = 0.2
    pressure: float = 0.1
    load: float = 0.05

    def __post_init__(self) -> None:
        values = (self.velocity, self.pressure, self.load)
        if not (all(0.0 <= value < np.inf for value in values) and self.velocity <= 1.0 and sum(values[1:]) < 2.0):
            raise ParameterError(
                f"gains {self.velocity:g} (velocity), {self.pressure:g} (pressure) and {self.load:g} (load) of the "
                "adaptive observer would be unstable: none is below 0, that of the velocity is at most 1, and those of "
                "pressure and load are less than 2 together; 0.2, 0.1 and 0.05 are the default."
            )


def adaptive_rule(
    actuator: Actuator, coordinates: Sequence[Coordinate], root: FloatArray, spacing: float, gains: AdaptiveGains
) -> Rule:
    """The rule of the adaptive observer for load weights with the prior covariance root root'.

    Parameters
    ----------
    spacing : s
        Time from one sample to the next.
    """
    p, load = actuator.parameters, actuator.load
    functions = load.phi(np.linspace(0.0, p.y_max, 200))
    by_coordinate = np.array([functions[:, load.names.index(c.base)] * c.slope(0.0) for c in coordinates]).T
    variance = np.sum((by_coordinate @ root) ** 2, axis=1).max()
    velocity = gains.velocity / spacing
    damping = (p.D_v + p.M * velocity) / spacing
    rows, names = actuator.states, actuator.parameter_names
    numbers = (
        velocity,
        gains.pressure * damping * (p.V_0A / p.A_A) ** 2,
        gains.load * damping / float(variance),
        min(1.0, spacing / AVERAGE),
        (rows.index("p_A"), names.index("V_0A"), names.index("A_A")),
    )
    return Rule("clutchid.filter.adaptive", "follow_adaptively", columns=False, memory=2, numbers=(numbers,))
