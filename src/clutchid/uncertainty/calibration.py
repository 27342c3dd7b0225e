"""`Calibration`: the part of a fit with pressure that later fits of the same actuator without pressure use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from clutchid.log import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """Change of fixed parameters if they were free: one Gauss-Newton step from the solution of a search.

    `shift` (k,) and its `covariance` (k, k) are relative to the value, or in the parameter's unit if it may be 0.
    """

    names: tuple[str, ...]
    shift: FloatArray
    covariance: FloatArray

    def of(self, names: Sequence[str]) -> Score:
        """The score of `names` with all others fixed.

        Raises
        ------
        ValueError
            If a name is not in this score.
        """
        at = [self.names.index(name) for name in names]
        information = np.linalg.inv(self.covariance)
        covariance = np.linalg.inv(information[np.ix_(at, at)])
        return Score(tuple(names), covariance @ (information @ self.shift)[at], covariance)


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
    bias : N
        Error of the load weights in a fit to position alone of the calibration recordings, relative to the fit with
        pressure; it is subtracted in later fits.
    data : {name: hash}
        The calibration recordings.
    method : 'shooting' or 'prediction-error'
        Method of the calibration; bias and score belong to it.
    score : Score, optional
        Change of fixed parameters in a fit to position alone of the calibration recordings.
    theta, theta_covariance
        Calibrated load weights and their covariance in SI, shape (m, m); empty if an older file lacks them.
    converged
        Whether the search of the calibration converged.
    origin : Origin, optional
        Its file, if it is from one.
    """

    names: tuple[str, ...]
    covariance: FloatArray
    bias: tuple[float, ...] = ()
    data: Mapping[str, str] | None = None
    method: str = "shooting"
    score: Score | None = None
    theta: tuple[float, ...] = ()
    theta_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    converged: bool = True
    origin: Origin | None = None

    def inflated(self, names: tuple[str, ...], covariance: FloatArray) -> Calibration:
        """The same with the `covariance` of `names` in SI, shape (k, k), added."""
        known = tuple(dict.fromkeys((*self.names, *names)))
        at = [known.index(name) for name in names]
        wider = self.covariance_of(known)
        wider[np.ix_(at, at)] += covariance
        return replace(self, names=known, covariance=wider)

    def covariance_of(self, names: tuple[str, ...]) -> FloatArray:
        """Covariance of `names`; 0 for those that were not calibrated."""
        at = [self.names.index(name) if name in self.names else -1 for name in names]
        full = np.zeros((len(names), len(names)))
        known = [i for i, place in enumerate(at) if place >= 0]
        places = [at[i] for i in known]
        full[np.ix_(known, known)] = self.covariance[np.ix_(places, places)]
        return full
