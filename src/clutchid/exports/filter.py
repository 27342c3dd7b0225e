"""The joint filter in C99 for a control unit: what `joint` does, in double or float, with static memory."""

from __future__ import annotations

from dataclasses import dataclass

from clutchid.codegen.c99 import CSource
from clutchid.codegen.language import C_DOUBLE, C_FLOAT
from clutchid.codegen.templates import template
from clutchid.inference.filter.transition import AHEAD, MARGIN
from clutchid.simulation.comparison import SHORTEST_LAG


@dataclass(frozen=True, slots=True)
class FilterSize:
    """Dimensions of a joint filter.

    Parameters
    ----------
    states, sensors
        States of the model, and measured columns, at least 1.
    parameters, of_model, of_sensors
        Free parameters k, and how many of them are the model's and the sensors'; the rest are load weights.
    drifts
        Columns of the root (k, d) of what theta gains in a stroke.
    model_parameters
        Parameters of the model, free or not.
    weights, pieces, window
        Weights of the load, free or not; pieces of its table; weights whose columns move at a time.
    considered
        Parameters that are considered, 0 or 1.
    """

    states: int
    sensors: int
    parameters: int
    of_model: int
    of_sensors: int
    drifts: int
    model_parameters: int
    weights: int
    pieces: int
    window: int
    considered: int = 0

    @property
    def free_weights(self) -> int:
        """Load weights among the free parameters."""
        return self.parameters - self.of_model - self.of_sensors

    @property
    def room(self) -> int:
        """Numbers in the largest of S and the matrices that are made triangular."""
        size, k = self.states + self.sensors, self.parameters
        return max(size * (size + k), size * (size + self.states), k * (k + self.drifts))


def filter_c99(size: FilterSize, real: str = "double", name: str = "joint") -> CSource:
    """The joint filter in C99, ``NAME.h`` and ``NAME.c``: the model's ``step_columns`` moves x, Gamma and Phi.

    Compiled without contraction of sums and products (``-ffp-contract=off``), double has bit by bit the numbers of the
    kernels in `joint` where they are computed in the order in which they are written. The compiled kernels may reorder
    sums and contract, which is faster; C differs from them by these roundings.

    Parameters
    ----------
    real : 'double' or 'float'
        Type of every number.
    name
        Before every name in C, a C identifier.

    Raises
    ------
    ValueError
        If `real` is neither "double" nor "float".
    """
    languages = {"double": C_DOUBLE, "float": C_FLOAT}
    if real not in languages:
        raise ValueError(f"real = {real!r}: known are {', '.join(languages)}.")
    values = {
        "name": name,
        "size": size,
        "real": real,
        "number": languages[real].print,
        "shortest_lag": SHORTEST_LAG,
        "margin": MARGIN,
        "ahead": AHEAD,
    }
    return CSource(*(template(f"filter.{suffix}.j2", "clutchid.exports").render(values) for suffix in "hc"))
