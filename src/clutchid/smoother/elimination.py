"""Square-root elimination of a chain of unknown states that neighbours and shared parameters tie together.

Least squares over x_0 ... x_n and theta, with rows on x_i and theta, and links between x_i, x_{i+1} and theta. Each
state is eliminated by an orthogonal transformation, so what is left of a chain of any length are as many rows on theta
as theta has numbers; back-substitution recovers the states: the square-root information smoother (Bierman 1974).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.log import FloatArray
from clutchid.numerics.least_squares import triangular

_KERNELS = "clutchid.numerics.householder"


@dataclass(frozen=True, slots=True, eq=False)
class Eliminated:
    """What is left of a chain: `rows` on theta, ``[theta | r]``, and for each state its own rows, to recover it.

    `own` (windows, n, 2 n + k + 1) are rows ``[x_i | x_{i+1} | theta | r]``, upper triangular in x_i.
    """

    rows: FloatArray
    own: FloatArray


def eliminate(first: FloatArray, own: FloatArray, links: FloatArray) -> Eliminated:
    """Eliminate the states of a chain.

    Of what is left after each state only the rows on the next one are carried on, so a step costs as many rows as there
    are states, however many numbers theta has.

    Parameters
    ----------
    first : (n, n + k + 1)
        Rows on x_0 and theta, with the residual last; as many as there are states.
    own : (windows, m, n + k + 1)
        Rows on x_i and theta.
    links : (windows - 1, n, 2 n + k + 1)
        Rows on x_i, x_{i+1} and theta.
    """
    n, width = first.shape
    kept = np.empty((own.shape[0], n, n + width))
    left = np.empty((own.shape[0], own.shape[1] + n, width - n))
    kernels_in(_KERNELS).eliminate(first, own, links, kept, left)
    return Eliminated(triangular(left.reshape(-1, width - n)), kept)


def recover(chain: Eliminated, theta: FloatArray, noise: FloatArray | None = None) -> FloatArray:
    """States that belong to `theta`, shape (windows, n, m) for theta of shape (k, m), from the last to the first.

    With `noise`, (windows, n, m), standard normal: draws from the distribution of the states given theta.

    Raises
    ------
    LinAlgError
        If the chain does not determine its states.
    """
    n = chain.own.shape[1]
    found = -chain.own[:, :, -1:] - chain.own[:, :, 2 * n : -1] @ theta
    if noise is not None:
        found += noise
    if not kernels_in(_KERNELS).substitute(chain.own, found):
        raise np.linalg.LinAlgError("the chain does not determine its states.")
    return found
