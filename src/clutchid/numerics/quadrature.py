"""Gaussian quadrature."""

import numpy as np

from clutchid.log import FloatArray


def normal_nodes(count: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of expectations over the standard normal distribution (Gauss and Hermite), (count,) each."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return np.asarray(nodes), np.asarray(weights / weights.sum())
