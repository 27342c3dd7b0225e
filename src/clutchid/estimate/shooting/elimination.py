"""Square-root elimination of a chain of unknown states that neighbours and shared parameters tie together.

Least squares over x_0 ... x_n and theta, with rows on x_i and theta, and links between x_i, x_{i+1} and theta. Each
state is eliminated by an orthogonal transformation, so what is left of a chain of any length are as many rows on theta
as theta has numbers; back-substitution recovers the states: the square-root information smoother (Bierman 1974).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from clutchid.estimate.least_squares import triangular
from clutchid.log import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Eliminated:
    """What is left of a chain: `rows` on theta, ``[theta | r]``, and for each state its own rows, to recover it."""

    rows: FloatArray
    own: tuple[FloatArray, ...]


def eliminate(first: FloatArray, own: Sequence[FloatArray], links: Sequence[FloatArray], states: int) -> Eliminated:
    """Eliminate the states of a chain.

    Of what is left after each state only the rows on the next one are carried on, so a step costs as many rows as there
    are states, however many numbers theta has.

    Parameters
    ----------
    first : (m, states + k + 1)
        Rows on x_0 and theta, with the residual last.
    own : n of (m_i, states + k + 1)
        Rows on x_i and theta.
    links : n - 1 of (m_i, 2 states + k + 1)
        Rows on x_i, x_{i+1} and theta.

    Raises
    ------
    Nothing: a chain that does not determine its states gives singular rows in `Eliminated.own`.
    """
    carried, kept, left = first, [], []
    for rows, link in zip(own, links, strict=False):
        above = carried.shape[0] + rows.shape[0]
        stacked = np.zeros((above + link.shape[0], link.shape[1]))
        for at, part in ((0, carried), (carried.shape[0], rows)):
            stacked[at : at + part.shape[0], :states] = part[:, :states]
            stacked[at : at + part.shape[0], 2 * states :] = part[:, states:]
        stacked[above:] = link
        factor = triangular(stacked)
        kept.append(factor[:states])
        carried = factor[states : 2 * states, states:]
        left.append(factor[2 * states :, 2 * states :])
    factor = triangular(np.vstack([carried, own[-1]]))
    kept.append(factor[:states])
    return Eliminated(triangular(np.vstack([*left, factor[states:, states:]])), tuple(kept))


def recover(chain: Eliminated, theta: FloatArray, noise: Sequence[FloatArray] | None = None) -> FloatArray:
    """States that belong to `theta`, shape (n, states, m) for theta of shape (k, m), from the last to the first.

    With `noise`, n of (states, m), standard normal: draws from the distribution of the states given theta.

    Raises
    ------
    LinAlgError
        If the chain does not determine its states.
    """
    states = chain.own[0].shape[0]
    found = np.empty((len(chain.own), states, theta.shape[1]))
    for i in reversed(range(len(chain.own))):
        row = chain.own[i]
        right = -row[:, -1:] - row[:, -1 - theta.shape[0] : -1] @ theta
        if i < len(chain.own) - 1:
            right = right - row[:, states : 2 * states] @ found[i + 1]
        if noise is not None:
            right = right + noise[i]
        found[i] = np.linalg.solve(row[:, :states], right)
    return found
