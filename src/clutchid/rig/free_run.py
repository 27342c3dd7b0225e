"""LuGre friction in free-run simulation: force from the measured position, with exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from clutchid.log import HOLE, FloatArray, Log
from clutchid.rig.compiled import NAMES, kernels
from clutchid.signals.runs import runs
from clutchid.signals.velocity import velocity

#: Parameters that affect the deflection; the others affect the force only.
_IN_RATE = ("F_C", "K_z")

#: Least number of samples of a segment.
_FEWEST = 10


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Samples `start` to `stop` (exclusive) without a hole: velocity in m/s, intervals in s, sub-steps per interval."""

    start: int
    stop: int
    velocity: FloatArray
    dt: FloatArray
    substeps: NDArray[np.int32]

    def __len__(self) -> int:
        return self.stop - self.start


def segments(log: Log, window: float, shortest: float) -> list[Segment]:
    """Divide a recording into segments; a hole in time or a missing position ends a segment.

    Parameters
    ----------
    log : Log
        With a position in m.
    window : s
        Half window of the velocity: difference of the mean positions after and before a sample.
    shortest : m
        Smallest F_C / K_z that will be simulated; determines the number of sub-steps.
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
                found.append(_segment(log, (start, stop), window, shortest))
    return found


def _segment(log: Log, ends: tuple[int, int], window: float, shortest: float) -> Segment:
    time, position = log.time[slice(*ends)], log["position"][slice(*ends)]
    v, dt = velocity(time, position, window), np.diff(time)
    # the deflection decays at rate |v| K_z / F_C; RK4 has an error of 1e-2 per step at h |v| K_z / F_C = 1, is stable
    # to 2.8
    stiffest = np.abs(v[:-1] + v[1:]) / 2 * dt / shortest
    return Segment(*ends, v, dt, np.maximum(1, np.ceil(stiffest)).astype(np.int32))


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
    Within an interval the velocity is constant at the mean of its ends.
    """
    module, n, v = kernels(), len(segment), segment.velocity
    p = np.array(values, dtype=np.float64)
    mean = np.append((v[:-1] + v[1:]) / 2, 0.0)[:, None]
    slots = [(slot, row, _IN_RATE.index(NAMES[q])) for slot, (row, q) in enumerate(module.SLOTS)]
    fill = [np.ascontiguousarray(column) for column in np.array(slots, dtype=np.int64).T]
    z, sens = np.empty((n, 1)), np.empty((n, 1, 3))
    module.run_all(
        np.array([z_start]), np.array([[0.0, 0.0, 1.0]]), mean, p, segment.dt, segment.substeps,
        np.zeros(n, dtype=np.uint8), np.zeros((n, 0)), *fill, np.zeros(1, dtype=np.int64), z, sens,
    )  # fmt: skip
    z = np.ascontiguousarray(z[:, 0])
    to_z = module.force_z(v, z, *p)
    jacobian = np.column_stack([*(getattr(module, f"force_{name}")(v, z, *p) for name in NAMES), np.zeros(n)])
    for column, of in ((NAMES.index("F_C"), 0), (NAMES.index("K_z"), 1), (len(NAMES), 2)):
        jacobian[:, column] += to_z * sens[:, 0, of]
    return module.force(v, z, *p), jacobian
