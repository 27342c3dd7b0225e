"""Information about parameters in square-root form, and the natural sizes that make it dimensionless."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.numerics.least_squares import triangular

#: Natural size of a load weight by its unit.
WEIGHT_SIZES = {"N/m": 1e5, "N": 1e3}


def natural_sizes(actuator: Actuator, names: Sequence[str]) -> FloatArray:
    """Sizes in SI that make parameters of order one: those of load weights, and the values of all others."""
    weight = WEIGHT_SIZES[actuator.load.unit]
    return np.array([weight if n in actuator.load.names else abs(actuator.value(n)) or 1.0 for n in names])


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    r"""Information matrix :math:`R^T R` of the parameters `names`, as its square root.

    Parameters
    ----------
    names : names
        Of the columns of R.
    R : (m, k)
        Each row is the derivative of a residual of standard deviation 1 with respect to the parameters in their natural
        sizes. A column of zeros: there is no information about that parameter.
    """

    names: tuple[str, ...]
    R: FloatArray

    @classmethod
    def of_covariance(cls, names: Sequence[str], covariance: FloatArray, sizes: FloatArray) -> Information:
        """The inverse of a covariance in SI, shape (k, k); there is no information where a variance is infinite.

        Directions whose variance is below rounding get the information of rounding.
        """
        known = np.flatnonzero((np.diag(covariance) > 0.0) & (np.diag(covariance) < np.inf))
        R = np.zeros((len(names), len(names)))
        if known.size:
            at = np.ix_(known, known)
            std, values, vectors = spectrum(covariance[at])
            floor = np.finfo(float).eps * known.size * values[-1]
            R[at] = (vectors / np.sqrt(np.maximum(values, floor))).T / std * sizes[known]
        return cls(tuple(names), R)

    @property
    def known(self) -> tuple[str, ...]:
        """Parameters about which there is any information."""
        return tuple(name for name, column in zip(self.names, self.R.T, strict=True) if np.any(column != 0.0))

    def columns(self, names: Sequence[str]) -> FloatArray:
        """Columns of R."""
        return self.R[:, [self.names.index(name) for name in names]]

    def marginal(self, names: Sequence[str]) -> Information:
        """Information about `names` if all others are unknown.

        What remains of the columns of `names` is orthogonal to all columns of the others, also if those are dependent.
        """
        columns, others = self.columns(names), self.columns([name for name in self.names if name not in names])
        U, s, _ = np.linalg.svd(others, full_matrices=False)
        Q = U[:, s > max(others.shape) * np.finfo(float).eps * s.max(initial=0.0)]
        return Information(tuple(names), triangular(columns - Q @ (Q.T @ columns)))

    def plus(self, rows: FloatArray) -> Information:
        """With the information of further residuals, `rows` (m, k)."""
        return Information(self.names, triangular(np.vstack([self.R, rows])))

    def standard_errors(self) -> FloatArray:
        """Standard errors in natural sizes, shape (k,).

        Raises
        ------
        numpy.linalg.LinAlgError
            If a parameter is not determined.
        """
        inverse = np.linalg.inv(triangular(self.R))
        result: FloatArray = np.sqrt(np.sum(inverse**2, axis=1))
        return result

    def nats(self) -> float:
        """Half the logarithm of the determinant."""
        return float(np.sum(np.log(np.abs(np.diag(triangular(self.R))))))


def spectrum(covariance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Standard errors, and eigenvalues (ascending) and eigenvectors of the correlation matrix."""
    std = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(std, std))
    return std, values, vectors
