"""LuGre friction in free-run simulation: force from the measured position, with exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from clutchid.log import HOLE, FloatArray, Log
from clutchid.recordings.signals.sampled import runs, velocity
from clutchid.rig.compiled import NAMES, kernels

#: Least number of samples of a segment.
_FEWEST = 10


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Samples `start` to `stop` (exclusive) without a hole: velocity in m/s, and intervals in s."""

    start: int
    stop: int
    velocity: FloatArray
    dt: FloatArray

    def __len__(self) -> int:
        return self.stop - self.start


def segments(log: Log, window: float) -> list[Segment]:
    """Divide a recording into segments; a hole in time or a missing position ends a segment.

    Parameters
    ----------
    log : Log
        With a position in m.
    window : s
        Half window of the velocity: difference of the mean positions after and before a sample.
    """
    position = log["position"]
    apart = np.zeros(len(log), dtype=bool)
    if len(log) > 1:
        steps = np.diff(log.time)
        apart[1:] = steps > HOLE * np.median(steps)
    found = []
    for first, last in runs(np.isfinite(position)):
        edges = [first, *(first + 1 + np.flatnonzero(apart[first + 1 : last])).tolist(), last]
        for start, stop in pairwise(edges):
            if stop - start >= _FEWEST:
                found.append(_segment(log, (start, stop), window))
    return found


def _segment(log: Log, ends: tuple[int, int], window: float) -> Segment:
    time, position = log.time[slice(*ends)], log["position"][slice(*ends)]
    return Segment(*ends, velocity(time, position, window), np.diff(time))


def free_run(segment: Segment, values: Sequence[float], z_start: float) -> tuple[FloatArray, FloatArray]:
    """Friction force in N over a segment, and its derivatives with respect to `NAMES` and to the initial deflection.

    Parameters
    ----------
    values : Sequence[float]
        F_C (N), K_z (N/m), D_v and D_zdot (N·s/m).
    z_start : m
        Deflection at the first sample.

    Returns
    -------
    force : (n,)
    jacobian : (n, 5)

    Notes
    -----
    Within an interval the velocity is constant at the mean of its ends, for which the deflection is exact at any
    stiffness.
    """
    from scipy.linalg import solve_banded

    module, n, v = kernels(), len(segment), segment.velocity
    p = np.array(values, dtype=np.float64)
    interval = ((v[:-1] + v[1:]) / 2, segment.dt, *p[:2])
    decay = module.decay(*interval)
    band = np.vstack([np.ones(n), np.append(-decay, 0.0)])

    def run(first: float, driven: FloatArray) -> FloatArray:
        """Solution of z[k+1] = decay[k] z[k] + driven[k] from z[0] = first."""
        solution: FloatArray = solve_banded((1, 0), band, np.append(first, driven))
        return solution

    z = run(z_start, module.gain(*interval))
    to_z = module.force_z(v, z, *p)
    jacobian = np.column_stack([*(getattr(module, f"force_{name}")(v, z, *p) for name in NAMES), np.zeros(n)])
    for column, name in enumerate(NAMES[:2]):
        driven = getattr(module, f"decay_{name}")(*interval) * z[:-1] + getattr(module, f"gain_{name}")(*interval)
        jacobian[:, column] += to_z * run(0.0, driven)
    jacobian[:, len(NAMES)] += to_z * run(1.0, np.zeros(n - 1))
    return module.force(v, z, *p), jacobian
