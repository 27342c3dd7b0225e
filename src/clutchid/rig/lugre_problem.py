"""The least-squares problem of a LuGre fit: numbers, scales, bounds, residuals and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import FloatArray, Log
from clutchid.numerics.least_squares import Linearisation, compress
from clutchid.rig.compiled import NAMES
from clutchid.rig.free_run import Piece, free_run, pieces

#: What a fit may hold fixed: the friction, and what the load cell shows without a load.
FREE = (*NAMES, "force_zero")

#: Bounds of F_C as multiples of half the range of the force, and of F_C / K_z as parts of the reach.
_FORCES, _DISTANCES = (0.25, 4.0), (0.0025, 10.0)

#: Correlation of force and velocity below which the sign of the force is wrong; a spring alone has 0.
_AGAINST = 0.1

#: Smaller changes of position (m) and force (N) are none.
_LEAST = (1e-10, 1e-10)

#: Samples that a fit of five numbers and a start asks for at least.
_FEWEST = 50


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What is fitted: pieces of a recording, and numbers in units of `unit`: those of `FREE`, then a start a piece."""

    log: Log
    parts: Sequence[Piece]
    unit: FloatArray
    low: FloatArray
    high: FloatArray
    free: NDArray[np.bool_]
    base: FloatArray

    def all(self, x: FloatArray) -> FloatArray:
        """All numbers in SI from the free ones in their units."""
        values = self.base.copy()
        values[self.free] = x
        return values * self.unit


def task_of(log: Log, fixed: Mapping[str, float], window: float) -> Task:
    """Scales and bounds from the ranges of position and force."""
    position, force = log["position"], log["force"]
    reach = float(np.nanmax(position) - np.nanmin(position))
    ends = np.nanquantile(force, [0.02, 0.98])
    strength = float(ends[1] - ends[0]) / 2
    if not (reach > _LEAST[0] and strength > _LEAST[1]):
        what = "position" if not reach > _LEAST[0] else "force"
        raise DataError(f"{log.name}: the {what} does not change; friction shows where the rig moves to and fro.")
    stiffest = fixed.get("K_z", strength / (_DISTANCES[0] * reach))
    parts = pieces(log, window, fixed.get("F_C", _FORCES[0] * strength) / stiffest)
    v = np.concatenate([piece.velocity for piece in parts]) if parts else np.zeros(0)
    f = np.concatenate([force[piece.start : piece.stop] for piece in parts]) if parts else np.zeros(0)
    both = np.isfinite(v) & np.isfinite(f)
    if both.sum() < _FEWEST:
        raise DataError(f"{log.name}: {both.sum()} samples with position and force; at least {_FEWEST} are needed.")
    _check_sign(log, v[both], f[both])
    speed = float(np.sqrt(np.mean(v[both] ** 2)))
    if not speed > 0.0:
        raise DataError(f"{log.name}: nothing moves where position and force are known together.")
    n = len(parts)
    unit = np.array([strength, 10 * strength / reach, *[strength / speed] * 2, strength, *[reach] * n])
    low = np.array([_FORCES[0] * strength, strength / (_DISTANCES[1] * reach), 0.0, 0.0, -np.inf, *[-np.inf] * n])
    high = np.array([_FORCES[1] * strength, stiffest, *[np.inf] * (3 + n)])
    base = np.array([0.9 * strength, np.nan, 0.1 * strength / speed, 0.0, float(ends.mean()), *[0.0] * n])
    for i, name in enumerate(FREE):
        base[i] = fixed.get(name, base[i])
    free = np.array([*(name not in fixed for name in FREE), *[True] * n])
    return Task(log, parts, unit, low / unit, high / unit, free, base / unit)


def _check_sign(log: Log, v: FloatArray, f: FloatArray) -> None:
    """Friction takes work, so force and velocity go together."""
    dv, df = v - v.mean(), f - f.mean()
    if np.sum(dv * df) < -_AGAINST * np.sqrt(np.sum(dv**2) * np.sum(df**2)):
        raise DataError(
            f"{log.name}: the force is larger against the motion than with it: friction takes work, this force gives "
            "it. The force is that of the rig on the part, positive towards larger positions; turn its sign."
        )


def starts(task: Task) -> list[FloatArray]:
    """Points to search from, by distance F_C / K_z.

    The cost has a second minimum at a softer bristle with much damping; from these one search or another misses it.
    """
    K = FREE.index("K_z")
    if not task.free[K]:
        return [task.base[task.free]]
    points = []
    for part_of_reach in (0.004, 0.01, 0.1):
        base = task.base.copy()
        base[K] = base[0] * task.unit[0] / (part_of_reach * task.unit[-1]) / task.unit[K]
        points.append(np.clip(base, task.low, task.high)[task.free])
    return points


def residuals(task: Task, x: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Simulated less measured force of each piece, 0 where missing, with its Jacobian to the free scaled numbers."""
    values, shared = task.all(x), len(FREE)
    answers = []
    for i, piece in enumerate(task.parts):
        force, slopes = free_run(piece, values[: len(NAMES)].tolist(), float(values[shared + i]))
        r = force + values[shared - 1] - task.log["force"][piece.start : piece.stop]
        J = np.zeros((len(piece), task.unit.size))
        J[:, [*range(len(NAMES)), shared + i]] = slopes
        J[:, shared - 1] = 1.0
        known = np.isfinite(r)
        answers.append((np.where(known, r, 0.0), np.where(known[:, None], J * task.unit, 0.0)[:, task.free]))
    return answers


def linearised(task: Task, x: FloatArray) -> Linearisation:
    """Compressed residuals and Jacobian at the free numbers `x`."""
    factor = np.vstack([compress(J, r) for r, J in residuals(task, x)])
    whole = compress(factor[:, :-1], factor[:, -1])
    return Linearisation(whole[:-1, :-1], whole[:-1, -1], 0.5 * float(np.sum(whole[:, -1] ** 2)), factor.shape[0])
