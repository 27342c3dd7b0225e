"""Section ``[fit.calibration]`` of a parameter file: the result of a calibration for later fits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.uncertainty.calibration import Calibration, Origin, Score


def calibration_section(kept: Calibration, baseline: Calibration | None = None) -> dict[str, Any]:
    """Entries of a calibration in the file of a fit that started from `baseline`.

    If it is that one, the new file is not its origin.
    """
    section: dict[str, Any] = {
        "names": list(kept.names),
        "covariance": kept.covariance.tolist(),
        "bias": list(kept.bias),
        "converged": kept.converged,
    }
    if kept.theta:
        section |= {"theta": list(kept.theta), "theta_covariance": kept.theta_covariance.tolist()}
    origin = Origin() if kept.origin is None and kept is baseline else kept.origin
    if origin is not None:
        section["origin"] = origin._asdict()
    if kept.score is not None:
        section["score"] = {
            "names": list(kept.score.names),
            "shift": kept.score.shift.tolist(),
            "covariance": kept.score.covariance.tolist(),
        }
    return section


def calibration_in(section: Any, weights: int, method: str, file: Origin) -> Calibration:
    """The calibration in a `file` by `method`, for a load with `weights` weights.

    Earlier versions have no score, no load, and say neither how the search ended nor where the calibration is from.

    Raises
    ------
    ParameterError
        If an entry cannot be understood.
    """
    try:
        names, covariance = _numbers(section)
        bias = tuple(map(float, section["bias"]))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ParameterError(
            "[fit.calibration]: names, a square covariance and bias are needed; save the calibration again."
        ) from error
    theta, spread = _load(section)
    for name, numbers in (("bias", bias), ("theta", theta)):
        if len(numbers) not in (0, weights):
            raise ParameterError(f"[fit.calibration] {name}: {len(numbers)} numbers for {weights} load weights.")
    score = _score(section["score"]) if "score" in section else None
    converged = section.get("converged", True) is not False
    origin = file._replace(**text_entries(section.get("origin"), Origin._fields))
    return Calibration(names, covariance, bias, None, method, score, theta, spread, converged=converged, origin=origin)


def text_entries(section: Any, known: Iterable[str]) -> dict[str, str]:
    """The `known` entries of a section, those that are text."""
    entries = section if isinstance(section, Mapping) else {}
    return {name: entries[name] for name in known if isinstance(entries.get(name), str)}


def _load(section: Any) -> tuple[tuple[float, ...], FloatArray]:
    """Calibrated load weights and their covariance."""
    try:
        theta = tuple(map(float, section.get("theta", ())))
        covariance = np.array(section.get("theta_covariance", []), dtype=np.float64).reshape(len(theta), len(theta))
        known = bool(np.isfinite(theta).all()) and not np.isnan(covariance).any()
    except (AttributeError, TypeError, ValueError, OverflowError):
        known = False
    if not known:
        raise ParameterError(
            "[fit.calibration] theta: finite load weights and their square theta_covariance are needed; save the "
            "calibration again."
        )
    return theta, covariance


def _score(section: Any) -> Score:
    try:
        names, covariance = _numbers(section)
        return Score(names, np.array(section["shift"], dtype=np.float64).reshape(len(names)), covariance)
    except (KeyError, TypeError, ValueError) as error:
        raise ParameterError(
            "[fit.calibration.score]: names, a shift for each and their square covariance are needed; save the "
            "calibration again."
        ) from error


def _numbers(section: Any) -> tuple[tuple[str, ...], FloatArray]:
    names = tuple(map(str, section["names"]))
    return names, np.array(section["covariance"], dtype=np.float64).reshape(len(names), len(names))
