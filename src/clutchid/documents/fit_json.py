"""A fit as a JSON object."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.documents.changes import notes_of, rests_json
from clutchid.documents.identifiability import identifiability_json
from clutchid.estimation import Change, Errors, Fit, LoadCurve
from clutchid.estimation.assess.comparison import Comparison, comparison
from clutchid.estimation.assess.diagnostics import ColumnDiagnosis, remarks
from clutchid.estimation.assess.evidence import evidence
from clutchid.estimation.assess.verdict import states_of_wear, verdict
from clutchid.estimation.result import InputFault
from clutchid.inference.uncertainty.calibration import Origin

if TYPE_CHECKING:
    from clutchid.numerics.whiteness import CrossCorrelation

_UNCOMPARED: dict[str, Any] = {"calibrated_load_curve": None, "load_change": None}


def fit_json(result: Fit) -> dict[str, Any]:
    """The JSON object of a fit, docs/formats.md."""
    rests = rests_json(result)
    return {
        "status": result.status,
        "message": result.message,
        "parameters": {name: asdict(estimate) for name, estimate in result.parameters.items()},
        "load_curve": curve_json(result.load_curve),
        "errors": errors_json(result.errors),
        "logs": {
            name: {**errors_json(recording.errors), "rest_shift_m": rests.get(name)}
            for name, recording in result.recordings.items()
        },
        "rest_shift_m": next(iter(rests.values()), None),
        "verify": {
            name: {**errors_json(recording.errors), "gain": result.gains.get(name)}
            for name, recording in result.verification.items()
        },
        "noise_scales": dict(result.scales),
        "warnings": list(result.warnings),
        "method": result.method,
        "starts": [asdict(start) for start in result.starts],
        **identifiability_json(result),
        "criteria": evidence(result).criteria(len(result.parameters))._asdict(),
        "causes": [cause_json(cause) for cause in result.causes],
        "alternatives": {name: _reading_json(fit) for name, fit in result.alternatives.items()},
        "notes": notes_of(result),
        "changes": [change_json(change) for change in result.changes],
        "load_per_supply": result.load_per_supply,
        "verdict": verdict_json(result),
        "trust": verdict(result).trust,
        "reasons": list(verdict(result).reasons),
        "calibration": origin_json(result),
        **_compared_json(result),
        "states_of_wear": _states_json(result),
        "readings": {name: _reading_json(fit) for name, fit in result.readings.items()},
    }


def curve_json(curve: LoadCurve) -> dict[str, list[float]]:
    """A load curve as a JSON object."""
    return {
        "position_m": curve.position.tolist(),
        "force_N": curve.force.tolist(),
        "low_N": curve.low.tolist(),
        "high_N": curve.high.tolist(),
    }


def origin_json(result: Fit) -> dict[str, str] | None:
    """The calibration that a fit started from; empty text where it is not from a file."""
    if result.baseline is None:
        return None
    return (result.baseline.origin or Origin())._asdict()


def comparison_json(compared: Comparison) -> dict[str, Any]:
    """The load of the calibration, and the difference of both loads."""
    at = compared.difference
    change = {
        "position_m": compared.present.position.tolist(),
        "difference_N": at.force.tolist(),
        "low_N": at.low.tolist(),
        "high_N": at.high.tolist(),
        "difference_percent": (100.0 * at.share).tolist(),
    }
    halves = (("before", compared.half_before), ("now", compared.half_now), ("shift", compared.shift))
    half = {name: {"position_m": half.position, "low_m": half.low, "high_m": half.high} for name, half in halves}
    return {"calibrated_load_curve": curve_json(compared.calibrated), "load_change": {**change, "half_load": half}}


def _states_json(result: Fit) -> dict[str, Any] | None:
    """Recordings by state of wear, and the difference of the two that differ most; None if they are of one."""
    states = states_of_wear(result)
    if states is None:
        return None
    most = states.most
    return {
        "groups": [list(group) for group in states.groups],
        "recordings": [most.first, most.second],
        "load_percent": 100.0 * most.load,
        "load_allowed_percent": 100.0 * most.load_allowed,
        "half_load_m": most.shift,
        "half_load_allowed_m": most.shift_allowed,
    }


def _compared_json(fit: Fit) -> dict[str, Any]:
    """The load against that of the calibration; null where there is none."""
    compared = comparison(fit)
    return _UNCOMPARED if compared is None else comparison_json(compared)


def _reading_json(fit: Fit) -> dict[str, Any]:
    """One of several recordings, read alone."""
    return {
        "trust": verdict(fit).trust,
        "load_curve": curve_json(fit.load_curve),
        "load_change": _compared_json(fit)["load_change"],
        "changes": [change_json(change) for change in fit.changes],
    }


def change_json(change: Change) -> dict[str, Any]:
    """A change since the calibration as a JSON object."""
    return {
        name: getattr(change, name) for name in ("recording", "name", "before", "after", "std", "unit", "probability")
    }


def cause_json(cause: InputFault) -> dict[str, Any]:
    """A fault of the inputs that was compared, as a JSON object."""
    return {name: getattr(cause, name) for name in ("name", "sentence", "size", "innovations", "log_likelihood")}


def errors_json(errors: Errors) -> dict[str, float | None]:
    """Errors of a simulation as a JSON object."""
    return {
        "position_rms_m": errors.position_rms,
        "position_sse_m2": errors.position_sse,
        "pressure_a_rms_Pa": errors.pressure_a_rms,
        "pressure_a_sse_Pa2": errors.pressure_a_sse,
    }


def verdict_json(fit: Fit) -> dict[str, Any]:
    """The verdict on a fit and its evidence as plain values."""
    basis, judged = evidence(fit), verdict(fit)
    return {
        "trust": judged.trust,
        "reasons": list(judged.reasons),
        "unseen": list(judged.unseen),
        "notes": list(judged.notes),
        "experience": judged.experience or None,
        "noise_only": judged.noise_only,
        "diagnostics": {
            name: {
                "position_fit_over_1_s_percent": basis.predictions[name],
                **{column: _column_json(values) for column, values in diagnosis.columns.items()},
                "remarks": remarks(diagnosis),
            }
            for name, diagnosis in basis.diagnoses.items()
        },
        "missing": list(basis.missing),
    }


def _column_json(column: ColumnDiagnosis) -> dict[str, Any]:
    lags = max((column.fast, column.slow), key=lambda rate: np.nan_to_num(rate.share_outside))
    return {
        "samples": column.samples,
        "fit_percent": column.fit_percent,
        "rms": column.rms,
        "mean": column.mean,
        "effective_samples": column.effective_samples,
        "share_of_lags_outside": lags.share_outside,
        "inputs": {name: _strongest_json(rate) for name, rate in column.fast.inputs.items()},
    }


def _strongest_json(input_: CrossCorrelation) -> dict[str, float]:
    return {"lag_s": input_.strongest_lag, "correlation": input_.strongest, "bound": input_.strongest_bound}
