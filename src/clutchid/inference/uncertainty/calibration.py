"""`Calibration`: the part of a fit with pressure that later fits of the same actuator without pressure use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from clutchid.inference.uncertainty.conditions import NOT_RECORDED, Conditions
from clutchid.log import FloatArray
from clutchid.recordings.strokes.vented_rest import VentedRest


@dataclass(frozen=True, slots=True, eq=False)
class PositionOnlyErrors:
    """Errors of fits to position alone of the calibration recordings, relative to the calibration with pressure.

    Where the model errs, such a fit finds another load, and seems to find changes, although nothing has changed. One
    row a hypothesis of `clutchid.inference.uncertainty.change_prior`: only the difference to it is a change.

    Parameters
    ----------
    hypotheses : several groups each
        That were assumed to have changed; the first is none.
    names
        Load weights and parameters that were free.
    shifts : (hypotheses, k)
        Errors of `names`: shares of the value, or in the parameter's unit if it may be 0; load weights in their unit.
    log_evidence : (hypotheses,)
        Logarithm of the evidence.
    dispersion : 1
        See `clutchid.inference.smoother.residuals`.
    misfit : 1/s
        Cost for each second in motion, without a change; NaN if it is not known.
    """

    hypotheses: tuple[tuple[str, ...], ...]
    names: tuple[str, ...]
    shifts: FloatArray
    log_evidence: FloatArray
    dispersion: float = 1.0
    misfit: float = float("nan")

    def shift(self, hypothesis: tuple[str, ...], names: Sequence[str]) -> FloatArray:
        """Errors of `names` under a hypothesis, 0 where they are not known."""
        if hypothesis not in self.hypotheses:
            hypothesis = self.hypotheses[0]
        known = dict(zip(self.names, self.shifts[self.hypotheses.index(hypothesis)].tolist(), strict=True))
        return np.array([known.get(name, 0.0) for name in names])

    def evidence(self, hypothesis: tuple[str, ...]) -> float:
        """Logarithm of the evidence of a hypothesis against that of no change; 0 if it is not known."""
        if hypothesis not in self.hypotheses:
            return 0.0
        return float(self.log_evidence[self.hypotheses.index(hypothesis)] - self.log_evidence[0])


class Origin(NamedTuple):
    """Where a calibration is from: name of its file, time of its creation (ISO 8601), SHA-256, and trust in it.

    What an older file does not say is empty.
    """

    name: str = ""
    created: str = ""
    sha256: str = ""
    trust: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Uncertainty and corrections of a calibrated actuator.

    Parameters
    ----------
    names, covariance
        Calibrated parameters and their covariance in SI, shape (k, k). They are fixed in later fits, as consider
        parameters.
    data : {name: hash}
        The calibration recordings.
    method : 'shooting' or 'prediction-error'
        Method of the calibration; the errors of fits to position alone belong to it.
    position_only : PositionOnlyErrors, optional
        Errors of fits to position alone, which are subtracted in later fits; None if there was no pressure.
    theta, theta_covariance
        Calibrated load weights and their covariance in SI, shape (m, m); empty if an older file lacks them.
    converged
        Whether the search of the calibration converged.
    origin : Origin, optional
        Its file, if it is from one.
    conditions : Conditions
        Of the calibration recordings, where the vehicle measures them.
    nis : 1
        Mean normalised innovation squared of an observer of the calibration recordings, NaN if it is not known.
    rest : VentedRest, optional
        Of the calibration recordings: where travel is counted from. None without a rest, or in an older file.
    """

    names: tuple[str, ...]
    covariance: FloatArray
    data: Mapping[str, str] | None = None
    method: str = "shooting"
    position_only: PositionOnlyErrors | None = None
    theta: tuple[float, ...] = ()
    theta_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    converged: bool = True
    origin: Origin | None = None
    conditions: Conditions = NOT_RECORDED
    nis: float = float("nan")
    rest: VentedRest | None = None

    def covariance_of(self, names: tuple[str, ...]) -> FloatArray:
        """Covariance of `names`; 0 for those that were not calibrated."""
        at = [self.names.index(name) if name in self.names else -1 for name in names]
        full = np.zeros((len(names), len(names)))
        known = [i for i, place in enumerate(at) if place >= 0]
        places = [at[i] for i in known]
        full[np.ix_(known, known)] = self.covariance[np.ix_(places, places)]
        return full
