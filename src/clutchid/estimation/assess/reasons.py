"""Reasons against a fit: its parameters, load, bounds, departure, slow logs, residuals of the valves.

The thresholds are those of the table in docs/derivations.md, chosen on both families of the virtual truck.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.estimation.assess.comparison import ENGAGING
from clutchid.estimation.assess.diagnostics import COLOURED, LEAST_CORRELATION, MOST_OUTSIDE, ColumnDiagnosis
from clutchid.estimation.assess.evidence import (
    HORIZON,
    Evidence,
    Reason,
    evidence,
    once_a_fit,
    reach,
    shared_information,
)
from clutchid.estimation.assess.pressure import pressure_reasons
from clutchid.estimation.assess.rest import rest_reasons
from clutchid.estimation.assess.travel import travel_reasons
from clutchid.estimation.result import Departure, Fit, InputFault, physical_limits
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import GAUGE, gauge_sentence, supply_difference
from clutchid.inference.uncertainty.gaussian import spectrum
from clutchid.inference.uncertainty.identifiability import collinear, in_words
from clutchid.log import sample_interval
from clutchid.names import base_of
from clutchid.numerics.interval import QUANTILE
from clutchid.strokes.duty_cycle import is_slow
from clutchid.strokes.vented_pressure import RECORD_REST, UNSETTLED, remedy, vented_pressure


def bound_reasons(fit: Fit) -> list[Reason]:
    """Estimates at bounds that are chosen, not physical: the data favour a value beyond."""
    at_bounds = [] if fit.departure is not None else _at_bounds(fit, physical=False)
    if not at_bounds:
        return []
    their = "its bound" if len(at_bounds) == 1 else "their bounds"
    text = f"{_lie(at_bounds)} at {their}: the data favour a value beyond, or the model is incomplete."
    return [Reason(text)]


def bound_notes(fit: Fit) -> list[str]:
    """Estimates at bounds that say nothing of the error of the load: benchmarks/results/calibration.md."""
    physical = _at_bounds(fit, physical=True)
    if fit.departure is not None:
        estimates = [*physical, *_at_bounds(fit, physical=False)]
        at, why = "a bound" if len(estimates) == 1 else "bounds", "no reason against a load from position alone"
    else:
        estimates, at = physical, "a physical limit" if len(physical) == 1 else "physical limits"
        why = "no reason against the load"
    return [f"{_lie(estimates)} at {at}: {why}."] if estimates else []


def _lie(names: list[str]) -> str:
    return f"{in_words(names)} {'lies' if len(names) == 1 else 'lie'}"


def _at_bounds(fit: Fit, *, physical: bool) -> list[str]:
    """Estimates at a finite bound that is, or is not, a physical limit, which only fits with priors have."""
    estimates = []
    for name, estimate in fit.parameters.items():
        ends = zip(("lower", "upper"), fit.bounds.get(name, ()), strict=False)
        limits = physical_limits(fit.actuator, base_of(name)) if fit.follows else ()
        finite = [(word, end) for word, end in ends if np.isfinite(end) and (end in limits) == physical]
        estimates += [f"{name} ({word})" for word, end in finite if abs(estimate.value - end) <= 1e-9 * abs(end)]
    return estimates


#: Share of its position error by which a recording that was not fitted must be simulated better than from the start
#: values. Chosen by hand.
LEAST_GAIN = 0.05


def gain_reasons(fit: Fit) -> Iterator[Reason]:
    """Verified recordings that the start values simulate as well."""
    for name, gain in fit.gains.items():
        if gain < LEAST_GAIN:
            rms = fit.verification[name].errors.position_rms * 1e3
            yield Reason(
                f"no improvement: {name}, which was not fitted, is simulated to {rms:.3g} mm, and from the start "
                f"values to {rms / (1.0 - gain):.3g} mm: keep those, or fit recordings like it."
            )


def slow_reasons(fit: Fit) -> Iterator[Reason]:
    """That recordings are slower than the changes of their duty cycles; none if none of them is."""
    logs = {name: recording.measured for name, recording in fit.recordings.items()}
    slow = [name for name, log in logs.items() if is_slow(log)]
    if not slow:
        return
    slowest = min(1.0 / sample_interval(logs[name].time) for name in slow)
    text = (
        f"{in_words(slow)}: at {slowest:.3g} Hz the valves open and close between the samples, at times that are not "
    )
    text += "recorded. "
    if fit.baseline is not None and "pressure_a" not in fit.scales:
        text += "The interval is widened for that, but by what it costs on virtual trucks only; "
    else:
        text += "The load may have errors that its interval does not include; "
    yield Reason(f"{text}record position and duty cycles at 1 kHz.")


#: Expected error of the load, rms over the stroke in % of the peak: up to the first it is good, beyond the second none.
#: Provenance: benchmarks/results/verdicts.md.
GOOD_ERROR, POOR_ERROR = 1.7, 3.3

#: Probability that a change moves a truck less far from its calibration, by the prior of changes: beyond the first the
#: inputs may be wrong, beyond the second the calibration is of another truck. Provenance: `benchmarks/pairs.py`,
#: benchmarks/results/verdicts.md.
FAR, ANOTHER = 0.90, 0.99

#: A fault is the cause if its innovations are at most as many times those of the calibration, and those of the
#: recording as it is at least as many times these. Provenance: benchmarks/results/causes.md.
_AGREES, _BETTER = 1.6, 1.5

#: Innovations over those of the calibration: beyond the first, faults are looked for; up to the second, an observer
#: follows the recording as it does a truck that has changed. Provenance: as before.
SUSPICIOUS, FOLLOWED = 2.0, 5.0

#: Cost for each second in motion over that of the calibration: beyond the first the model misses part of the recording.
MISFIT, POOR_MISFIT = 1.5, 2.2

#: Leak of chamber A in m³/(Pa·s): beyond the first few trucks were tried, and one was 9.5 % off; the second is the end
#: of what a search admits. Provenance: `benchmarks/pairs.py`, benchmarks/results/changes.md.
_LEAKS, _LEAKS_TOO_MUCH = 3e-10, 5e-10

#: Change of the logarithm of the viscous friction, as by 15 K, beyond which a reading is no good one: all of those that
#: were more than 2 % wrong had it. Provenance: benchmarks/results/intervals.md.
GREASE = 0.3

#: Position in m from which the error counts: before, the load is small.
FROM = 5e-4


def reading_reasons(fit: Fit) -> Iterator[Reason]:
    """Reasons against a load from position alone; none for another fit."""
    departure = fit.departure
    if departure is None or fit.baseline is None:
        return
    error = expected_error(fit)
    yield from departure_reasons(fit)
    for change in fit.changes:
        if change.name == "C_A0" and change.after > _LEAKS:
            too_much = change.after > _LEAKS_TOO_MUCH
            what = "too much for the load to be read" if too_much else "so much that the load may be wrong"
            text = f"{change.recording}: chamber A or its connections leak {what} ({change.after:.1e} "
            yield Reason(f"{text}m³/(Pa·s), more than {_LEAKS:g}): repair the leak and record again.", too_much)
    yield from _grease_reasons(fit)
    if not error <= GOOD_ERROR:
        text = f"the standard deviation of the load is {error:.1f} % of its peak, a good one has at most "
        text += f"{GOOD_ERROR:g} %: the recording does not determine all that may have changed since the calibration. "
        is_recorded = all("pressure_supply" in recording.measured.columns for recording in fit.recordings.values())
        what = "record longer" if is_recorded else "record the supply pressure or record longer"
        text += f"The interval includes this. To narrow it, {what}, or give what is known with --prior."
        yield Reason(text, error > POOR_ERROR, banded=True)


def _grease_reasons(fit: Fit) -> Iterator[Reason]:
    """Grease of another temperature than at the calibration, which may hide another supply pressure."""
    if any(assumption.name == "P_S" for assumption in fit.assumed):
        remedy = "6 % wrong, because another supply pressure may look the same: record the supply pressure."
    else:
        remedy = "3 % wrong, which the interval includes: calibrate near this temperature."
    for change in fit.changes:
        if change.name == "D_v" and change.probability > 0.5 and change.before > 0.0 < change.after:
            ratio = change.after / change.before
            if abs(np.log(ratio)) > GREASE:
                text = f"{change.recording}: the grease is {ratio:.2g} times as viscous as at the calibration, as at "
                yield Reason(f"{text}another temperature. Such loads were up to {remedy}")


def departure_reasons(fit: Fit) -> Iterator[Reason]:
    """A recording that no change explains: the fault of its inputs that does, or the calibration of another truck."""
    departure = fit.departure
    if departure is None or fit.baseline is None or is_explained(fit):
        return
    cause, nearer = named_cause(fit.causes), _nearer(departure)
    if cause is not None:
        as_recorded = of_no_fault(fit.causes)
        without = fit.alternatives.get(cause.name)
        load = f", and {loads_in_words(without)}" if without else ""
        yield Reason(
            f"{cause.sentence}: without this fault the innovations are {cause.innovations:.1f} times those of the "
            f"calibration; as recorded they are {as_recorded.innovations:.1f} times{load}; {cause.remedy}.",
            True,
        )
        return
    if not nearer > ANOTHER and fit.causes and of_no_fault(fit.causes).innovations <= FOLLOWED:
        return
    name, facts = _name_of(fit.baseline), []
    if nearer > FAR:
        moved = [
            f"{fit.actuator.row(m.name).meaning}, {m.name} ({m.after:.3g} instead of {m.before:.3g}"
            f"{fit.actuator.unit_behind(m.name)})"
            for m in departure.moved
        ]
        facts.append(
            f"the values of {in_words(moved)}, whose squared distance from the calibration is "
            f"{departure.distance:.0f} (usually about {departure.expected:.0f})"
        )
    if departure.misfit > MISFIT:
        facts.append(f"squared residuals in motion {departure.misfit:.1f} times as large as in the calibration")
    compared = _compared(fit.causes)
    if departs(fit):
        yield Reason(
            f"the calibration {name} seems to be of another truck: no usual change explains "
            f"{' and '.join(facts)}{compared}; use the calibration of this truck, or make one.",
            True,
        )
    else:
        yield Reason(
            f"the recording does not fit the calibration {name}: no usual change explains "
            f"{' and '.join(facts)}{compared}; check its channels, and that the calibration is of this truck."
        )


def named_cause(causes: Sequence[InputFault]) -> InputFault | None:
    """The likeliest fault of the inputs, if a recording agrees with its calibration without it, and not as it is."""
    if not causes or not causes[0].sentence:
        return None
    best = causes[0]
    agrees = best.innovations <= _AGREES and of_no_fault(causes).innovations >= _BETTER * best.innovations
    return best if agrees else None


def of_no_fault(causes: Sequence[InputFault]) -> InputFault:
    """Of compared causes that of the recording as it is."""
    return next(cause for cause in causes if not cause.sentence)


def _compared(causes: Sequence[InputFault]) -> str:
    """That no fault of the inputs explains a recording, with the evidence of the best one."""
    if len(causes) < 2:
        return ""
    best = min((cause for cause in causes if cause.sentence), key=lambda cause: cause.innovations)
    return (
        "; neither a shift, filter, clock, gain nor inversion of the inputs explains it (the innovations are "
        f"{of_no_fault(causes).innovations:.1f} times those of the calibration, and {best.innovations:.1f} times "
        "without the likeliest fault)"
    )


def loads_in_words(fit: Fit) -> str:
    """The load where the clutch engages, as a clause."""
    begin, end = (round(y * 1e3) for y in ENGAGING)
    at = range(begin, end + 1)
    loads = [f"{np.interp(mm * 1e-3, fit.load_curve.position, fit.load_curve.force):.0f}" for mm in at]
    return f"the load at {in_words([*map(str, at)])} mm is {in_words(loads)} N"


def supply_reasons(fit: Fit) -> Iterator[Reason]:
    """A supply pressure that differs from the calibrated one by an atmosphere."""
    reading = fit.alternatives.get(GAUGE)
    if reading is None or fit.baseline is None:
        return
    ((name, recording),) = fit.recordings.items()
    difference = supply_difference(recording.measured, fit.actuator, fit.baseline.conditions) or 0.0
    yield Reason(f"{name}: {gauge_sentence(difference)}. Read without the supply pressure {loads_in_words(reading)}.")


def _name_of(calibration: Calibration) -> str:
    """Name of the file of a calibration."""
    return calibration.origin.name if calibration.origin and calibration.origin.name else "of this fit"


def expected_error(fit: Fit) -> float:
    """Expected error of the load by its band, rms over the recorded stroke in % of the peak; NaN without a band."""
    curve, furthest = fit.load_curve, reach(fit)
    inside = (curve.position >= FROM) & (curve.position <= furthest)
    std = (curve.high - curve.low)[inside] / (2 * QUANTILE)
    peak = float(curve.force[curve.peak(furthest)])
    return 100.0 * float(np.sqrt(np.mean(std**2))) / peak if std.size and peak > 0.0 else float("nan")


def is_explained(fit: Fit) -> bool:
    """Whether changes since the calibration explain the recordings of a reading."""
    departure = fit.departure
    return departure is None or not (_nearer(departure) > FAR or departure.misfit > MISFIT)


def departs(fit: Fit) -> bool:
    """Whether the truck is farther from its calibration, or the recording costs more, than any change explains."""
    departure = fit.departure
    return departure is not None and (_nearer(departure) > ANOTHER or departure.misfit > POOR_MISFIT)


def reason_apart(fit: Fit, readings: int) -> str:
    """Why one of several `readings` has no load in common with others: its search, or its vehicle; empty where it may.

    The probability that any recording of one vehicle is taken for one of another is that of a single one.
    """
    if not fit.converged and departs(fit):
        return "not converged"
    another = fit.departure is not None and 1.0 - _nearer(fit.departure) < (1.0 - ANOTHER) / readings
    return "another vehicle" if another else ""


def _nearer(departure: Departure) -> float:
    """Probability that a change moves a truck less far (chi-square); NaN where the data determine nothing."""
    from scipy.special import chdtr

    return float(chdtr(departure.expected, departure.distance)) if departure.expected > 0.0 else float("nan")


class _Residual(NamedTuple):
    """A residual and the load in N that it corresponds to, 0 if it is white or the position follows the measurement."""

    recording: str
    column: str
    load: float


def valve_reasons(fit: Fit, evidence: Evidence) -> list[Reason]:
    """Residuals that correspond to a load larger than the width of the interval."""
    (width, interval), so = _width(fit), "the model errs there" if _missed(fit) else "the interval is too narrow"
    return [
        Reason(
            f"{residual.recording}: the residual of {residual.column} is autocorrelated, correlates with a valve and "
            f"corresponds to a load of {residual.load:.0f} N, more than the width of {interval}, {width:.0f} N: {so}."
        )
        for residual in _residuals(fit, evidence, 0.0)
        if residual.load > width
    ]


def valve_notes(fit: Fit, evidence: Evidence) -> list[str]:
    """The others that `clutchid.estimation.assess.diagnostics.remarks` names: the load does not suffer."""
    (width, interval), notes = _width(fit), list[str]()
    for residual in _residuals(fit, evidence, LEAST_CORRELATION):
        what = f"{residual.recording}: the residual of {residual.column} correlates with a valve"
        if residual.column == "position" and fit.follows:
            notes.append(f"{what}: no reason against the load, because the position follows the measurement.")
        elif residual.load <= width:
            notes.append(
                f"{what} and corresponds to a load of {residual.load:.0f} N, within the width of {interval}, "
                f"{width:.0f} N: no reason against the load."
            )
    return notes


def _inside(fit: Fit) -> NDArray[np.bool_]:
    """Points of a fitted load with an interval, within the reach."""
    curve = fit.load_curve
    inside: NDArray[np.bool_] = np.isfinite(curve.high - curve.low) & (curve.position <= reach(fit))
    return inside & fit.load_is_fitted


def _missed(fit: Fit) -> float:
    """Standard deviation in N of what the model misses, which the interval of a calibration has."""
    return fit.calibration.missed if fit.calibration and fit.calibration is not fit.baseline else 0.0


def _width(fit: Fit) -> tuple[float, str]:
    """Median width of the interval of the load in N, of a calibration by its data alone, and its name; NaN without."""
    width, missed = (fit.load_curve.high - fit.load_curve.low)[_inside(fit)], 2 * QUANTILE * _missed(fit)
    name = f"the interval{' by the data alone' if missed else ''}"
    return (float(np.median(np.sqrt(np.maximum(width**2 - missed**2, 0.0)))) if width.size > 1 else float("nan")), name


def _residuals(fit: Fit, evidence: Evidence, least: float) -> list[_Residual]:
    """Residuals with a certain correlation of at least `least` with a valve; none without a load with an interval."""
    curve, inside = fit.load_curve, _inside(fit)
    if inside.sum() < 2:
        return []
    slope = float(np.median(np.abs(np.gradient(curve.force, curve.position)[inside])))
    force = {"position": 0.0 if fit.follows else slope, "pressure_a": fit.actuator.parameters.A_A}
    return [
        _Residual(name, column, force[column] * _autocorrelated(residual))
        for name, diagnosis in evidence.diagnoses.items()
        for column, residual in diagnosis.columns.items()
        if _correlates_with_valve(residual, least)
    ]


def _autocorrelated(residual: ColumnDiagnosis) -> float:
    """Rms of the autocorrelated part of a residual in SI; 0 if it looks white."""
    share = max(np.nan_to_num(rate.share_outside) for rate in (residual.fast, residual.slow))
    return residual.autocorrelated if share > MOST_OUTSIDE else 0.0


def _correlates_with_valve(residual: ColumnDiagnosis, least: float) -> bool:
    correlations = [c for rate in (residual.fast, residual.slow) for c in rate.inputs.values()]
    return any(abs(c.strongest) > max(COLOURED * c.strongest_bound, least) for c in correlations)


#: Fits in %: below the first a tenth of the motion is not reproduced, below the second half of it.
_GOOD_FIT, _POOR_FIT = 90.0, 50.0

#: The interval of a load is wide if its half width exceeds this fraction of the peak, over more than `_WIDE_SHARE` of
#: the reach: near the end of the reach it always does.
WIDE, _WIDE_SHARE = 0.1, 0.1


@once_a_fit
def reasons(fit: Fit) -> tuple[Reason, ...]:
    """Reasons that lower the trust in a fit, grave ones first; a failed one has one reason."""
    if fit.status == "failed" or not fit.recordings:
        return (Reason(f"the fit failed: {fit.message}".rstrip(".") + ".", True),)
    return (*sorted(_reasons(fit, evidence(fit)), key=lambda reason: not reason.grave),)


def _reasons(fit: Fit, judged: Evidence) -> Iterator[Reason]:
    yield from slow_reasons(fit)
    yield from gain_reasons(fit)
    yield from reading_reasons(fit)
    yield from supply_reasons(fit)
    yield from pressure_reasons(fit)
    yield from travel_reasons(fit)
    yield from rest_reasons(fit)
    if not fit.converged:
        yield Reason("the search did not converge; continue from its result, or free fewer parameters.")
    if fit.baseline is not None:
        yield from _poor_baseline(fit.baseline)
    yield from ambient_reasons(fit)
    yield from bound_reasons(fit)
    yield from _rounding(fit)
    if not fit.follows:  # with priors, the notes report them
        yield from _undetermined(fit)
    if fit.departure is None:
        for name, share in judged.predictions.items():
            if share < _GOOD_FIT:
                yield Reason(
                    f"{name}: simulated for {HORIZON:g} s at a time, the position fits to {share:.1f} %, less than "
                    f"{_GOOD_FIT:.0f} %: the model does not reproduce part of the motion, and the load may have "
                    "similar errors.",
                    share < _POOR_FIT,
                )
        yield from valve_reasons(fit, judged)
    if fit.load_is_fitted:
        yield from _wide_interval(fit)
    furthest, (begin, end) = reach(fit), ENGAGING
    if not furthest >= end:
        yield Reason(
            f"the recordings reach {furthest * 1e3:.1f} mm; the clutch engages at {begin * 1e3:.0f} to "
            f"{end * 1e3:.0f} mm, so the load there is not determined: reach {end * 1e3:.0f} mm or more.",
            furthest < begin,
        )


def _poor_baseline(baseline: Calibration) -> Iterator[Reason]:
    """A calibration that did not converge, or that is not to be trusted."""
    name = _name_of(baseline)
    if baseline.origin and baseline.origin.trust == "none":
        yield Reason(f"the calibration {name} has trust 'none'; calibrate again.", True)
    if not baseline.converged:
        yield Reason(
            f"the search of the calibration {name} had not converged, and the load may have errors that its interval "
            "does not include; continue the calibration, then read again."
        )
    yield from unvented_baseline(baseline)


def unvented_baseline(calibration: Calibration | None) -> list[Reason]:
    """That a calibration saw no settled vented rest; none where it did."""
    if calibration is None or calibration.vented:
        return []
    text = f"the recordings of the calibration {_name_of(calibration)} show no settled vented rest, so its loads "
    return [Reason(f"{text}rest on the assumed ambient pressure only; {RECORD_REST}, and calibrate again.")]


def ambient_reasons(fit: Fit) -> Iterator[Reason]:
    """An ambient pressure that is estimated although no recording shows it."""
    settled = {name: vented_pressure(recording.measured) is not None for name, recording in fit.recordings.items()}
    for name, estimate in fit.parameters.items() if "pressure_a" in fit.scales else ():
        base, _, stem = name.partition("@")
        logs = [stem] if stem else [*settled]
        if base == "P_0" and not any(settled[log] for log in logs):
            half, curve = QUANTILE * estimate.std, fit.load_curve
            share = half * fit.actuator.parameters.A_A / curve.force[curve.peak(reach(fit))]
            text = (
                f"{in_words(logs)}: {UNSETTLED}, so the ambient pressure, {name}, is known only to ± "
                f"{half * 1e-3:.1f} kPa, "
            )
            advice = remedy(fit.recordings[log].measured for log in logs)
            yield Reason(f"{text}± {100 * share:.1f} % of the peak; {advice}.")


def _rounding(fit: Fit) -> Iterator[Reason]:
    """Directions in which the Jacobian is singular to rounding, so that the covariance is meaningless."""
    finite = [i for i, v in enumerate(np.diag(fit.covariance)) if 0.0 < v < np.inf]
    if len(finite) < 2:
        return
    _, values, vectors = spectrum(fit.covariance[np.ix_(finite, finite)])
    if not values[0] > len(finite) * np.finfo(float).eps * values[-1]:
        names = [list(fit.parameters)[i] for i in finite]
        mixed = [name for name, part in zip(names, np.abs(vectors[:, -1]), strict=True) if part > 0.1]
        yield Reason(
            f"the Jacobian is numerically singular in the direction of {in_words(mixed)}: their intervals are "
            "meaningless; fix one of them.",
            any(name in fit.actuator.load.names for name in mixed),
        )


def _undetermined(fit: Fit) -> Iterator[Reason]:
    """Estimates with a standard error as large as the value, and those of which only combinations are determined."""
    undetermined = []
    for name, estimate in fit.parameters.items():
        if name in fit.actuator.parameter_names:
            size = max(abs(estimate.value), abs(fit.actuator.default(name)))
            undetermined += [name] if size > 0.0 and estimate.std >= size else []
    if undetermined:
        what = "the standard error of {} is" if len(undetermined) == 1 else "the standard errors of {} are"
        names = what.format(in_words(undetermined))
        yield Reason(f"{names} as large as the value: the data do not determine it; fix it.")
    if shared := shared_information(fit):
        group = [shared.determined[i] for i in collinear(shared.columns(shared.determined))]
        if len(group) >= 3:
            text = f"of {len(group)} parameters, {group[0]} to {group[-1]}, only combinations can be determined: "
            yield Reason(f"{text}fix some, or calibrate with pressure and start from that.")


def _wide_interval(fit: Fit) -> Iterator[Reason]:
    """An infinite interval of the load, or a wide one relative to the peak."""
    curve, furthest = fit.load_curve, reach(fit)
    inside = curve.position <= furthest
    half = ((curve.high - curve.low) / 2)[inside]
    finite, peak = np.isfinite(half), float(curve.force[curve.peak(furthest)])
    if not finite.any() or peak <= 0.0:
        yield Reason("the data do not determine the load: its interval is infinite.", True)
        return
    broad = ~(half <= WIDE * peak)
    if not finite.all() or np.mean(broad) > _WIDE_SHARE:
        at = curve.position[inside][broad] * 1e3
        widest = f"up to ± {100 * np.max(half) / peak:.0f} % of the peak" if finite.all() else "infinite in part"
        yield Reason(
            f"the interval of the load is {widest} between {at[0]:.1f} and {at[-1]:.1f} mm; at most ± "
            f"{100 * WIDE:.0f} % is allowed; record longer, or with more strokes.",
            bool(np.median(half) > peak),
            banded=bool(finite.all()),
        )
