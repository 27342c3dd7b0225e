"""One prior for what changes in an actuator between its calibration and another recording.

Every parameter drifts a little. Beyond that the parameters of a group may change by much, and together: with the
temperature the grease, the air and the flow through the valves. A hypothesis is a set of groups that have changed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from math import exp, sqrt

import numpy as np
from scipy.optimize import brentq
from scipy.special import erfc

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.uncertainty.coordinates import SHARES, Prior

#: Standard deviations of the change of parameters in one direction: shares of their values, or in their unit where they
#: may be 0.
Direction = Mapping[str, float]

#: Groups that have changed; none of them if nothing has.
Hypothesis = tuple[str, ...]

#: Standard deviation of the drift of each parameter between two recordings of an actuator in which nothing has changed.
#: Provenance: docs/derivations.md.
DRIFT: Direction = {
    "P_S": 0.003, "D_v": 0.02, "T_0": 0.002, "T_w": 0.002, "h_A": 0.03, "C_vs": 0.002, "C_ve": 0.002, "C_r": 0.002,
    "R_0vs": 6e-4, "R_0ve": 6e-4, "R_1vs": 6e-4, "R_1ve": 6e-4, "a_0vs": 1e-3, "a_0ve": 1e-3, "t_vs": 1e-3,
    "t_ve": 1e-3, "s_vs": 1e-3, "s_ve": 1e-3, "n_vs": 1e-3, "n_ve": 1e-3, "tau_vs": 0.01, "tau_ve": 0.01, "F_C": 0.15,
    "c_F": 0.06, "V_0A": 0.05, "tau_y": 3e-5, "V_S": 0.06, "mu_h": 3e-4, "C_A0": 5e-13,
}  # fmt: skip

#: The same of parameters that are not estimated from position alone, but considered as uncertain.
DRIFT_CONSIDERED: Direction = {"A_A": 0.0003, "P_0": 0.0006, "m_ve": 0.006}

#: Directions in which the parameters of a group change, independent of each other. Provenance: docs/derivations.md.
GROUPS: Mapping[str, tuple[Direction, ...]] = {
    "supply pressure": ({"P_S": 0.05},),
    # 25 K: density and enthalpy of the air, flow with the inverse root of the temperature, grease that halves in 40 K
    "temperature and grease": (
        {
            "T_0": 0.085, "T_w": 0.085, "C_vs": -0.0425, "C_ve": -0.0425, "C_r": -0.0425, "D_v": -0.5,
        },
        {"D_v": 0.3},
    ),
    "valves": (
        {"C_vs": 0.07, "C_ve": 0.07}, {"C_vs": 0.02}, {"C_ve": 0.02}, {"R_0vs": 0.015}, {"R_0ve": 0.015},
        {"R_1vs": 0.02}, {"R_1ve": 0.02}, {"a_0vs": 0.02}, {"a_0ve": 0.02}, {"t_vs": 0.02}, {"t_ve": 0.02},
        {"s_vs": 0.02}, {"s_ve": 0.02}, {"tau_vs": 0.2}, {"tau_ve": 0.2}, {"tau_y": 3e-4},
    ),
    "leak": ({"C_A0": 1e-10},),
}  # fmt: skip

#: All hypotheses: nothing, one group, or two.
HYPOTHESES: tuple[Hypothesis, ...] = tuple(h for size in (0, 1, 2) for h in combinations(GROUPS, size))

#: Logarithm of the prior odds of a change of each group, and what two changes at once have in addition.
LOG_ODDS: Mapping[str, float] = {"supply pressure": -1.0, "temperature and grease": -2.0, "valves": -2.0, "leak": -3.0}
LOG_ODDS_TOGETHER = -2.0


def log_odds(hypothesis: Hypothesis) -> float:
    """Logarithm of the prior odds of a hypothesis against that of no change."""
    return sum(LOG_ODDS[group] for group in hypothesis) + LOG_ODDS_TOGETHER * max(0, len(hypothesis) - 1)


def prior_probability() -> dict[str, float]:
    """Probability that each group has changed, before a recording is read."""
    odds = {hypothesis: exp(log_odds(hypothesis)) for hypothesis in HYPOTHESES}
    return {group: sum(o for h, o in odds.items() if group in h) / sum(odds.values()) for group in GROUPS}


def assumed_change(name: str) -> float:
    """Half width of the 95 % interval of the change of a parameter before a recording is read, as a share of its value.

    That of the mixture over all hypotheses, whose weights are the prior odds.

    Examples
    --------
    >>> f"{100 * assumed_change('P_S'):.1f} %"
    '6.1 %'
    """
    weights = np.exp([log_odds(hypothesis) for hypothesis in HYPOTHESES])
    variances = [
        DRIFT[name] ** 2 + sum(each.get(name, 0.0) ** 2 for group in hypothesis for each in GROUPS[group])
        for hypothesis in HYPOTHESES
    ]
    stds = np.sqrt(variances)

    def beyond(half: float) -> float:
        return float(weights @ erfc(half / (sqrt(2.0) * stds)) / weights.sum()) - 0.05

    return float(brentq(beyond, 0.0, 10.0 * stds.max()))


def drift(actuator: Actuator, name: str) -> float:
    """Standard deviation in SI of the drift of a parameter between two recordings of one actuator."""
    own = actuator.own_row(name)
    if own is not None:
        return own.drift
    return {**DRIFT, **DRIFT_CONSIDERED}.get(name, 0.0) * _size(actuator, name)


def changeable(actuator: Actuator) -> tuple[str, ...]:
    """Parameters that may change between recordings of `actuator` and act on them."""
    acting = {*actuator.in_equations, "tau_y"} - _idle_valve_parameters(actuator)
    own = [name for name in actuator.parameter_names if (row := actuator.own_row(name)) and row.drift > 0.0]
    return tuple(n for n in (*DRIFT, *own) if n in acting and (n not in SHARES or actuator.value(n) > 0.0))


def _idle_valve_parameters(actuator: Actuator) -> set[str]:
    """Parameters of switched valves where those are averaged, and the reverse; a travel of 0 has no derivative."""
    switched = {f"{letter}_{valve}" for letter in ("s", "t") for valve in ("vs", "ve")} | {"a_0vs", "a_0ve"}
    if actuator.parameters.T_pwm == 0.0:
        return switched
    return {"n_vs", "n_ve"} | {name for name in ("t_vs", "t_ve") if actuator.value(name) == 0.0}


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
    sizes = np.array([_size(actuator, name) for name in names])
    covariance = np.diag([drift(actuator, name) ** 2 for name in names])
    for direction in (each for group in hypothesis for each in GROUPS[group]):
        by = np.array([direction.get(name, 0.0) for name in names]) * sizes
        covariance += np.outer(by, by)
    return covariance


def change_priors(actuator: Actuator) -> dict[str, Prior]:
    """Prior of each changeable parameter alone, if all groups may have changed."""
    names = changeable(actuator)
    widest = np.sqrt(np.diag(change_covariance(actuator, names, tuple(GROUPS))))
    return {name: Prior(actuator.value(name), std) for name, std in zip(names, widest.tolist(), strict=True)}


def _size(actuator: Actuator, name: str) -> float:
    """What a share of a parameter is of: its value, or 1 where it may be 0."""
    return abs(actuator.value(name)) if name in SHARES else 1.0
