"""Results of an observer in a recording, in words and as a JSON object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from clutchid.documents.document import LabelRow, On, labelled
from clutchid.documents.fit_json import curve_json, errors_json
from clutchid.documents.fit_rows import POSITIONS, with_interval
from clutchid.documents.style import MM
from clutchid.estimation import errors_over
from clutchid.estimation.assess.observed import indicators, observed_verdict
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.inference.uncertainty.estimates import POINTS, LoadCurve
from clutchid.observer import ObservedRecording, curve, estimates_of, loads


def observe_sentence(run: ObservedRecording) -> str:
    """The load at half stroke before and after, its change, strokes, flags, and what is assumed, on one line."""
    assumed = "; supply pressure assumed" if run.assumes_supply else ""
    return f"{load_sentence(run)}; {flags_words(run.health)}{assumed}"


def flags_words(health: Mapping[str, float]) -> str:
    """Flags with their seconds, those that were raised."""
    raised = [f"{name} {seconds:.3g} s" for name, seconds in health.items() if seconds > 0.0]
    return f"flags: {', '.join(raised)}" if raised else "no flags"


def load_sentence(run: ObservedRecording) -> str:
    """The load at half stroke before and after, its change, and the strokes."""
    _, before, after = loads(run)
    half = POINTS // 2
    change = after.force[half] - before.force[half]
    share = 100.0 * change / before.force.max()
    strokes = run.after.strokes - run.before.strokes
    return (
        f"load at {before.position[half] / MM:.1f} mm {before.force[half]:.0f} → {after.force[half]:.0f} N "
        f"({share:+.1f} % of the peak), {strokes} stroke{'' if strokes == 1 else 's'}"
    )


def rows_of(run: ObservedRecording) -> list[LabelRow]:
    """The observed recording, its final load where the clutch engages, with the 95 % band, and the trust in it."""
    at = curve(run.observer, run.after, [mm * MM for mm in POSITIONS])
    halves = ((at.high - at.low) / 2).tolist()
    shown = ", ".join(with_interval(force, half) for force, half in zip(at.force.tolist(), halves, strict=True))
    judged = observed_verdict(indicators(run))
    about = [load_sentence(run), *_if_as_calibrated(run)]
    if run.observer.compares:
        about.append(f"mean squared innovation in motion (NIS): {run.after.mismatch:.2f} times that of the calibration")
    return [
        LabelRow(None, f"observed {run.log.name}: {observe_sentence(run)}", fixed=True, on=On.TERMINAL),
        LabelRow("load", f"at {', '.join(map(str, POSITIONS))} mm: {shown} N"),
        LabelRow("trust", judged.trust, judged.trust),
        LabelRow("", judged.meaning, on=On.PAGE),
        *(LabelRow("", text) for text in judged.reasons),
        *([LabelRow("", judged.experience, on=On.PAGE)] if judged.experience else []),
        *labelled("change", about, On.PAGE),
    ]


def _if_as_calibrated(run: ObservedRecording) -> list[str]:
    """The band where the clutch engages, if a supply pressure that is not recorded is that of the calibration."""
    if not run.assumes_supply:
        return []
    at = curve(run.observer, run.after, [mm * MM for mm in POSITIONS], as_calibrated=True)
    halves = ", ".join(f"± {half:.0f}" for half in ((at.high - at.low) / 2).tolist())
    return [f"if the supply pressure has its calibrated value, the band is {halves} N"]


def _as_calibrated(run: ObservedRecording, after: LoadCurve) -> dict[str, list[float]]:
    """The band of the load if the supply pressure is that of the calibration, where it is not recorded."""
    if not run.assumes_supply:
        return {}
    band = curve(run.observer, run.after, after.position, as_calibrated=True)
    return {"low_as_calibrated_N": band.low.tolist(), "high_as_calibrated_N": band.high.tolist()}


def observe_json(run: ObservedRecording, origin: Origin) -> dict[str, Any]:
    """The JSON object of an observed recording: that of a fit for the load at its end, and its health."""
    estimates, adapting = estimates_of(run.observer, run.after), run.observer.adapting
    calibrated, _, after = loads(run)
    errors = errors_json(errors_over([(run.travel, run.estimates())]))
    warnings = list(run.log.warnings)
    judged = observed_verdict(indicators(run))
    return {
        "status": "warning" if warnings or any(run.health.values()) else "ok",
        "message": observe_sentence(run),
        "parameters": {name: asdict(estimates[name]) for name in estimates if name in adapting},
        "load_curve": {**curve_json(after), **_as_calibrated(run, after)},
        "calibrated_load_curve": curve_json(calibrated),
        "errors": errors,
        "logs": {run.log.name: errors},
        "warnings": warnings,
        "method": run.observer.method,
        "calibration": origin._asdict(),
        "strokes": run.after.strokes,
        "health": dict(run.health),
        "trust": judged.trust,
        "reasons": list(judged.reasons),
        "nis_ratio": run.after.mismatch if run.observer.compares else None,
        "supply_assumed": run.assumes_supply,
        "rest_shift_m": run.after.rest_shift,
    }
