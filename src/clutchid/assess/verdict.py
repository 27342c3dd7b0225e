"""Whether the numbers of a fit can be trusted, and why; from the result alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from clutchid.assess.diagnostics import BEYOND, MOST_OUTSIDE, ColumnDiagnosis, remarks
from clutchid.assess.evidence import HORIZON, Evidence, evidence, information, reach, spectrum
from clutchid.estimate.result import Fit
from clutchid.parameters import Parameters
from clutchid.signals.residual_colour import CrossCorrelation
from clutchid.uncertainty.identifiability import collinear, listed

Trust = Literal["good", "with care", "none"]

#: Where the clutch engages and the load must be known best, in m, Section 3.1.
ENGAGING = (5e-3, 8e-3)

#: A simulation that fits to less than this, in %, misses a tenth of the motion; below the second it misses half.
FITS, FITS_HALF = 90.0, 50.0

#: A load band is broad when it is wider, up or down, than this part of the peak, over more than `BROAD_SHARE` of the
#: reach: at the very end of it there is always little to tell.
BROAD, BROAD_SHARE = 0.1, 0.1


@dataclass(frozen=True, slots=True)
class Verdict:
    """`trust` in a fit, the `reasons` that lower it, and what it cannot see; one sentence each."""

    trust: Trust
    reasons: tuple[str, ...]
    unseen: tuple[str, ...] = ()


class _Reason(NamedTuple):
    text: str
    grave: bool = False


def verdict(fit: Fit, found: Evidence | None = None) -> Verdict:
    """Whether the numbers of a fit can be trusted.

    Parameters
    ----------
    fit : Fit
        Of any status and method.
    found : Evidence, optional
        ``evidence(fit)``, where it is at hand.

    Returns
    -------
    verdict : Verdict
        'none' where the load is not known at all, 'with care' where there is a reason to doubt it or its band.

    Notes
    -----
    Residuals are more than the band counts when they are coloured, move with a valve, and would make a load that is
    larger than the band is wide. Where the position follows the measurement, as by shooting, only the pressure is
    judged so.

    Examples
    --------
    A calibration by the paper's method with the piston at rest tells nothing:

    >>> from clutchid.estimate import fit
    >>> from clutchid.log import Log
    >>> t = np.arange(0.0, 1.0, 1e-3)
    >>> still = Log(t, {name: np.zeros(1000) for name in ("position", "duty_supply", "duty_exhaust")})
    >>> verdict(fit(still)).trust
    'none'
    """
    if fit.status == "failed" or not fit.recordings:
        return Verdict("none", (f"the fit failed: {fit.message}".rstrip(".") + ".",))
    found = evidence(fit) if found is None else found
    reasons = [
        *_unsettled(fit), *_at_bounds(fit), *_rounding(fit), *_wide(fit), *_entangled(fit), *_motion(found),
        *_beyond_the_band(fit, found), *_band(fit), *_reach(fit),
    ]  # fmt: skip
    trust: Trust = "none" if any(r.grave for r in reasons) else "with care" if reasons else "good"
    return Verdict(trust, tuple(reason.text for reason in reasons), _unseen(fit))


def verdict_json(fit: Fit, found: Evidence | None = None) -> dict[str, Any]:
    """The verdict on a fit and what it rests on, as plain values; what is not finite is None.

    Parameters
    ----------
    fit : Fit
        Of any status and method.
    found : Evidence, optional
        ``evidence(fit)``, where it is at hand.
    """
    found = evidence(fit) if found is None else found
    judged = verdict(fit, found)
    return {
        "trust": judged.trust,
        "reasons": list(judged.reasons),
        "unseen": list(judged.unseen),
        "diagnostics": {
            name: {
                "position_fit_over_1_s_percent": _plain(found.predictions[name]),
                **{column: _column_json(values) for column, values in diagnosis.columns.items()},
                "remarks": remarks(diagnosis),
            }
            for name, diagnosis in found.diagnoses.items()
        },
        "missing": list(found.missing),
    }


def _column_json(column: ColumnDiagnosis) -> dict[str, Any]:
    lags = max((column.fast, column.slow), key=lambda rate: np.nan_to_num(rate.share_outside))
    return {
        "samples": column.samples,
        "fit_percent": _plain(column.fit_percent),
        "rms": _plain(column.rms),
        "mean": _plain(column.mean),
        "effective_samples": _plain(column.effective_samples),
        "share_of_lags_outside": _plain(lags.share_outside),
        "inputs": {name: _strongest_json(rate) for name, rate in column.fast.inputs.items()},
    }


def _strongest_json(found: CrossCorrelation) -> dict[str, float | None]:
    values = {"lag_s": found.strongest_lag, "correlation": found.strongest, "bound": found.strongest_bound}
    return {name: _plain(value) for name, value in values.items()}


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _unsettled(fit: Fit) -> list[_Reason]:
    return [] if fit.settled else [_Reason("the search did not settle; go on from its result, or free less.")]


def _at_bounds(fit: Fit) -> list[_Reason]:
    """Bounds that the data pushed an estimate to."""
    held = []
    for name, estimate in fit.parameters.items():
        ends = zip(("lower", "upper"), fit.bounds.get(name, ()), strict=False)
        finite = [(word, bound) for word, bound in ends if np.isfinite(bound)]
        held += [f"{name} ({word})" for word, bound in finite if abs(estimate.value - bound) <= 1e-9 * abs(bound)]
    if not held:
        return []
    lies, their = ("lies", "its bound") if len(held) == 1 else ("lie", "their bounds")
    return [
        _Reason(f"{listed(held)} {lies} at {their}: the data ask for more than that, or the model lacks something.")
    ]


def _rounding(fit: Fit) -> list[_Reason]:
    """Directions of the Jacobian below its rounding: the covariance there is noise."""
    known = [i for i, v in enumerate(np.diag(fit.covariance)) if 0.0 < v < np.inf]
    if len(known) < 2:
        return []
    _, values, vectors = spectrum(fit.covariance[np.ix_(known, known)])
    if values[0] > len(known) * np.finfo(float).eps * values[-1]:
        return []
    names = [list(fit.parameters)[i] for i in known]
    mixed = [name for name, part in zip(names, np.abs(vectors[:, -1]), strict=True) if part > 0.1]
    return [
        _Reason(
            f"the Jacobian is at its rounding in the direction of {listed(mixed)}: their intervals are noise; fix one "
            "of them.",
            any(name in fit.actuator.load.names for name in mixed),
        )
    ]


def _wide(fit: Fit) -> list[_Reason]:
    """Estimates whose standard error is as large as they are; where priors stand there, the notes say it."""
    if fit.follows:
        return []
    wide = []
    for name, estimate in fit.parameters.items():
        if name in Parameters.names():
            size = max(abs(estimate.value), abs(getattr(Parameters(), name)))
            wide += [name] if size > 0.0 and estimate.std >= size else []
    if not wide:
        return []
    what = "the standard error of {} is" if len(wide) == 1 else "the standard errors of {} are"
    return [_Reason(f"{what.format(listed(wide))} as large as the value: the recordings do not tell it; fix it.")]


def _entangled(fit: Fit) -> list[_Reason]:
    """Three or more estimates of which only combinations are told, where no prior holds them."""
    R = None if fit.follows else information(fit)
    if R is None:
        return []
    known = np.flatnonzero(np.any(R != 0.0, axis=0))
    names = [name for name in fit.parameters if "@" not in name]
    group = [names[known[i]] for i in collinear(R[:, known])]
    if len(group) < 3:
        return []
    text = f"of {len(group)} numbers, {group[0]} to {group[-1]}, only combinations are told: "
    return [_Reason(f"{text}fix some, or calibrate with pressure and start from that.")]


def _motion(found: Evidence) -> list[_Reason]:
    return [
        _Reason(
            f"{name}: simulated for {HORIZON:g} s at a time the position fits to {share:.1f} %, less than {FITS:.0f} "
            "%: the model misses part of the motion, so the load may miss as much.",
            share < FITS_HALF,
        )
        for name, share in found.predictions.items()
        if share < FITS
    ]


def _beyond_the_band(fit: Fit, found: Evidence) -> list[_Reason]:
    """Residuals that are coloured, move with a valve, and make a larger load than the band is wide."""
    curve = fit.load_curve
    inside = np.isfinite(curve.high - curve.low) & (curve.position <= reach(fit))
    if inside.sum() < 2:
        return []
    width = float(np.median((curve.high - curve.low)[inside]))
    slope = float(np.median(np.abs(np.gradient(curve.force, curve.position)[inside])))
    force = {"position": 0.0 if fit.follows else slope, "pressure_a": fit.actuator.parameters.A_A}
    reasons = []
    for name, diagnosis in found.diagnoses.items():
        for column, residual in diagnosis.columns.items():
            load = force[column] * residual.rms * float(np.sqrt(max(np.nan_to_num(residual.fast.first), 0.0)))
            if load > width and _moves_with_a_valve(residual):
                reasons.append(
                    _Reason(
                        f"{name}: the residual of {column} is coloured, moves with a valve and is worth a load of "
                        f"{load:.0f} N, more than the {width:.0f} N between the ends of the band: it is too narrow."
                    )
                )
    return reasons


def _moves_with_a_valve(residual: ColumnDiagnosis) -> bool:
    coloured = max(np.nan_to_num(rate.share_outside) for rate in (residual.fast, residual.slow)) > MOST_OUTSIDE
    crossed = [c for rate in (residual.fast, residual.slow) for c in rate.inputs.values()]
    return coloured and any(abs(c.strongest) > BEYOND * c.strongest_bound for c in crossed)


def _band(fit: Fit) -> list[_Reason]:
    """A band that is not there, or broad beside the peak."""
    curve, furthest = fit.load_curve, reach(fit)
    inside = curve.position <= furthest
    half = ((curve.high - curve.low) / 2)[inside]
    known, peak = np.isfinite(half), float(curve.force[curve.peak(furthest)])
    if not set(fit.parameters) & set(fit.actuator.load.names):
        return []
    if not known.any() or peak <= 0.0:
        return [_Reason("the recordings give the load no interval: they say nothing about it.", True)]
    broad = ~(half <= BROAD * peak)
    if known.all() and np.mean(broad) <= BROAD_SHARE:
        return []
    at = curve.position[inside][broad] * 1e3
    widest = f"up to ± {100 * np.max(half) / peak:.0f} % of the peak" if known.all() else "infinite in part"
    return [
        _Reason(
            f"the band of the load is {widest} between {at[0]:.1f} and {at[-1]:.1f} mm, where ± {100 * BROAD:.0f} % is "
            "called broad; record longer, or with more strokes.",
            bool(np.median(half) > peak),
        )
    ]


def _reach(fit: Fit) -> list[_Reason]:
    furthest, (begin, end) = reach(fit), ENGAGING
    if furthest >= end:
        return []
    return [
        _Reason(
            f"the recordings reach {furthest * 1e3:.1f} mm; the clutch engages at {begin * 1e3:.0f} to {end * 1e3:.0f} "
            f"mm, so the load there is not known: reach {end * 1e3:.0f} mm or more.",
            furthest < begin,
        )
    ]


def _unseen(fit: Fit) -> tuple[str, ...]:
    if not fit.follows:
        return ()
    steps = {"shooting": ("shooting", "window", "windows")}
    how, each, between = steps.get(fit.method, ("prediction error", "sample", "samples"))
    judged = "the pressure where it is measured, and " if "pressure_a" in fit.scales else ""
    return (
        f"by {how} the position follows the measurement from {each} to {each}, so its residual cannot judge the "
        f"model; that would need the steps between {between}. Judged are {judged}the position simulated for "
        f"{HORIZON:g} s at a time.",
    )
