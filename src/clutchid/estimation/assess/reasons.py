"""Reasons against a fit: what speaks against its parameters or its load."""

from __future__ import annotations

import numpy as np

from clutchid.estimation.assess.bounds import bound_reasons
from clutchid.estimation.assess.engaging import ENGAGING
from clutchid.estimation.assess.evidence import HORIZON, Evidence, evidence, information, reach
from clutchid.estimation.assess.once import once_a_fit
from clutchid.estimation.assess.reading import reading_reasons
from clutchid.estimation.assess.reason import Reason
from clutchid.estimation.assess.rest import rest_reasons
from clutchid.estimation.assess.slow import slow_reasons
from clutchid.estimation.assess.valve_residuals import valve_reasons
from clutchid.estimation.result import Fit
from clutchid.inference.uncertainty.identifiability import collinear, listed
from clutchid.inference.uncertainty.information import spectrum

#: Fits in %: below the first a tenth of the motion is not reproduced, below the second half of it.
GOOD_FIT, POOR_FIT = 90.0, 50.0

#: The interval of a load is wide if its half width exceeds this fraction of the peak, over more than `WIDE_SHARE` of
#: the reach: near the end of the reach it always does.
WIDE, WIDE_SHARE = 0.1, 0.1


@once_a_fit
def reasons(fit: Fit) -> tuple[Reason, ...]:
    """What speaks against a fit, its readings of single recordings apart; a failed one has that reason alone."""
    if fit.status == "failed" or not fit.recordings:
        return (Reason(f"the fit failed: {fit.message}".rstrip(".") + ".", True),)
    found = evidence(fit)
    reads = fit.departure is not None
    return (
        *slow_reasons(fit), *reading_reasons(fit), *rest_reasons(fit), *_not_converged(fit),
        *_poor_baseline(fit), *bound_reasons(fit), *_rounding(fit), *_undetermined(fit), *_combinations(fit),
        *([] if reads else [*_motion_fit(found), *valve_reasons(fit, found)]), *_wide_interval(fit), *_reach(fit),
    )  # fmt: skip


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
