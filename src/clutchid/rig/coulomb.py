"""`coulomb_friction`: Coulomb friction at each held pressure, and whether one constant holds for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.log import FloatArray, Log
from clutchid.parameters import Parameters
from clutchid.rig.strokes import BAND, Cycle, cycles, strokes
from clutchid.rig.weighted import Component, Equality, Interval, equality, fitted, independent, satterthwaite, student

#: Pressures further apart than this, in Pa, are levels of their own: above the swing of a held pressure in a cycle.
LEVEL_GAP = 3e4


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """Coulomb friction at one held pressure.

    `pressure` over ambient in Pa, `swing` what it is higher by on the way out (NaN where not measured), `friction` in N
    with its 95 % interval over cycles, `cycles` each cycle's friction in their order, `speeds` of the strokes out and
    back in m/s. `drifts`: the cycles are not independent, and the interval is that of a single one.
    """

    pressure: float
    swing: float
    friction: Interval
    cycles: FloatArray
    speeds: tuple[float, float]
    drifts: bool


@dataclass(frozen=True, slots=True, eq=False)
class CoulombFriction:
    """Coulomb friction over pressure.

    `levels` by rising pressure. `area` in m² is the rise of the force with the pressure, negative where the pressure
    pushes towards larger positions; None where it is not known. `test` asks whether one constant holds for all levels,
    `constant` is the best one in N; `slope` (m², c_F) and `intercept` (N, F_C) are the line through the levels. They
    are None with fewer than two levels that have an interval. `dropped` strokes were in no cycle.
    """

    levels: tuple[Level, ...]
    area: Interval | None
    test: Equality | None
    constant: Interval | None
    slope: Interval | None
    intercept: Interval | None
    dropped: int


def coulomb_friction(
    logs: Sequence[Log],
    *,
    ambient: float | None = None,
    area: float | None = None,
    band: tuple[float, float] = BAND,
    level_gap: float = LEVEL_GAP,
) -> CoulombFriction:
    r"""Coulomb friction from strokes at constant speed against held pressures.

    .. math:: F_C = (f_{out} - f_{back}) / 2 - A (p_{out} - p_{back}) / 2

    Parameters
    ----------
    logs : Sequence[Log]
        Position in m, force in N (what the rig applies, positive towards larger positions) and, where measured,
        absolute pressure_a in Pa. Cycles of all recordings are sorted to levels by their pressure.
    ambient : Pa, optional
        Pressure on the other side of the piston; by default that of each recording's metadata, else P_0.
    area : m², optional
        Rise of the force with the pressure, where known; by default estimated over the levels.
    band : (1, 1)
        Parts of the reach between which a stroke is averaged.
    level_gap : Pa
        Cycles whose mean pressures are further apart than this belong to different levels.

    Returns
    -------
    friction : CoulombFriction

    Raises
    ------
    DataError
        If a recording has no position, force or cycle, or the force helps the motion: its sign is wrong.
    ParameterError
        If `band` is no part of [0, 1], or an area is given without a measured pressure.

    Notes
    -----
    A cycle is the unit: samples of a stroke share its speed, its seal and its bore. Where the cycles of a level drift
    they are no independent units either, and count as one. Viscous friction at the speed of the strokes is part of F_C.

    Examples
    --------
    4 N at 1 bar and 6 N at 3 bar over ambient, on a piston of 500 mm²:

    >>> t = np.arange(0.0, 40.0, 0.01)
    >>> y = 0.04 * np.abs((t / 4 + 1) % 2 - 1)
    >>> way = np.where(t % 8.0 < 4.0, 1.0, -1.0)
    >>> def rig(bar, friction):
    ...     force, pressure = 50 * bar + friction * way, np.full(t.size, (1 + bar) * 1e5)
    ...     return Log(t, {"position": y, "force": force, "pressure_a": pressure}, f"{bar} bar")
    >>> found = coulomb_friction([rig(1, 4.0), rig(3, 6.0)], ambient=1e5)
    >>> f"{found.area.value * 1e6:.0f} mm², {found.slope.value * 1e5:.1f} N/bar on {found.intercept.value:.1f} N"
    '500 mm², 1.0 N/bar on 3.0 N'
    """
    if not (0.0 <= band[0] < band[1] <= 1.0):
        raise ParameterError(f"band = {band[0]:g} to {band[1]:g}: parts of the reach between 0 and 1, in rising order.")
    pairs, dropped = _all_cycles(logs, ambient, band, level_gap)
    groups = _levels(pairs, level_gap)
    if area is not None and not (np.isfinite(area) and np.isfinite(groups[0].pressure)):
        raise ParameterError(
            f"area = {area:g} m²: a finite area is needed, and recordings with pressure_a, whose difference between "
            "the strokes it corrects for; leave it out where the pressure is not measured."
        )
    known = None if area is None else Interval(area, 0.0, area, area, float("inf"))
    return _result(groups, _area(groups) if known is None and len(groups) > 1 else known, dropped)


def _all_cycles(
    logs: Sequence[Log], ambient: float | None, band: tuple[float, float], level_gap: float
) -> tuple[list[tuple[Cycle, float]], int]:
    """Cycles of all recordings with their pressure over ambient, and the number of strokes in none."""
    pairs: list[tuple[Cycle, float]] = []
    problems, dropped = [], 0
    for log in logs:
        lacking = [name for name in ("position", "force") if name not in log or not np.isfinite(log[name]).any()]
        if lacking:
            problems.append(f"{log.name}: no {' and no '.join(lacking)}; friction needs both.")
            continue
        found = strokes(log, band)
        own = [cycle for cycle in cycles(found) if not abs(2 * cycle.half_pressure) > level_gap]
        dropped += len(found) - 2 * len(own)
        outside = _ambient(log) if ambient is None else ambient
        pairs += [(cycle, cycle.pressure - outside) for cycle in own]
        if not own:
            problems.append(
                f"{log.name}: no cycle of two strokes at constant speed and held pressure ({len(found)} strokes); give "
                f"strokes to and fro that pass {100 * band[0]:.0f} to {100 * band[1]:.0f} % of the reach evenly."
            )
        elif np.median([cycle.half_difference for cycle in own]) <= 0.0:
            problems.append(
                f"{log.name}: the force is larger on the way back than on the way out, so friction would help the "
                "motion. The force is that of the rig on the piston, positive towards larger positions; turn its sign."
            )
    if problems or not logs:
        raise DataError("\n".join(problems) or "no recording given; friction needs at least one.")
    if len({np.isfinite(pressure) for _, pressure in pairs}) > 1:
        raise DataError("some recordings have pressure_a, others have none; fit them apart.")
    return pairs, dropped


def _ambient(log: Log) -> float:
    return float(log.metadata.get("ambient_Pa", Parameters().P_0))


@dataclass(frozen=True, slots=True)
class _Group:
    """The cycles of one level in the order of time: mean pressure over ambient, and half its swing; NaN: not known."""

    cycles: tuple[Cycle, ...]
    pressure: float
    swing: float


def _levels(pairs: Sequence[tuple[Cycle, float]], gap: float) -> list[_Group]:
    """Cycles by level, in rising order of pressure."""
    order = sorted(range(len(pairs)), key=lambda i: pairs[i][1])
    members: list[list[int]] = [order[:1]]
    for before, i in pairwise(order):
        if pairs[i][1] - pairs[before][1] > gap:
            members.append([])
        members[-1].append(i)
    groups = []
    for group in members:
        own = tuple(pairs[i][0] for i in sorted(group))
        swing = float(np.mean([cycle.half_pressure for cycle in own]))
        pressure = float(np.mean([pairs[i][1] for i in group]))
        groups.append(_Group(own, pressure, swing))
    return groups


def _spread(values: FloatArray) -> tuple[float, float]:
    """Variance of the mean of a level's cycles, and its degrees of freedom; that of one cycle where they drift."""
    if values.size < 2:
        return float("inf"), 0.0
    number = values.size if independent(values) else 1
    return float(np.var(values, ddof=1)) / number, values.size - 1.0


def _parts(values: Sequence[FloatArray]) -> list[Component]:
    """The variance of each level's mean."""
    parts = []
    for place, of_level in enumerate(values):
        matrix = np.zeros((len(values), len(values)))
        matrix[place, place], freedom = _spread(of_level)
        parts.append(Component(matrix, freedom))
    return parts


def _area(groups: Sequence[_Group]) -> Interval:
    """Rise of the force with the pressure: a line through the middles of the levels."""
    told = [group for group in groups if len(group.cycles) > 1]
    if len(told) < 2:  # single cycles: a plain line, without an interval
        middles = [np.mean([cycle.middle for cycle in group.cycles]) for group in groups]
        return student(float(np.polyfit([group.pressure for group in groups], middles, 1)[0]), float("inf"), 0.0)
    values = [np.array([cycle.middle for cycle in group.cycles]) for group in told]
    return fitted(_line(told), np.array([v.mean() for v in values]), _parts(values))[1]


def _line(groups: Sequence[_Group]) -> FloatArray:
    return np.column_stack([np.ones(len(groups)), [group.pressure for group in groups]])


def _level(group: _Group, area: Interval | None) -> Level:
    values = np.array([cycle.half_difference for cycle in group.cycles])
    shared = 0.0
    if area is not None:
        values = values - area.value * np.array([cycle.half_pressure for cycle in group.cycles])
        shared = (area.std * group.swing) ** 2
    variance, freedom = _spread(values)
    if freedom > 0.0 and area is not None:
        freedom = satterthwaite([variance, shared], [freedom, max(area.degrees_of_freedom, 1.0)])
    out, back = (np.mean([getattr(c, way).speed for c in group.cycles]) for way in ("out", "back"))
    return Level(
        pressure=group.pressure,
        swing=2 * group.swing,
        friction=student(float(values.mean()), float(np.sqrt(variance + shared)), freedom),
        cycles=values,
        speeds=(float(out), float(back)),
        drifts=not independent(values),
    )


def _result(groups: Sequence[_Group], area: Interval | None, dropped: int) -> CoulombFriction:
    """Levels, and what they say together."""
    levels = tuple(_level(group, area) for group in groups)
    told = [i for i, level in enumerate(levels) if np.isfinite(level.friction.std)]
    if len(told) < 2:
        return CoulombFriction(levels, area, None, None, None, None, dropped)
    means = np.array([levels[i].friction.value for i in told])
    parts = _parts([levels[i].cycles for i in told])
    if area is not None:
        swings = np.array([groups[i].swing for i in told])
        parts.append(Component(area.std**2 * np.outer(swings, swings), area.degrees_of_freedom))
    intercept, slope = fitted(_line([groups[i] for i in told]), means, parts)
    (constant,) = fitted(np.ones((len(told), 1)), means, parts)
    return CoulombFriction(levels, area, equality(means, parts), constant, slope, intercept, dropped)
