"""Verdict on a fit: whether its parameters and load can be trusted, with reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from clutchid.estimation.assess.bounds import bound_notes
from clutchid.estimation.assess.evidence import HORIZON, evidence
from clutchid.estimation.assess.once import once_a_fit
from clutchid.estimation.assess.reasons import reasons
from clutchid.estimation.assess.states import states_reasons
from clutchid.estimation.assess.valve_residuals import valve_notes
from clutchid.estimation.result import Fit

Trust = Literal["good", "with care", "none"]

#: What each trust means.
MEANING: Mapping[Trust, str] = {
    "good": "no reason against the results was found; use them within their intervals.",
    "with care": "the load or its interval may be wrong, for these reasons.",
    "none": "do not use these results.",
}


@dataclass(frozen=True, slots=True)
class Verdict:
    """`trust` in a fit, the `reasons` that lower it, and the limits of the verdict (`unseen`); one sentence each.

    `flawed` says that a reason takes the trust that the interval of the load does not contain. `notes` are what looks
    like a reason and is none.
    """

    trust: Trust
    reasons: tuple[str, ...]
    unseen: tuple[str, ...] = ()
    flawed: bool = False
    notes: tuple[str, ...] = ()

    @property
    def meaning(self) -> str:
        """What the trust means, in a sentence."""
        return MEANING[self.trust]


@once_a_fit
def verdict(fit: Fit) -> Verdict:
    """Whether the parameters and the load of a fit can be trusted.

    Parameters
    ----------
    fit : Fit
        Of any status and method.

    Returns
    -------
    verdict : Verdict
        'none' if the load is not determined at all, 'with care' if the load or its interval may be wrong.

    Notes
    -----
    The interval is too narrow if residuals are autocorrelated, correlate with a valve, and correspond to a
    load larger than the width of the interval. If the position follows the measurement, as in multiple shooting, this
    is tested with the pressure only. A load from position alone is judged by how far the recording departs from the
    calibration, `clutchid.estimation.assess.reading`: neither bounds nor simulated positions told its error.

    Examples
    --------
    A calibration by the paper's method with the piston at rest determines nothing:

    >>> import numpy as np
    >>> from clutchid.estimation import fit
    >>> from clutchid.log import Log
    >>> t = np.arange(0.0, 1.0, 1e-3)
    >>> still = Log(t, {name: np.zeros(1000) for name in ("position", "duty_supply", "duty_exhaust")})
    >>> verdict(fit(still)).trust
    'none'
    """
    found = (*states_reasons(fit), *reasons(fit))
    trust: Trust = "none" if any(r.grave for r in found) else "with care" if found else "good"
    flawed = any(reason.grave and not reason.banded for reason in found)
    texts = tuple(reason.text for reason in found)
    if fit.status == "failed" or not fit.recordings:
        return Verdict(trust, texts, flawed=flawed)
    notes = (*bound_notes(fit), *valve_notes(fit, evidence(fit)))
    return Verdict(trust, texts, _unseen(fit), flawed, notes)


def _unseen(fit: Fit) -> tuple[str, ...]:
    if not fit.follows:
        return ()
    steps = {"shooting": ("multiple shooting", "window", "windows")}
    how, unit, units = steps.get(fit.method, ("a fit by prediction error", "sample", "samples"))
    pressure = "the measured pressure and " if "pressure_a" in fit.scales else ""
    return (
        f"in {how} the position follows the measurement from {unit} to {unit}, so that its residual does not test the "
        f"model; the steps between {units} would. The verdict uses {pressure}the position simulated for "
        f"{HORIZON:g} s at a time.",
    )
