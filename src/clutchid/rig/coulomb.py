"""`coulomb_friction`: Coulomb friction at each constant pressure, and a test whether it depends on the pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.log import FloatArray, Log, holes
from clutchid.measurements import AMBIENT
from clutchid.rig.weighted import (
    Component,
    Equality,
    StudentEstimate,
    equality,
    gls,
    independent,
    satterthwaite,
    student,
)
from clutchid.strokes.sampled import runs, velocity

#: Fractions of the reach between which a pass is averaged: without pre-sliding and the reversals at its ends. Both
#: directions are averaged over the same positions: forces that depend on the position cancel in their difference.
_BAND = (0.3, 0.8)

#: Half window in s over which the speed is computed.
_WINDOW = 0.05

#: Least fraction of the band that a pass covers, and largest relative difference of its speed between thirds.
_PASSED, _UNEVEN = 0.9, 0.25

#: Least number of samples of a pass.
_FEWEST = 6

#: Least speed of a pass, as a fraction of the highest speeds.
_SLOW = 0.1


@dataclass(frozen=True, slots=True)
class Pass:
    """A pass at constant speed: start in s, mean speed (m/s, signed), force (N), absolute pressure (Pa, or NaN)."""

    start: float
    speed: float
    force: float
    pressure: float


@dataclass(frozen=True, slots=True)
class Cycle:
    """Two consecutive passes in opposite directions: `out` towards larger positions, and `back`."""

    out: Pass
    back: Pass

    @property
    def half_difference(self) -> float:
        """Half the difference of the forces in N: friction, plus half the difference of the pressure forces."""
        return (self.out.force - self.back.force) / 2

    @property
    def middle(self) -> float:
        """Mean of the forces in N: pressure force and zero of the load cell."""
        return (self.out.force + self.back.force) / 2

    @property
    def half_pressure(self) -> float:
        """Half the difference of the pressures in Pa."""
        return (self.out.pressure - self.back.pressure) / 2

    @property
    def pressure(self) -> float:
        """Mean absolute pressure in Pa."""
        return (self.out.pressure + self.back.pressure) / 2


def passes(log: Log) -> list[Pass]:
    """Passes at constant speed in order of time, each averaged within `_BAND` of the reach.

    Parameters
    ----------
    log : Log
        Position in m, force in N and, where measured, pressure_a in Pa.

    Returns
    -------
    passes : list of Pass
        Passes with a hole, uneven speed, or half of their forces missing are left out.

    Examples
    --------
    A triangle of 40 mm in 4 s against 5 N of friction:

    >>> t = np.arange(0.0, 8.0, 0.01)
    >>> y = 0.04 * np.abs((t / 4 + 1) % 2 - 1)
    >>> force = np.where(t < 4.0, 5.0, -5.0)
    >>> [f"{s.speed * 1e3:+.0f} mm/s, {s.force:+.0f} N" for s in passes(Log(t, {"position": y, "force": force}))]
    ['+10 mm/s, +5 N', '-10 mm/s, -5 N']
    """
    position, finite = log["position"], np.isfinite(log["position"])
    if finite.sum() < 3:
        return []
    low, high = np.quantile(position[finite], [0.02, 0.98])
    ends = low + np.array(_BAND) * (high - low)
    speed = velocity(log.time, position, _WINDOW)
    slow = _SLOW * float(np.nanquantile(np.abs(speed), 0.9))
    inside = finite & (position >= ends[0]) & (position <= ends[1])
    spans = []
    for way in (1.0, -1.0):
        for first, last in runs(inside & (way * speed > slow)):
            if last - first < _FEWEST:
                continue
            whole = abs(position[last - 1] - position[first]) >= _PASSED * (ends[1] - ends[0])
            if whole and not holes(log.time[first:last]).any():
                spans.append((first, last))
    candidates = [_pass(log, speed, *ends_of) for ends_of in sorted(spans)]
    return [candidate for candidate in candidates if candidate is not None]


def _pass(log: Log, speed: FloatArray, first: int, last: int) -> Pass | None:
    v, force = speed[first:last], log["force"][first:last]
    finite = np.isfinite(force)
    thirds = [float(third.mean()) for third in np.array_split(v, 3)]  # noise of the position averages out
    if finite.mean() <= 0.5 or max(thirds) - min(thirds) > _UNEVEN * abs(float(v.mean())):
        return None
    pressure = log["pressure_a"][first:last][finite] if "pressure_a" in log else np.full(1, np.nan)
    pressure = pressure[np.isfinite(pressure)]
    return Pass(
        float(log.time[first]),
        float(v.mean()),
        float(force[finite].mean()),
        float(pressure.mean()) if pressure.size else float("nan"),
    )


def cycles(series: list[Pass]) -> list[Cycle]:
    """Pair passes to cycles; each pass is in at most one cycle."""
    pairs, taken = [], False
    for earlier, other in pairwise(series):
        if taken or (earlier.speed > 0) == (other.speed > 0):
            taken = False
            continue
        pairs.append(Cycle(earlier, other) if earlier.speed > 0 else Cycle(other, earlier))
        taken = True
    return pairs


#: Pressures further apart than this, in Pa, are separate levels: above the variation of a constant pressure in a cycle.
_LEVEL_GAP = 3e4


@dataclass(frozen=True, slots=True, eq=False)
class FrictionLevel:
    """Coulomb friction at one constant pressure.

    Attributes
    ----------
    pressure : Pa
        Above ambient.
    swing : Pa
        Its difference between the passes out and back; NaN: not measured.
    friction : N
        With its 95 % interval over cycles.
    cycles : N, (cycles,)
        Friction of each cycle in order of time.
    speeds : m/s
        Of the passes out and back.
    drifts
        Whether the cycles are not independent, so that the interval is that of a single one.
    """

    pressure: float
    swing: float
    friction: StudentEstimate
    cycles: FloatArray
    speeds: tuple[float, float]
    drifts: bool


@dataclass(frozen=True, slots=True, eq=False)
class CoulombFriction:
    """Coulomb friction as a function of pressure.

    What needs at least two levels with an interval is None without them.

    Attributes
    ----------
    levels
        In order of pressure.
    area : m²
        Slope of the force over the pressure, negative if the pressure acts towards larger positions; None if unknown.
    test
        Test for equal friction at all levels.
    constant : N
        Common estimate of all levels.
    slope : m²
        c_F of the line through the levels.
    intercept : N
        F_C of that line.
    dropped
        Number of passes in no cycle.
    """

    levels: tuple[FrictionLevel, ...]
    area: StudentEstimate | None
    test: Equality | None
    constant: StudentEstimate | None
    slope: StudentEstimate | None
    intercept: StudentEstimate | None
    dropped: int


def coulomb_friction(
    logs: Sequence[Log], *, ambient: float | None = None, area: float | None = None
) -> CoulombFriction:
    r"""Coulomb friction from passes at constant speed and constant pressures.

    .. math:: F_C = (f_{out} - f_{back}) / 2 - A (p_{out} - p_{back}) / 2

    Parameters
    ----------
    logs : Sequence[Log]
        Position in m, force in N (applied by the rig, positive towards larger positions) and, if measured, absolute
        pressure_a in Pa. Cycles of all recordings are grouped to levels by their pressure.
    ambient : Pa, optional
        Pressure on the other side of the piston; by default from the metadata of each recording, else P_0.
    area : m², optional
        Slope of the force over the pressure, if known; by default estimated over the levels.

    Returns
    -------
    friction : CoulombFriction

    Raises
    ------
    DataError
        If a recording has no position, force or cycle, or the force drives the motion, so that its sign is wrong.
    ParameterError
        If an area is given without a measured pressure.

    Notes
    -----
    A cycle is the statistical unit, because samples of a pass share speed, seal and bore. If the cycles of a level
    drift, they are not independent and count as one. Viscous friction at the speed of the passes is part of F_C.

    Examples
    --------
    4 N at 1 bar and 6 N at 3 bar above ambient, on a piston of 500 mm²:

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
    pairs, dropped = _all_cycles(logs, ambient)
    groups = _levels(pairs)
    if area is not None and not (np.isfinite(area) and np.isfinite(groups[0].pressure)):
        raise ParameterError(
            f"area = {area:g} m²: needs a finite value and recordings with pressure_a, because it corrects for the "
            "pressure difference between the strokes; omit it if the pressure is not measured."
        )
    given_area = None if area is None else StudentEstimate(area, 0.0, area, area, float("inf"))
    return _result(groups, _area(groups) if given_area is None and len(groups) > 1 else given_area, dropped)


def _all_cycles(logs: Sequence[Log], ambient: float | None) -> tuple[list[tuple[Cycle, float]], int]:
    """Cycles of all recordings with their pressure above ambient, and the number of passes in no cycle."""
    pairs: list[tuple[Cycle, float]] = []
    problems, dropped = [], 0
    for log in logs:
        absent = [name for name in ("position", "force") if name not in log or not np.isfinite(log[name]).any()]
        if absent:
            problems.append(f"{log.name}: no {' and no '.join(absent)}; friction needs both.")
            continue
        strokes = passes(log)
        own = [cycle for cycle in cycles(strokes) if not abs(2 * cycle.half_pressure) > _LEVEL_GAP]
        dropped += len(strokes) - 2 * len(own)
        outside = float(log.metadata.get("ambient_Pa", AMBIENT)) if ambient is None else ambient
        pairs += [(cycle, cycle.pressure - outside) for cycle in own]
        if not own:
            problems.append(
                f"{log.name}: no cycle of two strokes at constant speed and pressure ({len(strokes)} strokes); record "
                f"strokes in both directions that pass {100 * _BAND[0]:.0f} to {100 * _BAND[1]:.0f} % of the reach at "
                "constant speed."
            )
        elif np.median([cycle.half_difference for cycle in own]) <= 0.0:
            problems.append(
                f"{log.name}: the force is larger on the way back than on the way out, so friction would drive the "
                "motion. The force must be that of the rig on the piston, positive towards larger positions; invert "
                "its sign."
            )
    if problems or not logs:
        raise DataError("\n".join(problems) or "no recording is given; friction needs at least one.")
    if len({np.isfinite(pressure) for _, pressure in pairs}) > 1:
        raise DataError("some recordings have pressure_a, others do not; fit them separately.")
    return pairs, dropped


@dataclass(frozen=True, slots=True)
class _Group:
    """Cycles of one level in order of time: mean pressure above ambient, and half its swing; NaN: unknown."""

    cycles: tuple[Cycle, ...]
    pressure: float
    swing: float


def _levels(pairs: Sequence[tuple[Cycle, float]]) -> list[_Group]:
    """Group the cycles by level, in order of pressure."""
    order = sorted(range(len(pairs)), key=lambda i: pairs[i][1])
    members: list[list[int]] = [order[:1]]
    for before, i in pairwise(order):
        if pairs[i][1] - pairs[before][1] > _LEVEL_GAP:
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
    """Variance of the mean of a level's cycles (of one cycle if they drift), and its degrees of freedom."""
    if values.size < 2:
        return float("inf"), 0.0
    number = values.size if independent(values) else 1
    return float(np.var(values, ddof=1)) / number, values.size - 1.0


def _parts(values: Sequence[FloatArray]) -> list[Component]:
    """The variance of each level's mean."""
    parts = []
    for i, of_level in enumerate(values):
        matrix = np.zeros((len(values), len(values)))
        matrix[i, i], freedom = _spread(of_level)
        parts.append(Component(matrix, freedom))
    return parts


def _area(groups: Sequence[_Group]) -> StudentEstimate:
    """Slope of the force over the pressure: a line through the mean forces of the levels."""
    repeated = [group for group in groups if len(group.cycles) > 1]
    if len(repeated) < 2:  # single cycles: a line without an interval
        middles = [np.mean([cycle.middle for cycle in group.cycles]) for group in groups]
        return student(float(np.polyfit([group.pressure for group in groups], middles, 1)[0]), float("inf"), 0.0)
    values = [np.array([cycle.middle for cycle in group.cycles]) for group in repeated]
    return gls(_line(repeated), np.array([v.mean() for v in values]), _parts(values))[1]


def _line(groups: Sequence[_Group]) -> FloatArray:
    return np.column_stack([np.ones(len(groups)), [group.pressure for group in groups]])


def _level(group: _Group, area: StudentEstimate | None) -> FrictionLevel:
    values = np.array([cycle.half_difference for cycle in group.cycles])
    shared = 0.0
    if area is not None:
        values = values - area.value * np.array([cycle.half_pressure for cycle in group.cycles])
        shared = (area.std * group.swing) ** 2
    variance, freedom = _spread(values)
    if freedom > 0.0 and area is not None:
        freedom = satterthwaite([variance, shared], [freedom, max(area.degrees_of_freedom, 1.0)])
    out, back = (np.mean([getattr(c, way).speed for c in group.cycles]) for way in ("out", "back"))
    return FrictionLevel(
        pressure=group.pressure,
        swing=2 * group.swing,
        friction=student(float(values.mean()), float(np.sqrt(variance + shared)), freedom),
        cycles=values,
        speeds=(float(out), float(back)),
        drifts=not independent(values),
    )


def _result(groups: Sequence[_Group], area: StudentEstimate | None, dropped: int) -> CoulombFriction:
    """Friction of each level, and the estimates over all levels."""
    levels = tuple(_level(group, area) for group in groups)
    usable = [i for i, level in enumerate(levels) if np.isfinite(level.friction.std)]
    if len(usable) < 2:
        return CoulombFriction(levels, area, None, None, None, None, dropped)
    means = np.array([levels[i].friction.value for i in usable])
    parts = _parts([levels[i].cycles for i in usable])
    if area is not None:
        swings = np.array([groups[i].swing for i in usable])
        parts.append(Component(area.std**2 * np.outer(swings, swings), area.degrees_of_freedom))
    intercept, slope = gls(_line([groups[i] for i in usable]), means, parts)
    (constant,) = gls(np.ones((len(usable), 1)), means, parts)
    return CoulombFriction(levels, area, equality(means, parts), constant, slope, intercept, dropped)
