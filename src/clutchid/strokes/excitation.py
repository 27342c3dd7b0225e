"""Excitation in a recording: reach, speeds, vented rests, holds, and passes by stroke region."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import HOLE, INPUTS, FloatArray, Log, holes, sample_interval
from clutchid.parameters import Parameters
from clutchid.strokes.sampled import runs, velocity
from clutchid.strokes.vented_pressure import vented_pressure

#: Edges of the stroke regions in m; the first region is open below, the last one open above.
REGION_EDGES = (0.0, 2e-3, 5e-3, 8e-3, 12e-3, 16e-3, 20e-3, np.inf)

#: Below this speed in m/s the piston is still: the slowest ramp of the published protocol (20 % of the stroke in 2 s)
#: has 2.5e-3, a vibration of 0.1 mm at 25 Hz averaged over `SLOW_WINDOW` at most 0.7e-3.
HOLD_SPEED = 1.5e-3

#: Half windows in s over which the velocity is computed: to separate motion from holds, and for the top speed.
SLOW_WINDOW, FAST_WINDOW = 0.05, 0.005

#: Shortest rest and shortest hold that count, in s: longer than the window that detects them.
SHORTEST_REST, _SHORTEST_HOLD = 0.1, 0.2

#: The first and the last region have one edge only; they count as passed from this depth inside them, in m.
_END_DEPTH = 1e-3

#: A chamber counts as vented where the piston rests within this distance of zero, in m.
VENTED_POSITION = 5e-4

#: Vented: the measured pressure is at most this multiple of the ambient one.
VENTED_PRESSURE = 1.1


@dataclass(frozen=True, slots=True)
class RegionVisit:
    """Time in s in a stroke region (m), and number of passes from edge to edge in each direction."""

    low: float
    high: float
    seconds: float
    opening: int
    closing: int


@dataclass(frozen=True, slots=True)
class Hold:
    """A hold away from the engaged end: mean position in m and length in s."""

    position: float
    seconds: float


@dataclass(frozen=True, slots=True)
class Excitation:
    """Excitation of one recording, or of several together (`recordings` of them); positions in m, speeds in m/s.

    `highest_supply` and `highest_exhaust` are the highest duty cycles, NaN where the input is missing;
    `unsettled` recordings have a pressure, but no settled vented rest, see `vented_pressure`.
    """

    recordings: int
    seconds: float
    lowest: float
    reach: float
    top_opening: float
    top_closing: float
    highest_supply: float
    highest_exhaust: float
    vented_rests: int
    longest_vented_rest: float
    regions: tuple[RegionVisit, ...]
    holds: tuple[Hold, ...]
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
    found : Excitation

    Raises
    ------
    DataError
        If there is no finite position.

    Examples
    --------
    A full stroke in half a second and back, after a rest of 1 s:

    >>> t = np.arange(0.0, 3.0, 1e-3)
    >>> y = np.interp(t, [0.0, 1.0, 1.5, 2.0, 2.5, 3.0], [0.0, 0.0, 0.022, 0.022, 0.0, 0.0])
    >>> found = excitation(Log(t, {"position": y, "duty_supply": 0.4 * (t > 1.0) * (t < 1.5)}))
    >>> found.vented_rests, f"{found.reach * 1e3:.0f} mm at {found.top_opening * 1e3:.0f} mm/s"
    (2, '22 mm at 44 mm/s')
    """
    p = Parameters() if parameters is None else parameters
    position = measured["position"]
    finite = position[np.isfinite(position)]
    if finite.size == 0:
        raise DataError(f"{measured.name}: column 'position' has no finite sample, so its motion is unknown.")
    speed = velocity(measured.time, position, FAST_WINDOW)
    rests, holds = _still(measured, p)
    highest = {name: float(np.nanmax(measured[name], initial=0.0)) for name in INPUTS if name in measured}
    return Excitation(
        recordings=1,
        seconds=float(measured.time[-1] - measured.time[0]),
        lowest=float(finite.min()),
        reach=float(finite.max()),
        top_opening=float(np.nanmax(speed, initial=0.0)),
        top_closing=float(np.nanmax(-speed, initial=0.0)),
        highest_supply=highest.get("duty_supply", np.nan),
        highest_exhaust=highest.get("duty_exhaust", np.nan),
        vented_rests=len(rests),
        longest_vented_rest=max(rests, default=0.0),
        regions=_visits(measured),
        holds=holds,
        unsettled=int("pressure_a" in measured and vented_pressure(measured) is None),
    )


def joined(parts: Sequence[Excitation]) -> Excitation:
    """Excitation of several recordings together.

    Raises
    ------
    DataError
        If there is none.
    """
    if not parts:
        raise DataError("no recording is given; at least one is needed.")
    regions = tuple(
        replace(
            visits[0],
            seconds=sum(visit.seconds for visit in visits),
            opening=sum(visit.opening for visit in visits),
            closing=sum(visit.closing for visit in visits),
        )
        for visits in zip(*(part.regions for part in parts), strict=True)
    )
    return Excitation(
        recordings=sum(part.recordings for part in parts),
        seconds=sum(part.seconds for part in parts),
        lowest=min(part.lowest for part in parts),
        reach=max(part.reach for part in parts),
        top_opening=max(part.top_opening for part in parts),
        top_closing=max(part.top_closing for part in parts),
        highest_supply=float(np.fmax.reduce([part.highest_supply for part in parts])),
        highest_exhaust=float(np.fmax.reduce([part.highest_exhaust for part in parts])),
        vented_rests=sum(part.vented_rests for part in parts),
        longest_vented_rest=max(part.longest_vented_rest for part in parts),
        regions=regions,
        holds=tuple(hold for part in parts for hold in part.holds),
        unsettled=sum(part.unsettled for part in parts),
    )


def region_of(position: FloatArray) -> NDArray[np.int64]:
    """Index of the stroke region of each position in m, by `REGION_EDGES`; NaN is in the last one."""
    return np.searchsorted(np.array(REGION_EDGES[1:-1]), position, side="right").astype(np.int64)


def _still(log: Log, p: Parameters) -> tuple[list[float], tuple[Hold, ...]]:
    """Lengths in s of the vented rests, and the holds elsewhere."""
    time, recorded = log.time, np.flatnonzero(np.isfinite(log["position"]))
    position = np.interp(time, time[recorded], log["position"][recorded])
    still = np.abs(velocity(time, position, SLOW_WINDOW)) < HOLD_SPEED
    still[1:] &= ~holes(time)
    near = np.abs(position) <= VENTED_POSITION
    closed = log["duty_supply"] <= p.R_0vs if "duty_supply" in log else np.ones(len(log), dtype=bool)
    pressure = log["pressure_a"] if "pressure_a" in log else np.full(len(log), np.nan)
    closed = closed & ~(pressure > VENTED_PRESSURE * p.P_0)
    rests = [float(time[b - 1] - time[a]) for a, b in runs(still & near & closed)]
    still_runs = [(a, b) for a, b in runs(still & ~near) if time[b - 1] - time[a] >= _SHORTEST_HOLD]
    holds = [Hold(float(np.nanmean(position[a:b])), float(time[b - 1] - time[a])) for a, b in still_runs]
    return [rest for rest in rests if rest >= SHORTEST_REST], tuple(holds)


def _visits(log: Log) -> tuple[RegionVisit, ...]:
    """Time and passes by region; a hole in time counts as one usual interval."""
    usual = sample_interval(log.time, 0.0)
    dt = np.append(np.diff(log.time), usual)
    dt = np.where(dt > HOLE * usual, usual, dt)
    finite = np.isfinite(log["position"])
    position = log["position"][finite]
    seconds = np.bincount(region_of(position), dt[finite], len(REGION_EDGES) - 1)
    visits = []
    for (low, high), spent in zip(pairwise(REGION_EDGES), seconds.tolist(), strict=True):
        begin = high - _END_DEPTH if low == 0.0 else low
        end = high if np.isfinite(high) else low + _END_DEPTH
        visits.append(RegionVisit(low, high, spent, *_passes(position, begin, end)))
    return tuple(visits)


def _passes(position: FloatArray, low: float, high: float) -> tuple[int, int]:
    """Number of passes from `low` to `high` and back; noise at one edge does not count."""
    side = np.where(position >= high, 1, np.where(position <= low, -1, 0))
    turns = np.diff(side[side != 0])
    return int(np.sum(turns > 0)), int(np.sum(turns < 0))
