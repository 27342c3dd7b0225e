"""One prior for what changes in an actuator between its calibration and another recording.

Every parameter drifts a little. Beyond that the parameters of a group may change by much, and together: with the
temperature the grease, the air and the flow through the valves. A hypothesis is a set of groups that have changed.
Drift and changes stand in the row of each parameter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, combinations
from math import erfc, exp, sqrt

import numpy as np

from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.parameters import GROUPS, Parameters, Row, in_order

#: Standard deviations of the change of parameters in one direction: shares of their values, or in their unit where they
#: may be 0.
ChangeDirection = Mapping[str, float]

#: Groups that have changed; none of them if nothing has.
Hypothesis = tuple[str, ...]

#: The group that is a fault and stays until it is mended.
FAULT = "leak"

#: All hypotheses: up to three groups at once. Without supply, temperature and valves together a warm truck with a lower
#: supply, whose valves then open later, was read 5 % wrong: benchmarks/results/intervals.md, "Three changes".
HYPOTHESES: tuple[Hypothesis, ...] = tuple(h for size in range(4) for h in combinations(GROUPS, size))

#: Logarithm of the prior odds that each further change at once has in addition to its own.
LOG_ODDS_TOGETHER = -2.0


def log_odds(hypothesis: Hypothesis) -> float:
    """Logarithm of the prior odds of a hypothesis against that of no change."""
    return sum(GROUPS[group] for group in hypothesis) + LOG_ODDS_TOGETHER * max(0, len(hypothesis) - 1)


def prior_probability() -> dict[str, float]:
    """Probability that each group has changed, before a recording is read."""
    odds = {hypothesis: exp(log_odds(hypothesis)) for hypothesis in HYPOTHESES}
    return {group: sum(o for h, o in odds.items() if group in h) / sum(odds.values()) for group in GROUPS}


def directions(rows: Mapping[str, Row], group: str) -> tuple[ChangeDirection, ...]:
    """Directions in which the parameters of a group change, independent of each other: joint ones first."""
    joint: dict[str, dict[str, float]] = {}
    alone: list[ChangeDirection] = []
    for name, row in rows.items():
        for change in row.changes:
            if change.group == group and change.along:
                joint.setdefault(change.along, {})[name] = change.std
            elif change.group == group:
                alone.append({name: change.std})
    return (*joint.values(), *alone)


def assumed_change(name: str) -> float:
    """Half width of the 95 % interval of the change of a parameter before a recording is read, as a share of its value.

    That of the mixture over all hypotheses, whose weights are the prior odds.

    Examples
    --------
    >>> f"{100 * assumed_change('P_S'):.1f} %"
    '6.1 %'
    """
    weights = np.exp([log_odds(hypothesis) for hypothesis in HYPOTHESES])
    row = Parameters.row(name)
    by_drift = row.drift.std if row.drift else 0.0
    variances = [
        by_drift**2 + sum(change.std**2 for group in hypothesis for change in row.changes if change.group == group)
        for hypothesis in HYPOTHESES
    ]
    stds = np.sqrt(variances)

    low, high = 0.0, 10.0 * float(stds.max())
    for _ in range(60):  # bisection and erfc of Python: a process that reads a file need not import SciPy
        half = (low + high) / 2
        beyond = float(weights @ [erfc(ratio) for ratio in half / (sqrt(2.0) * stds)] / weights.sum())
        low, high = (half, high) if beyond > 0.05 else (low, half)
    return high


def drift(actuator: Actuator, name: str) -> float:
    """Standard deviation in SI of the drift of a parameter between two recordings of one actuator."""
    row = actuator.rows.get(name)
    return row.drift.std * row.size(actuator.value(name)) if row and row.drift else 0.0


def changeable(actuator: Actuator) -> tuple[str, ...]:
    """Parameters that may change between recordings of `actuator` and act on them."""
    rows, acting = actuator.rows, actuator.acting
    drifting = in_order(rows, lambda row: None if row.drift and row.drift.considered else row.drift)
    return tuple(
        name
        for name in drifting
        if name in acting and (actuator.value(name) > 0.0 or not (rows[name].in_shares or rows[name].off_at_0))
    )


def change_covariance(actuator: Actuator, names: Sequence[str], hypothesis: Hypothesis) -> FloatArray:
    """Covariance of the change of parameters since the calibration, shape (k, k), in SI.

    Parameters
    ----------
    actuator : Actuator
        As calibrated.
    names : k names
        As by `changeable`.
    hypothesis : groups
        That have changed.
    """
    rows = actuator.rows
    sizes = np.array([rows[name].size(actuator.value(name)) for name in names])
    covariance = np.diag([drift(actuator, name) ** 2 for name in names])
    for direction in chain.from_iterable(directions(rows, group) for group in hypothesis):
        by = np.array([direction.get(name, 0.0) for name in names]) * sizes
        covariance += np.outer(by, by)
    return covariance


def change_priors(actuator: Actuator) -> dict[str, Prior]:
    """Prior of each changeable parameter alone, if all groups may have changed."""
    names = changeable(actuator)
    widest = np.sqrt(np.diag(change_covariance(actuator, names, tuple(GROUPS))))
    return {name: Prior(actuator.value(name), std) for name, std in zip(names, widest.tolist(), strict=True)}
