"""Excitation in a recording: reach, vented rests, and passes by stroke region."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from clutchid.errors import DataError
from clutchid.log import FloatArray, Log, holes
from clutchid.parameters import Parameters
from clutchid.strokes.sampled import runs, velocity
from clutchid.strokes.vented_pressure import vented_pressure

#: Edges of the stroke regions in m; the first region is open below, the last one open above.
REGION_EDGES = (0.0, 2e-3, 5e-3, 8e-3, 12e-3, 16e-3, 20e-3, np.inf)

#: Below this speed in m/s the piston is still: the slowest ramp of the published protocol (20 % of the stroke in 2 s)
#: has 2.5e-3, a vibration of 0.1 mm at 25 Hz averaged over `SLOW_WINDOW` at most 0.7e-3.
HOLD_SPEED = 1.5e-3

#: Half window in s over which the velocity is computed, to separate motion from holds.
SLOW_WINDOW = 0.05

#: Shortest rest that counts, in s: longer than the window that detects it.
SHORTEST_REST = 0.1

#: The first and the last region have one edge only; they count as passed from this depth inside them, in m.
_END_DEPTH = 1e-3

#: A chamber counts as vented where the piston rests within this distance of zero, in m.
VENTED_POSITION = 5e-4

#: Vented: the measured pressure is at most this multiple of the ambient one.
_VENTED_PRESSURE = 1.1


class RegionVisit(NamedTuple):
    """Passes through a stroke region (m) from edge to edge in each direction."""

    low: float
    high: float
    opening: int
    closing: int


class Excitation(NamedTuple):
    """Excitation of one recording, or of several together (`recordings` of them); positions in m.

    `unsettled` recordings have a pressure, but no settled vented rest, see `vented_pressure`.
    """

    recordings: int
    lowest: float
    reach: float
    vented_rests: int
    regions: tuple[RegionVisit, ...]
    unsettled: int = 0


def excitation(measured: Log, parameters: Parameters | None = None) -> Excitation:
    """Excitation of a recording.

    Parameters
    ----------
    measured : Log
        With a position in m; duty cycles and pressure, if present, restrict what counts as a vented rest.
    parameters : Parameters, optional
        Ambient pressure and closing of the supply valve; by default the paper's.

    Returns
    -------
    excitation : Excitation

    Raises
    ------
    DataError
        If there is no finite position.

    Examples
    --------
    A full stroke in half a second and back, after a rest of 1 s:

    >>> t = np.arange(0.0, 3.0, 1e-3)
    >>> y = np.interp(t, [0.0, 1.0, 1.5, 2.0, 2.5, 3.0], [0.0, 0.0, 0.022, 0.022, 0.0, 0.0])
    >>> stroke = excitation(Log(t, {"position": y, "duty_supply": 0.4 * (t > 1.0) * (t < 1.5)}))
    >>> stroke.vented_rests, f"{stroke.reach * 1e3:.0f} mm"
    (2, '22 mm')
    """
    p = Parameters() if parameters is None else parameters
    position = measured["position"]
    finite = position[np.isfinite(position)]
    if finite.size == 0:
        raise DataError(f"{measured.name}: column 'position' has no finite sample, so its motion is unknown.")
    return Excitation(
        recordings=1,
        lowest=float(finite.min()),
        reach=float(finite.max()),
        vented_rests=len(vented_rests(measured, p)),
        regions=_visits(finite),
        unsettled=int("pressure_a" in measured and vented_pressure(measured) is None),
    )


def joint_excitation(parts: Sequence[Excitation]) -> Excitation:
    """Excitation of several recordings together.

    Raises
    ------
    DataError
        If there is none.
    """
    if not parts:
        raise DataError("no recording is given; at least one is needed.")
    regions = tuple(
        visits[0]._replace(
            opening=sum(visit.opening for visit in visits), closing=sum(visit.closing for visit in visits)
        )
        for visits in zip(*(part.regions for part in parts), strict=True)
    )
    return Excitation(
        recordings=sum(part.recordings for part in parts),
        lowest=min(part.lowest for part in parts),
        reach=max(part.reach for part in parts),
        vented_rests=sum(part.vented_rests for part in parts),
        regions=regions,
        unsettled=sum(part.unsettled for part in parts),
    )


def vented_rests(log: Log, p: Parameters) -> list[tuple[int, int]]:
    """Sample ranges (start, stop) of rests with the clutch engaged and the supply valve closed, at ambient pressure.

    Examples
    --------
    >>> t = np.arange(0.0, 2.0, 1e-3)
    >>> y = np.interp(t, [0.0, 0.5, 1.0, 1.5, 2.0], [0.0, 0.0, 0.01, 0.0, 0.0])
    >>> rests = vented_rests(Log(t, {"position": y}), Parameters())
    >>> [(round(float(t[a]), 1), round(float(t[b - 1]), 1)) for a, b in rests]
    [(0.0, 0.5), (1.5, 2.0)]
    """
    time, recorded = log.time, np.flatnonzero(np.isfinite(log["position"]))
    if recorded.size == 0:
        return []
    position = np.interp(time, time[recorded], log["position"][recorded])
    still = np.abs(velocity(time, position, SLOW_WINDOW)) < HOLD_SPEED
    still[1:] &= ~holes(time)
    if "duty_supply" in log:
        still &= log["duty_supply"] <= p.R_0vs
    if "pressure_a" in log:
        still &= ~(log["pressure_a"] > _VENTED_PRESSURE * p.P_0)
    spans = runs(still & (np.abs(position) <= VENTED_POSITION))
    return [(a, b) for a, b in spans if time[b - 1] - time[a] >= SHORTEST_REST]


def _visits(position: FloatArray) -> tuple[RegionVisit, ...]:
    """Passes by region."""
    visits = []
    for low, high in pairwise(REGION_EDGES):
        begin = high - _END_DEPTH if low == 0.0 else low
        end = high if np.isfinite(high) else low + _END_DEPTH
        visits.append(RegionVisit(low, high, *_passes(position, begin, end)))
    return tuple(visits)


def _passes(position: FloatArray, low: float, high: float) -> tuple[int, int]:
    """Number of passes from `low` to `high` and back; noise at one edge does not count."""
    side = np.where(position >= high, 1, np.where(position <= low, -1, 0))
    turns = np.diff(side[side != 0])
    return int(np.sum(turns > 0)), int(np.sum(turns < 0))
