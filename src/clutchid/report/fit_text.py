"""A fit as text for a terminal, and as a JSON object."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from clutchid.assess.evidence import Evidence
    from clutchid.estimate import Fit
    from clutchid.estimate.changes import Change
    from clutchid.estimate.result import Errors


def fit_json(result: Fit, found: Evidence) -> dict[str, Any]:
    """The JSON object of a fit and of the evidence for its verdict, docs/formats.md."""
    from clutchid.assess.verdict import verdict_json
    from clutchid.report.changes import notes_of

    curve = result.load_curve
    return {
        "status": result.status,
        "message": result.message,
        "parameters": {
            name: {"value": e.value, "unit": e.unit, "std": e.std, "low": e.low, "high": e.high}
            for name, e in result.parameters.items()
        },
        "load_curve": {
            "position_m": curve.position.tolist(),
            "force_N": curve.force.tolist(),
            "low_N": curve.low.tolist(),
            "high_N": curve.high.tolist(),
        },
        "errors": errors_json(result.errors),
        "logs": {name: errors_json(recording.errors) for name, recording in result.recordings.items()},
        "verify": {name: errors_json(recording.errors) for name, recording in result.verification.items()},
        "noise_scales": dict(result.scales),
        "warnings": list(result.warnings),
        "method": result.method,
        "notes": notes_of(result),
        "changes": [_change_json(change) for change in result.changes],
        "verdict": verdict_json(result, found),
    }


def _change_json(change: Change) -> dict[str, Any]:
    return {
        name: getattr(change, name)
        for name in ("recording", "name", "before", "after", "std", "unit", "probability", "fitted")
    }


def errors_json(errors: Errors) -> dict[str, float | None]:
    """Errors of a simulation as a JSON object."""
    return {
        "position_rms_m": errors.position_rms,
        "position_sse_m2": errors.position_sse,
        "pressure_a_rms_Pa": errors.pressure_a_rms,
        "pressure_a_sse_Pa2": errors.pressure_a_sse,
    }


def errors_text(errors: Errors) -> str:
    """Errors of a simulation for a terminal.

    Examples
    --------
    >>> from clutchid.estimate.result import Errors
    >>> errors_text(Errors(2.5e-4, 1e-6, None, None)), errors_text(Errors(2.5e-4, 1e-6, 7100.0, 1e9))
    ('position 0.250 mm rms', 'position 0.250 mm rms, pressure 7.1 kPa rms')
    """
    pressure = "" if errors.pressure_a_rms is None else f", pressure {errors.pressure_a_rms / 1e3:.1f} kPa rms"
    return f"position {errors.position_rms * 1e3:.3f} mm rms{pressure}"


def fit_text(result: Fit, found: Evidence) -> str:
    """A fit as text for a terminal, without its warnings."""
    from clutchid.assess.verdict import verdict
    from clutchid.report.changes import notes_of

    width = max([9, *(len(name) for name in result.parameters)])
    lines = [f"{'parameter':<{width}}  {'value':>12}  {'std':>10}  {'95 % interval':>27}  unit"]
    for name, e in result.parameters.items():
        lines.append(f"{name:<{width}}  {e.value:12.5g}  {e.std:10.2g}  {e.low:12.5g} .. {e.high:12.5g}  {e.unit}")
    lines.append(_peak(result))
    for title, recordings in (("fitted", result.recordings), ("verified", result.verification)):
        for name, recording in recordings.items():
            how = ", simulated from its duty cycles" if title == "verified" else ""
            lines.append(f"{title} {name}: {errors_text(recording.errors)}{how}")
    judged = verdict(result, found)
    reasons = "".join(f"; {reason.rstrip('.')}" for reason in judged.reasons)
    return "\n".join([*lines, *notes_of(result), f"trust: {judged.trust}{reasons}"])


def _peak(result: Fit) -> str:
    """The greatest load within the reach of the fitted recordings; beyond, the curve is not determined."""
    import numpy as np

    measured = [recording.measured["position"] for recording in result.recordings.values()]
    reach = max((float(np.nanmax(y)) for y in measured if np.isfinite(y).any()), default=0.0)
    curve = result.load_curve
    peak = curve.peak(reach)
    where = f"{curve.position[peak] * 1e3:.2f} mm"
    return f"peak load {curve.force[peak]:.0f} N at {where}, within the recorded {reach * 1e3:.1f} mm"
