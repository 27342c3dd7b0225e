"""Section ``[fit.calibration]`` of a parameter file: the result of a calibration for later fits."""

from __future__ import annotations

from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.log import FloatArray
from clutchid.uncertainty.calibration import Calibration, Score


def calibration_section(kept: Calibration) -> dict[str, Any]:
    """Entries of a calibration."""
    section: dict[str, Any] = {
        "names": list(kept.names),
        "covariance": kept.covariance.tolist(),
        "bias": list(kept.bias),
    }
    if kept.score is not None:
        section["score"] = {
            "names": list(kept.score.names),
            "shift": kept.score.shift.tolist(),
            "covariance": kept.score.covariance.tolist(),
        }
    return section


def calibration_in(section: Any, weights: int, method: str) -> Calibration:
    """The calibration in a file by `method`, for a load with `weights` weights; earlier versions have no score.

    Raises
    ------
    ParameterError
        If an entry cannot be understood.
    """
    try:
        names, covariance = _numbers(section)
        bias = tuple(map(float, section["bias"]))
    except (KeyError, TypeError, ValueError) as error:
        raise ParameterError(
            "[fit.calibration]: names, a square covariance and bias are needed; save the calibration again."
        ) from error
    if len(bias) not in (0, weights):
        raise ParameterError(f"[fit.calibration] bias: {len(bias)} numbers for {weights} load weights.")
    score = _score(section["score"]) if "score" in section else None
    return Calibration(names, covariance, bias, method=method, score=score)


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
