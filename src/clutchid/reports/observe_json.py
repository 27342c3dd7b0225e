"""A recording that was observed, as a JSON object."""

from __future__ import annotations

from typing import Any

from clutchid.estimation.assess.observed import indicators, observed_verdict
from clutchid.estimation.result import LoadCurve, errors_over
from clutchid.inference.uncertainty.calibration import Origin
from clutchid.observer.by_stroke import known
from clutchid.observer.recording import ObservedRecording
from clutchid.reports.fit_json import curve_json, errors_json
from clutchid.reports.observe_text import loads, observe_sentence


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
        "parameters": {
            name: {**one._asdict(), "unit": run.observer.actuator.unit(name)} for name, one in values.items()
        },
        "load_curve": curve_json(LoadCurve(*after)),
        "calibrated_load_curve": curve_json(LoadCurve(*calibrated)),
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
