"""Square-root information smoother for a chain of states with shared parameters (Bierman 1974).

Linear least squares in x_0 ... x_n and theta, with rows in x_i and theta, and link rows in x_i, x_{i+1} and theta. The
states are eliminated one by one by orthogonal transformations, which leaves a triangular system in theta, whatever the
length of the chain; back-substitution recovers the states.
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
    """An eliminated chain: the remaining `rows` ``[theta | r]``, and `state_rows` for the back-substitution.

    `state_rows`, shape (windows, n, 2 n + k + 1), are ``[x_i | x_{i+1} | theta | r]``, upper triangular in x_i.
    """

    rows: FloatArray
    state_rows: FloatArray


def eliminate(first: FloatArray, windows: FloatArray, links: FloatArray) -> Eliminated:
    """Eliminate the states of a chain.

    Each elimination passes only the rows that involve the next state on to the next step; the rows in theta alone are
    collected. So the size of a step depends on the number of states, not on the number of parameters.

    Parameters
    ----------
    first : (n, n + k + 1)
        Rows in x_0 and theta, with the residual last; as many rows as states.
    windows : (windows, m, n + k + 1)
        Rows in x_i and theta.
    links : (windows - 1, n, 2 n + k + 1)
        Rows in x_i, x_{i+1} and theta.
    """
    n, width = first.shape
    state_rows = np.empty((windows.shape[0], n, n + width))
    theta_rows = np.empty((windows.shape[0], windows.shape[1] + n, width - n))
    kernels_in(_KERNELS).eliminate(first, windows, links, state_rows, theta_rows)
    return Eliminated(triangular(theta_rows.reshape(-1, width - n)), state_rows)


def recover(chain: Eliminated, theta: FloatArray, noise: FloatArray | None = None) -> FloatArray:
    """States for given `theta` by back-substitution, shape (windows, n, m) for theta of shape (k, m).

    With standard normal `noise`, shape (windows, n, m): draws from the distribution of the states given theta.

    Raises
    ------
    LinAlgError
        If the chain does not determine its states.
    """
    n = chain.state_rows.shape[1]
    states = -chain.state_rows[:, :, -1:] - chain.state_rows[:, :, 2 * n : -1] @ theta
    if noise is not None:
        states += noise
    if not kernels_in(_KERNELS).substitute(chain.state_rows, states):
        raise np.linalg.LinAlgError("the chain does not determine its states.")
    return states
