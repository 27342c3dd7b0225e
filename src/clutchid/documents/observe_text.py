"""Results of an observer in a recording, in words and as a JSON object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from clutchid.documents.fit_json import curve_json, errors_json
from clutchid.documents.style import MM
from clutchid.documents.summary import POSITIONS, SummaryRow, with_interval
from clutchid.estimation.assess.observed import indicators, observed_verdict
from clutchid.estimation.result import errors_over
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.observer.by_stroke import curve, known
from clutchid.observer.recording import POINTS, ObservedRecording, loads


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
    strokes = run.after.strokes.ended - run.before.strokes.ended
    return (
        f"load at {before.position[half] / MM:.1f} mm {before.force[half]:.0f} → {after.force[half]:.0f} N "
        f"({share:+.1f} % of the peak), {strokes} stroke{'' if strokes == 1 else 's'}"
    )


def end_rows(run: ObservedRecording) -> list[SummaryRow]:
    """The load at the end of a recording where the clutch engages, with its 95 % band, and the trust in it."""
    at = curve(run.observer, run.after, [mm * MM for mm in POSITIONS])
    halves = ((at.high - at.low) / 2).tolist()
    shown = ", ".join(with_interval(force, half) for force, half in zip(at.force.tolist(), halves, strict=True))
    load = f"at {', '.join(map(str, POSITIONS))} mm: {shown} N"
    judged = observed_verdict(indicators(run))
    return [
        SummaryRow("load", load),
        SummaryRow("trust", judged.trust, judged.trust),
        *(SummaryRow("", text) for text in judged.reasons),
    ]


def observe_json(run: ObservedRecording, origin: Origin) -> dict[str, Any]:
    """The JSON object of an observed recording: that of a fit for the load at its end, and its health."""
    values = {name: one for name, one in known(run.observer, run.after).items() if name in run.observer.adapting}
    calibrated, _, after = loads(run)
    errors = errors_json(errors_over([(run.travel, run.estimates())]))
    warnings = list(run.log.warnings)
    judged = observed_verdict(indicators(run))
    return {
        "status": "warning" if warnings or any(run.health.values()) else "ok",
        "message": observe_sentence(run),
        "parameters": {name: asdict(one) for name, one in values.items()},
        "load_curve": curve_json(after),
        "calibrated_load_curve": curve_json(calibrated),
        "errors": errors,
        "logs": {run.log.name: errors},
        "warnings": warnings,
        "method": run.observer.method,
        "calibration": origin._asdict(),
        "strokes": run.after.strokes.ended,
        "health": dict(run.health),
        "trust": judged.trust,
        "reasons": list(judged.reasons),
        "nis_ratio": run.after.mismatch if run.observer.compares else None,
        "supply_assumed": run.assumes_supply,
        "rest_shift_m": run.after.rest.shift,
    }
