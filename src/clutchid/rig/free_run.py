"""LuGre friction in free run: from the measured position to the force, with exact derivatives."""

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

#: Parameters that the deflection itself depends on; the others stand in the force only.
_IN_RATE = ("F_C", "K_z")

#: A piece with fewer samples than this says nothing.
_FEWEST = 10


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Samples `start` to `stop` (exclusive) without a hole: velocity in m/s, intervals in s, steps an interval."""

    start: int
    stop: int
    velocity: FloatArray
    dt: FloatArray
    substeps: NDArray[np.int32]

    def __len__(self) -> int:
        return self.stop - self.start


def pieces(log: Log, window: float, shortest: float) -> list[Piece]:
    """The pieces of a recording: a hole in time or a missing position ends one.

    Parameters
    ----------
    log : Log
        With a position in m.
    window : s
        The velocity is the difference of the mean positions over this time after and before a sample.
    shortest : m
        Shortest F_C / K_z that will be simulated; sub-steps follow it.
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
                found.append(_piece(log, (start, stop), window, shortest))
    return found


def _piece(log: Log, ends: tuple[int, int], window: float, shortest: float) -> Piece:
    time, position = log.time[slice(*ends)], log["position"][slice(*ends)]
    v, dt = velocity(time, position, window), np.diff(time)
    # the deflection forgets at |v| K_z / F_C; RK4 is exact to 1e-2 of a step at h |v| K_z / F_C = 1 and stable to 2.8
    stiffest = np.abs(v[:-1] + v[1:]) / 2 * dt / shortest
    return Piece(*ends, v, dt, np.maximum(1, np.ceil(stiffest)).astype(np.int32))


def free_run(piece: Piece, values: Sequence[float], z_start: float) -> tuple[FloatArray, FloatArray]:
    """Friction in N over a piece, and its derivatives to the parameters `NAMES` and to the start.

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
    Over an interval the velocity is held at the mean of its ends.
    """
    module, n, v = kernels(), len(piece), piece.velocity
    p = np.array(values, dtype=np.float64)
    held = np.append((v[:-1] + v[1:]) / 2, 0.0)[:, None]
    slots = [(slot, row, _IN_RATE.index(NAMES[q])) for slot, (row, q) in enumerate(module.SLOTS)]
    fill = [np.ascontiguousarray(column) for column in np.array(slots, dtype=np.int64).T]
    z, sens = np.empty((n, 1)), np.empty((n, 1, 3))
    module.run_all(
        np.array([z_start]), np.array([[0.0, 0.0, 1.0]]), held, p, piece.dt, piece.substeps,
        np.zeros(n, dtype=np.uint8), np.zeros((n, 0)), *fill, np.zeros(1, dtype=np.int64), z, sens,
    )  # fmt: skip
    z = np.ascontiguousarray(z[:, 0])
    to_z = module.force_z(v, z, *p)
    jacobian = np.column_stack([*(getattr(module, f"force_{name}")(v, z, *p) for name in NAMES), np.zeros(n)])
    for column, of in ((NAMES.index("F_C"), 0), (NAMES.index("K_z"), 1), (len(NAMES), 2)):
        jacobian[:, column] += to_z * sens[:, 0, of]
    return module.force(v, z, *p), jacobian
