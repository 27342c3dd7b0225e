"""Verdict on a fit: whether its parameters and load can be trusted, with reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from clutchid.assess.bounds import bound_notes, bound_reasons
from clutchid.assess.engaging import ENGAGING
from clutchid.assess.evidence import HORIZON, Evidence, evidence, information, reach
from clutchid.assess.reading import reading_reasons
from clutchid.assess.reason import Reason
from clutchid.assess.rest import rest_reasons
from clutchid.assess.slow import slow_reasons
from clutchid.assess.states import states_reasons
from clutchid.assess.valve_residuals import valve_notes, valve_reasons
from clutchid.estimation.result import Fit
from clutchid.uncertainty.identifiability import collinear, listed
from clutchid.uncertainty.information import spectrum

Trust = Literal["good", "with care", "none"]

#: Fits in %: below the first a tenth of the motion is not reproduced, below the second half of it.
GOOD_FIT, POOR_FIT = 90.0, 50.0

#: The interval of a load is wide if its half width exceeds this fraction of the peak, over more than `WIDE_SHARE` of
#: the reach: near the end of the reach it always does.
WIDE, WIDE_SHARE = 0.1, 0.1


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


def verdict(fit: Fit, found: Evidence | None = None) -> Verdict:
    """Whether the parameters and the load of a fit can be trusted.

    Parameters
    ----------
    fit : Fit
        Of any status and method.
    found : Evidence, optional
        ``evidence(fit)``, if it has been computed.

    Returns
    -------
    verdict : Verdict
        'none' if the load is not determined at all, 'with care' if the load or its interval may be wrong.

    Notes
    -----
    The interval is too narrow if residuals are autocorrelated, correlate with a valve, and correspond to a
    load larger than the width of the interval. If the position follows the measurement, as in multiple shooting, this
    is tested with the pressure only. A load from position alone is judged by how far the recording departs from the
    calibration, `clutchid.assess.reading`: neither bounds nor simulated positions told its error.

    Examples
    --------
    A calibration by the paper's method with the piston at rest determines nothing:

    >>> from clutchid.estimation import fit
    >>> from clutchid.log import Log
    >>> t = np.arange(0.0, 1.0, 1e-3)
    >>> still = Log(t, {name: np.zeros(1000) for name in ("position", "duty_supply", "duty_exhaust")})
    >>> verdict(fit(still)).trust
    'none'
    """
    if fit.status == "failed" or not fit.recordings:
        return Verdict("none", (f"the fit failed: {fit.message}".rstrip(".") + ".",), flawed=True)
    found = evidence(fit) if found is None else found
    reads = fit.departure is not None
    reasons = [
        *states_reasons(fit), *slow_reasons(fit), *reading_reasons(fit), *rest_reasons(fit), *_not_converged(fit),
        *_poor_baseline(fit), *bound_reasons(fit), *_rounding(fit), *_undetermined(fit), *_combinations(fit),
        *([] if reads else [*_motion_fit(found), *valve_reasons(fit, found)]), *_wide_interval(fit), *_reach(fit),
    ]  # fmt: skip
    trust: Trust = "none" if any(r.grave for r in reasons) else "with care" if reasons else "good"
    flawed = any(reason.grave and not reason.banded for reason in reasons)
    notes = (*bound_notes(fit), *valve_notes(fit, found))
    return Verdict(trust, tuple(reason.text for reason in reasons), _unseen(fit), flawed, notes)


def _not_converged(fit: Fit) -> list[Reason]:
    return (
        []
        if fit.converged
        else [Reason("the search did not converge; continue from its result, or free fewer parameters.")]
    )


def _poor_baseline(fit: Fit) -> list[Reason]:
    """A calibration that did not converge, or that is not to be trusted."""
    known = fit.baseline
    if known is None:
        return []
    name = known.origin.name if known.origin and known.origin.name else "of this fit"
    reasons = []
    if known.origin and known.origin.trust == "none":
        reasons.append(Reason(f"the calibration {name} has trust 'none'; calibrate again.", True))
    if not known.converged:
        text = (
            f"the search of the calibration {name} had not converged, and the load may have errors that its interval "
            "does not include; continue the calibration, then read again."
        )
        reasons.append(Reason(text))
    return reasons


def _rounding(fit: Fit) -> list[Reason]:
    """Directions in which the Jacobian is singular to rounding, so that the covariance is meaningless."""
    known = [i for i, v in enumerate(np.diag(fit.covariance)) if 0.0 < v < np.inf]
    if len(known) < 2:
        return []
    _, values, vectors = spectrum(fit.covariance[np.ix_(known, known)])
    if values[0] > len(known) * np.finfo(float).eps * values[-1]:
        return []
    names = [list(fit.parameters)[i] for i in known]
    mixed = [name for name, part in zip(names, np.abs(vectors[:, -1]), strict=True) if part > 0.1]
    return [
        Reason(
            f"the Jacobian is numerically singular in the direction of {listed(mixed)}: their intervals are "
            "meaningless; fix one of them.",
            any(name in fit.actuator.load.names for name in mixed),
        )
    ]


def _undetermined(fit: Fit) -> list[Reason]:
    """Estimates with a standard error as large as the value; with priors, the notes report them."""
    if fit.follows:
        return []
    undetermined = []
    for name, estimate in fit.parameters.items():
        if name in fit.actuator.parameter_names:
            size = max(abs(estimate.value), abs(fit.actuator.default(name)))
            undetermined += [name] if size > 0.0 and estimate.std >= size else []
    if not undetermined:
        return []
    what = "the standard error of {} is" if len(undetermined) == 1 else "the standard errors of {} are"
    return [Reason(f"{what.format(listed(undetermined))} as large as the value: the data do not determine it; fix it.")]


def _combinations(fit: Fit) -> list[Reason]:
    """Three or more estimates of which only combinations are determined, without priors."""
    found = None if fit.follows else information(fit)
    if found is None:
        return []
    group = [found.known[i] for i in collinear(found.columns(found.known))]
    if len(group) < 3:
        return []
    text = f"of {len(group)} parameters, {group[0]} to {group[-1]}, only combinations can be determined: "
    return [Reason(f"{text}fix some, or calibrate with pressure and start from that.")]


def _motion_fit(found: Evidence) -> list[Reason]:
    return [
        Reason(
            f"{name}: simulated for {HORIZON:g} s at a time, the position fits to {share:.1f} %, less than "
            f"{GOOD_FIT:.0f} %: the model does not reproduce part of the motion, and the load may have similar errors.",
            share < POOR_FIT,
        )
        for name, share in found.predictions.items()
        if share < GOOD_FIT
    ]


def _wide_interval(fit: Fit) -> list[Reason]:
    """An infinite interval of the load, or one that is wide relative to the peak."""
    curve, furthest = fit.load_curve, reach(fit)
    inside = curve.position <= furthest
    half = ((curve.high - curve.low) / 2)[inside]
    known, peak = np.isfinite(half), float(curve.force[curve.peak(furthest)])
    if not fit.load_is_fitted:
        return []
    if not known.any() or peak <= 0.0:
        return [Reason("the data do not determine the load: its interval is infinite.", True)]
    broad = ~(half <= WIDE * peak)
    if known.all() and np.mean(broad) <= WIDE_SHARE:
        return []
    at = curve.position[inside][broad] * 1e3
    widest = f"up to ± {100 * np.max(half) / peak:.0f} % of the peak" if known.all() else "infinite in part"
    return [
        Reason(
            f"the interval of the load is {widest} between {at[0]:.1f} and {at[-1]:.1f} mm, wider than the limit of ± "
            f"{100 * WIDE:.0f} %; record longer, or with more strokes.",
            bool(np.median(half) > peak),
            banded=bool(known.all()),
        )
    ]


def _reach(fit: Fit) -> list[Reason]:
    furthest, (begin, end) = reach(fit), ENGAGING
    if furthest >= end:
        return []
    return [
        Reason(
            f"the recordings reach {furthest * 1e3:.1f} mm; the clutch engages at {begin * 1e3:.0f} to {end * 1e3:.0f} "
            f"mm, so that the load there is not determined: reach {end * 1e3:.0f} mm or more.",
            furthest < begin,
        )
    ]


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
