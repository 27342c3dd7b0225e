"""Section ``[fit.calibration]`` of a parameter file: the result of a calibration for later fits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.parameters import Parameters
from clutchid.strokes.vented_rest import VentedRest
from clutchid.uncertainty.calibration import Calibration, Origin, PositionOnlyErrors
from clutchid.uncertainty.conditions import Conditions

#: Correlations may differ from those of a covariance by as much: what rounding adds to a matrix of ill condition.
ROUNDING = 1e-6

#: No standard deviation is larger, in SI: ten times the largest admissible value, that of a stiffness.
LARGEST = 1e12


def calibration_section(kept: Calibration, baseline: Calibration | None = None) -> dict[str, Any]:
    """Entries of a calibration in the file of a fit that started from `baseline`.

    If it is that one, the new file is not its origin.
    """
    section: dict[str, Any] = {
        "names": list(kept.names),
        "covariance": kept.covariance.tolist(),
        "converged": kept.converged,
    }
    if kept.theta:
        section |= {"theta": list(kept.theta), "theta_covariance": kept.theta_covariance.tolist()}
    origin = Origin() if kept.origin is None and kept is baseline else kept.origin
    if origin is not None:
        section["origin"] = origin._asdict()
    conditions = {name: value for name, value in kept.conditions._asdict().items() if value is not None}
    if conditions:
        section["conditions"] = conditions
    if np.isfinite(kept.nis):
        section["nis"] = kept.nis
    if kept.rest is not None:
        section["rest"] = {name: value for name, value in kept.rest._asdict().items() if np.isfinite(value)}
    if kept.position_only is not None:
        section["position_only"] = _errors_section(kept.position_only)
    return section


def calibration_in(section: Any, load_names: Sequence[str], method: str, file: Origin) -> Calibration:
    """The calibration in a `file` by `method`, for a load with the weights `load_names`.

    Earlier versions have only the mean error of the load from position alone, no load, and say neither how the search
    ended nor where the calibration is from.

    Raises
    ------
    ParameterError
        If an entry cannot be understood.
    """
    try:
        names, covariance = _numbers(section)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ParameterError(
            "[fit.calibration]: names and a square covariance are needed; save the calibration again."
        ) from error
    if problem := _no_covariance(covariance, names):
        raise ParameterError(f"[fit.calibration] covariance: {problem}; save the calibration again.")
    theta, spread = _load(section, load_names)
    errors = _errors(section["position_only"]) if "position_only" in section else _older(section, load_names)
    converged = section.get("converged", True) is not False
    origin = file._replace(**text_entries(section.get("origin"), Origin._fields))
    conditions = _conditions(section.get("conditions", {}))
    return Calibration(
        names, covariance, None, method, errors, theta, spread, converged, origin, conditions,
        _nis(section.get("nis")), _rest(section.get("rest")),
    )  # fmt: skip


def _rest(section: Any) -> VentedRest | None:
    """Vented rest of the calibration recordings; earlier versions do not have it."""
    if section is None:
        return None
    known = isinstance(section, Mapping) and {"lowest", "quantum"} <= set(section) <= set(VentedRest._fields)
    if not known or not all(type(value) in (int, float) and np.isfinite(value) for value in section.values()):
        raise ParameterError(
            "[fit.calibration.rest]: finite levels lowest and returned, and quantum, in m, are needed; save the "
            "calibration again."
        )
    return VentedRest(*(float(section.get(name, "nan")) for name in VentedRest._fields))


def _nis(value: Any) -> float:
    """Usual innovations; earlier versions do not have them."""
    if value is None:
        return float("nan")
    if type(value) not in (int, float) or not 0.0 < value < np.inf:
        raise ParameterError(
            f"[fit.calibration] nis = {value!r}: a number above 0 is needed; save the calibration again."
        )
    return float(value)


def text_entries(section: Any, known: Iterable[str]) -> dict[str, str]:
    """The `known` entries of a section, those that are text."""
    entries = section if isinstance(section, Mapping) else {}
    return {name: entries[name] for name in known if isinstance(entries.get(name), str)}


def _load(section: Any, load_names: Sequence[str]) -> tuple[tuple[float, ...], FloatArray]:
    """Calibrated load weights and their covariance."""
    try:
        theta = tuple(map(float, section.get("theta", ())))
        covariance = np.array(section.get("theta_covariance", []), dtype=np.float64).reshape(len(theta), len(theta))
        known = bool(np.isfinite(theta).all())
    except (AttributeError, TypeError, ValueError, OverflowError):
        known = False
    if not known:
        raise ParameterError(
            "[fit.calibration] theta: finite load weights and their square theta_covariance are needed; save the "
            "calibration again."
        )
    weights = len(load_names)
    if len(theta) not in (0, weights):
        raise ParameterError(f"[fit.calibration] theta: {len(theta)} numbers for {weights} load weights.")
    if problem := _no_covariance(covariance, load_names[: len(theta)]):
        raise ParameterError(f"[fit.calibration] theta_covariance: {problem}; save the calibration again.")
    return theta, covariance


def _no_covariance(matrix: FloatArray, names: Sequence[str]) -> str:
    """Why a matrix is not the covariance of parameters in SI; empty if it may be one.

    A parameter that the data do not determine has an infinite variance and covariances of zero.
    """
    determined = np.flatnonzero(np.diag(matrix) != np.inf)
    matrix = matrix[np.ix_(determined, determined)]
    if not np.isfinite(matrix).all():
        return "has a value that is not finite"
    variances = np.diag(matrix)
    for index, variance in zip(determined.tolist(), variances.tolist(), strict=True):
        name = names[index]
        largest = Parameters.row(name).width if name in Parameters.names() else LARGEST
        if not 0.0 <= variance <= largest**2:
            return f"the variance of {name} is {variance:g}, from 0 to {largest**2:g} is possible"
    scale = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    correlations = matrix / scale / scale[:, None]
    if np.abs(correlations - correlations.T).max(initial=0.0) > ROUNDING:
        return "is not symmetric"
    if np.linalg.eigvalsh(correlations).min(initial=0.0) < -ROUNDING:
        return "has correlations beyond -1 to 1, or that exclude each other"
    return ""


def _conditions(section: Any) -> Conditions:
    """Conditions of the calibration recordings."""
    known = isinstance(section, Mapping) and set(section) <= set(Conditions._fields)
    if not known or not all(type(value) in (int, float) and 0.0 < value < np.inf for value in section.values()):
        raise ParameterError(
            "[fit.calibration.conditions]: temperature in K, supply and supply_estimated in Pa, above 0, are allowed; "
            "save the calibration again."
        )
    return Conditions(**{name: float(value) for name, value in section.items()})


def _errors_section(errors: PositionOnlyErrors) -> dict[str, Any]:
    return {
        "hypotheses": [list(groups) for groups in errors.hypotheses],
        "names": list(errors.names),
        "shifts": errors.shifts.tolist(),
        "log_evidence": errors.log_evidence.tolist(),
        "dispersion": errors.dispersion,
        **({"misfit": errors.misfit} if np.isfinite(errors.misfit) else {}),
    }


def _errors(section: Any) -> PositionOnlyErrors:
    try:
        hypotheses = tuple(tuple(map(str, groups)) for groups in section["hypotheses"])
        names = tuple(map(str, section["names"]))
        shifts = np.array(section["shifts"], dtype=np.float64).reshape(len(hypotheses), len(names))
        evidence = np.array(section["log_evidence"], dtype=np.float64).reshape(len(hypotheses))
        dispersion, misfit = float(section["dispersion"]), float(section.get("misfit", "nan"))
        finite = bool(np.isfinite(shifts).all() and np.isfinite(evidence).all())
        known = finite and 0.0 < dispersion < np.inf and not misfit <= 0.0
    except (KeyError, TypeError, ValueError, OverflowError):
        known = False
    if not known or len({*names}) < len(names) or len({*hypotheses}) < len(hypotheses) or hypotheses[:1] != ((),):
        raise ParameterError(
            "[fit.calibration.position_only]: hypotheses (the first empty), names, finite shifts of each name and "
            "log_evidence of each hypothesis, a dispersion and a misfit above 0 are needed; save the calibration again."
        )
    return PositionOnlyErrors(hypotheses, names, shifts, evidence, dispersion, misfit)


def _older(section: Any, load_names: Sequence[str]) -> PositionOnlyErrors | None:
    """Errors in a file of an earlier version, which has only the mean error of the load without a change."""
    bias = section.get("bias", [])
    if bias == []:
        return None
    try:
        shifts = np.array(bias, dtype=np.float64).reshape(1, len(load_names))
        known = bool(np.isfinite(shifts).all())
    except (TypeError, ValueError, OverflowError):
        known = False
    if not known:
        raise ParameterError(
            f"[fit.calibration] bias: {len(load_names)} finite numbers are needed, one for each load weight."
        )
    return PositionOnlyErrors(((),), tuple(load_names), shifts, np.zeros(1))


def _numbers(section: Any) -> tuple[tuple[str, ...], FloatArray]:
    names = tuple(map(str, section["names"]))
    return names, np.array(section["covariance"], dtype=np.float64).reshape(len(names), len(names))
