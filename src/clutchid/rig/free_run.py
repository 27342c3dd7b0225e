"""LuGre friction in free-run simulation: compiled force from the measured position, exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np

from clutchid.codegen.cache import generator_files, load_module
from clutchid.codegen.kernels import kernels_in
from clutchid.log import FloatArray, Log, holes
from clutchid.strokes.sampled import runs, velocity

#: Parameters of the friction, in the order of the kernels.
NAMES = ("F_C", "K_z", "D_v", "D_zdot")

#: Below this decay exponent the gain is a series: both have an error of 1e-11 there.
_SERIES_BELOW = 1e-5

_HERE = Path(__file__)


@cache
def _kernels() -> ModuleType:
    """Module with ``force`` for arrays of v and z, and ``decay`` and ``gain`` for arrays of v and intervals h.

    While the velocity is constant, the deflection after h is decay times that before, plus gain. ``force_NAME``,
    ``decay_NAME`` and ``gain_NAME`` are derivatives with respect to z or a parameter. With a filled cache, neither
    SymPy is imported nor anything compiled.

    Raises
    ------
    OSError
        If neither the cache folder nor a temporary folder can be written.
    """
    friction = _HERE.parents[1] / "model" / "friction.py"
    return load_module("rig_lugre", [_HERE, friction, *generator_files()], _source)


def _source() -> str:
    """Source of the module: Eqs. (2) and (3) with the velocity as input."""
    import sympy as sp

    from clutchid.codegen.numba_source import elementwise_source, numba_source
    from clutchid.codegen.system import System
    from clutchid.model.friction import deflection_rate, friction_force

    z, v, h = sp.symbols("z v h", real=True)
    parameters = F_C, K_z, D_v, D_zdot = sp.symbols(NAMES, real=True)
    rate = deflection_rate(v, z, K_z, F_C)
    force = friction_force(v, z, rate, D_v, K_z, D_zdot)
    slope, drive = sp.diff(rate, z), rate.subs(z, 0)  # the rate is linear in z: solved exactly
    decay = sp.exp(slope * h)
    series = drive * h * (1 + slope * h / 2)
    gain = sp.Piecewise((drive * (decay - 1) / slope, -slope * h > _SERIES_BELOW), (series, True))
    sources = [numba_source(System("rig_lugre", (z,), (v,), parameters, (), (rate,)))]
    sources += [elementwise_source("force", (v, z), parameters, force)]
    sources += [elementwise_source(f"force_{p}", (v, z), parameters, sp.diff(force, p)) for p in (z, *parameters)]
    for name, value in {"decay": decay, "gain": gain}.items():
        sources.append(elementwise_source(name, (v, h), (F_C, K_z), value))
        sources += [elementwise_source(f"{name}_{p}", (v, h), (F_C, K_z), sp.diff(value, p)) for p in (F_C, K_z)]
    return "".join(sources)


#: Least number of samples of a segment.
_FEWEST = 10


@dataclass(frozen=True, slots=True, eq=False)
class FreeRunSegment:
    """Samples `start` to `stop` (exclusive) without a hole: velocity in m/s, and intervals in s."""

    start: int
    stop: int
    velocity: FloatArray
    dt: FloatArray

    def __len__(self) -> int:
        return self.stop - self.start


#: Half window in s over which the velocity is computed, as the difference of the mean positions after and before a
#: sample: it averages quantisation and noise of the position sensor.
VELOCITY_WINDOW = 0.02


def segments(log: Log) -> list[FreeRunSegment]:
    """Divide a recording with a position into segments; a hole in time or a missing position ends a segment."""
    position = log["position"]
    apart, parts = np.append(False, holes(log.time)), []
    for first, last in runs(np.isfinite(position)):
        edges = [first, *(first + 1 + np.flatnonzero(apart[first + 1 : last])).tolist(), last]
        for start, stop in pairwise(edges):
            if stop - start >= _FEWEST:
                parts.append(_segment(log, (start, stop)))
    return parts


def _segment(log: Log, ends: tuple[int, int]) -> FreeRunSegment:
    time, position = log.time[slice(*ends)], log["position"][slice(*ends)]
    return FreeRunSegment(*ends, velocity(time, position, VELOCITY_WINDOW), np.diff(time))


def free_run(segment: FreeRunSegment, values: Sequence[float], z_start: float) -> tuple[FloatArray, FloatArray]:
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
    module, n, v = _kernels(), len(segment), segment.velocity
    p = np.array(values, dtype=np.float64)
    interval = ((v[:-1] + v[1:]) / 2, segment.dt, *p[:2])
    decay = module.decay(*interval)

    def run(first: Sequence[float], *driven: FloatArray) -> FloatArray:
        """Solution of z[k+1] = decay[k] z[k] + driven[k] from z[0] = first, each in a column."""
        solution = np.empty((n, len(first)))
        solution[0] = first
        kernels_in("clutchid.rig.recurrence").follow_columns(decay, np.column_stack(driven), solution)
        return solution

    z = run([z_start], module.gain(*interval))[:, 0]
    to_z = module.force_z(v, z, *p)
    jacobian = np.column_stack([*(getattr(module, f"force_{name}")(v, z, *p) for name in NAMES), np.zeros(n)])
    driven = (
        getattr(module, f"decay_{name}")(*interval) * z[:-1] + getattr(module, f"gain_{name}")(*interval)
        for name in NAMES[:2]
    )
    jacobian[:, [0, 1, len(NAMES)]] += to_z[:, None] * run([0.0, 0.0, 1.0], *driven, np.zeros(n - 1))
    return module.force(v, z, *p), jacobian
