"""The joint filter in C99 for a control unit: what `joint` does, in double or float, with static memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from clutchid.codegen.c99 import CSource
from clutchid.codegen.language import C_LANGUAGES
from clutchid.codegen.templates import template
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
        """Numbers in the larger of S and [L | Q]."""
        size = self.states + self.sensors
        return size * (size + max(self.parameters, self.states))

    @property
    def rows(self) -> tuple[int, ...]:
        """The first row of T in each item that changes it, with about as many entries each; last how many there are."""
        entries = list(accumulate(range(1, self.parameters + 1)))
        most = _ENTRIES * np.arange(1, 1 + -(-max([*entries, 1]) // _ENTRIES))
        return 0, *(int(np.searchsorted(entries, count, side="right")) for count in most[:-1]), self.parameters


#: Entries of T that an item of a correction changes, and parameters that one moves.
_ENTRIES, _MOVES = 110, 10


class Phase(NamedTuple):
    """Items of a correction in C that follow each other.

    `cost` are about the instructions of each on a Cortex-M4F; `numbered` says whether they have a number.
    """

    name: str
    cost: tuple[float, ...]
    sensor: int = 0
    numbered: bool = False


def phases(size: FilterSize) -> Iterator[Phase]:
    """Items of a correction in their order, with the instructions that their loops take.

    A product that is added in a loop takes about five instructions, a value in SI forty. Measured are the slices of
    samples: ``python benchmarks/export.py --costs``.
    """
    n, k, width = size.states + size.sensors, size.parameters, size.parameters + size.states + size.sensors
    moving, columns = size.of_model + size.window + size.of_sensors, n + size.states
    yield Phase("put_aside", (4.0 * n * width + 5.0 * n * n,))
    yield Phase("bring_up", (5.0 * n * width + 2.0 * width + 8.0 * moving,) * n, numbered=True)
    yield Phase("begin_noise", (5.0 * n * columns,))
    lengths = [min(n + i + 1, columns) - i for i in range(n)]
    costs = tuple((n - 1 - i) * (10.0 * length + 25.0) + 8.0 * length + 4.0 * n for i, length in enumerate(lengths))
    yield Phase("reflect", costs, numbered=True)
    if k:
        yield Phase("parameters_before", (40.0 * k,))
    entries = np.diff([i * (i + 1) / 2 for i in size.rows]) if k else np.zeros(0)
    for m in range(size.sensors):
        yield Phase("predict", (4.0 * width + 2.5 * k * (k + 1) + 15.0 * k,), m)
        yield Phase("correct_states", (n * (10.0 * n + 5.0 * k + 40.0),), m)
        if size.considered:
            yield Phase("correct_considered", (10.0 * k + 5.0 * n,), m)
        if k:
            yield Phase("turn_columns", (60.0 * k,), m)
            yield Phase("correct_root", tuple(9.0 * entries), m, numbered=True)
            yield Phase("move_parameters", (_MOVES * (100.0 + 6.0 * n),) * -(-k // _MOVES), m, numbered=True)
            yield Phase("refresh", (60.0 * k + 100.0 * size.weights,), m)
    if size.drifts:
        yield Phase("add_drift", tuple(9.0 * entries + 45.0 * np.diff(size.rows)), numbered=True)
    if k:
        yield Phase("parameters_after", (40.0 * k,))


def shares(costs: list[float], turns: int, first: float, last: float) -> list[int]:
    """Number of items that are done after each of some samples, so that the dearest sample is as cheap as it can be.

    Parameters
    ----------
    costs
        Of the items in their order.
    first, last
        What the first and the last of the samples have to do besides.
    """
    low, high = max(costs), sum(costs) + first + last

    def filled(budget: float) -> list[int]:
        item, counts = 0, []
        for turn in range(turns):
            room = budget - first * (turn == 0) - last * (turn == turns - 1)
            while item < len(costs) and costs[item] <= room:
                room -= costs[item]
                item += 1
            counts.append(item)
        return counts

    while high - low > 1.0:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if filled(middle)[-1] == len(costs) else (middle, high)
    return filled(high)


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
    """
    values = {
        "name": name,
        "size": size,
        "real": real,
        "number": C_LANGUAGES[real].print,
        "shortest_lag": SHORTEST_LAG,
        **_items(size),
    }
    return CSource(*(template(f"filter.{suffix}.j2", "clutchid.exports").render(values) for suffix in "hc"))


def _items(size: FilterSize) -> dict[str, object]:
    """The items of a correction for the templates."""
    order = list(phases(size))
    first = [0, *accumulate(len(phase.cost) for phase in order)]
    return {
        "phases": [{"first": at, **phase._asdict()} for at, phase in zip(first, order, strict=False)],
        "n_items": first[-1],
        "rows": size.rows,
        "moves": _MOVES,
    }


def correction_shares(size: FilterSize, every: int) -> list[int]:
    """Items of a correction that the observer has done after each sample since it began, with its own ones."""
    k, n = size.parameters, size.states + size.sensors
    copied = 3.0 * (k * (k + 1) / 2 + 3 * k + size.model_parameters + 4 * size.pieces)
    own = (1000.0, 2.5 * k * (k + 1) + 30.0 * k, 2.5 * k * (k + 1) + 2000.0, 1500.0)
    # the supply pressure counts while both valves are closed, which seldom is where a sample has two integration steps
    items = [cost / (1 + phase.sensor) for phase in phases(size) for cost in phase.cost]
    costs = [copied, *items, *own]
    moving = size.of_model + size.window + size.of_sensors + n
    return shares(costs, every, 6.0 * n * moving, 6.0 * n * moving)
