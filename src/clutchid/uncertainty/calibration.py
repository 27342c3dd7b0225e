"""`Calibration`: what a fit with pressure leaves to fits of the same actuator without one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from clutchid.log import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """Where numbers that are held would go if they were free: by one Gauss-Newton step from the end of a search.

    `shift` (k,) and its `covariance` (k, k) are shares of the value, or in the number's own unit where it may be 0.
    """

    names: tuple[str, ...]
    shift: FloatArray
    covariance: FloatArray

    def of(self, names: Sequence[str]) -> Score:
        """The score of `names` where all others stay held.

        Raises
        ------
        ValueError
            If a name is not of this score.
        """
        at = [self.names.index(name) for name in names]
        information = np.linalg.inv(self.covariance)
        covariance = np.linalg.inv(information[np.ix_(at, at)])
        return Score(tuple(names), covariance @ (information @ self.shift)[at], covariance)


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """What is known of an actuator besides its values.

    Parameters
    ----------
    names, covariance
        Calibrated parameters and their covariance in SI, shape (k, k): they are not estimated again, but their
        uncertainty is counted in what is.
    bias : N
        What a fit to the position alone misses of the load weights on the calibration recordings, where the pressure
        tells the truth; it is taken off later fits.
    data : {name: hash}
        The calibration recordings.
    method : 'shooting' or 'prediction-error'
        How it was made; bias and score are of this method.
    score : Score, optional
        Where position alone would move numbers that may change later, on the calibration recordings.
    """

    names: tuple[str, ...]
    covariance: FloatArray
    bias: tuple[float, ...] = ()
    data: Mapping[str, str] | None = None
    method: str = "shooting"
    score: Score | None = None

    def less_sure(self, names: tuple[str, ...], covariance: FloatArray) -> Calibration:
        """The same with the `covariance` of `names` in SI, shape (k, k), added to what is known of them."""
        known = tuple(dict.fromkeys((*self.names, *names)))
        at = [known.index(name) for name in names]
        wider = self.covariance_of(known)
        wider[np.ix_(at, at)] += covariance
        return replace(self, names=known, covariance=wider)

    def covariance_of(self, names: tuple[str, ...]) -> FloatArray:
        """Covariance of `names`, 0 where a name was not calibrated."""
        at = [self.names.index(name) if name in self.names else -1 for name in names]
        full = np.zeros((len(names), len(names)))
        known = [i for i, place in enumerate(at) if place >= 0]
        places = [at[i] for i in known]
        full[np.ix_(known, known)] = self.covariance[np.ix_(places, places)]
        return full
