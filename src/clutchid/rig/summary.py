"""Friction of a rig for the model: conclusions in sentences, and values."""

from __future__ import annotations

import math

from clutchid.inference.uncertainty.estimates import Estimate
from clutchid.rig.coulomb import CoulombFriction, FrictionLevel
from clutchid.rig.weighted import StudentEstimate

#: Significance level at which a constant friction is rejected.
_SIGNIFICANCE = 0.05

#: Relative difference of the mean speeds of the levels above which a warning is given, because of viscous friction.
_SPEEDS = 0.1

#: The variant whose Coulomb friction grows with the pressure over the piston.
_VARIANT = "energy-balance-stribeck"


def conclusions(friction: CoulombFriction) -> list[str]:
    """Whether a constant F_C is adequate and which values to set, then remarks on the recordings; sentences."""
    sentences = [_over_levels(friction), *_not_corrected(friction)]
    sentences += [
        f"the friction{_at(level)} drifts between {level.cycles.min():.2f} and {level.cycles.max():.2f} N over its "
        f"{level.cycles.size} cycles: they are not independent, so the interval is that of a single cycle."
        for level in friction.levels
        if level.drifts
    ]
    for i, way in enumerate(("out", "back")):
        speeds = [abs(level.speeds[i]) * 1e3 for level in friction.levels]
        if max(speeds) - min(speeds) > _SPEEDS * max(speeds):
            sentences.append(
                f"the speed {way} differs between levels, {min(speeds):.1f} to {max(speeds):.1f} mm/s: viscous "
                "friction is included and may differ too."
            )
    if friction.dropped:
        sentences.append(f"{friction.dropped} strokes without a stroke in the opposite direction were left out.")
    return sentences


def implied(friction: CoulombFriction) -> dict[str, Estimate]:
    """Values for the model: F_C, and c_F if the friction increases with the pressure."""
    test, slope = friction.test, friction.slope
    if test is None or friction.constant is None or slope is None or friction.intercept is None:
        return {"F_C": _estimate(friction.levels[0].friction, "N")} if len(friction.levels) == 1 else {}
    if test.p_value < _SIGNIFICANCE and slope.low > 0.0:
        return {"F_C": _estimate(friction.intercept, "N"), "c_F": _estimate(slope, "m²")}
    return {"F_C": _estimate(friction.constant, "N")}


def _estimate(number: StudentEstimate, unit: str) -> Estimate:
    return Estimate(number.value, unit, number.std, number.low, number.high)


def _over_levels(friction: CoulombFriction) -> str:
    test, constant, slope, intercept = friction.test, friction.constant, friction.slope, friction.intercept
    levels = friction.levels
    if test is None or constant is None or slope is None or intercept is None:
        by_level = "; ".join(f"F_C = {_shown(level.friction, 'N')}{_at(level)}" for level in levels)
        return f"{by_level}. A test whether it depends on the pressure needs two levels or more, with two cycles each."
    chance = f"p = {test.p_value:.2g}"
    if test.p_value >= _SIGNIFICANCE:
        return f"one constant F_C = {_shown(constant, 'N')} is adequate for all {len(levels)} levels ({chance})."
    low, high = min(levels, key=_force), max(levels, key=_force)
    ends = f"{_force(low):.2f} N{_at(low)}", f"{_force(high):.2f} N{_at(high)}"
    if slope.low > 0.0:
        return (
            f"a constant F_C is inadequate ({chance}): it increases from {ends[0]} to {ends[1]}; use the variant "
            f"{_VARIANT}, in which pressure adds to seal friction, with c_F = {_shown(slope, 'm²')} and "
            f"F_C = {_shown(intercept, 'N')}."
        )
    return (
        f"a constant F_C is inadequate ({chance}): it is {ends[0]} and {ends[1]}, but does not increase significantly "
        f"with the pressure, c_F = {_shown(slope, 'm²')}. Check for different speeds or running-in first."
    )


def _not_corrected(friction: CoulombFriction) -> list[str]:
    """Warning about friction that is not corrected for the pressure difference."""
    swings = [level.swing for level in friction.levels if math.isfinite(level.swing)]
    if friction.area is not None or not swings:
        return []
    return [
        f"the pressure is {swings[0] / 1e3:+.1f} kPa higher on the way out, and half of the resulting force is "
        "included in the friction: the area cannot be estimated from one level, so give `area`."
    ]


def _force(level: FrictionLevel) -> float:
    return level.friction.value


def _at(level: FrictionLevel) -> str:
    return f" at {level.pressure / 1e5:.2f} bar above ambient" if math.isfinite(level.pressure) else ""


def _shown(number: StudentEstimate, unit: str) -> str:
    bounds = f"95 %: {number.low:.3g} to {number.high:.3g}" if math.isfinite(number.std) else "no interval"
    return f"{number.value:.3g} {unit} ({bounds})"
