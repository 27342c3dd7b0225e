"""The vented rest on line: where the sensor reads it, against the calibration, rest by rest."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from clutchid.log import BoolArray, FloatArray
from clutchid.observer.state import RestWatch
from clutchid.strokes.rest_level import CLOSED, CREEP, LEVEL_BIN, STILL
from clutchid.strokes.sampled import runs
from clutchid.strokes.vented_rest import CLEARLY, VENTS, RestShift, VentedRest, rest_shift, unlike

#: A vented rest lies below this position in m, whatever its sensor adds; above it is an excursion.
LOW = 3e-3

#: What was learnt is forgotten where the zero moves by more than this in m: 0.4 mm leave a load up to 12 % off. Smaller
#: shifts come with wear and warmth, drive by drive, and the filter follows them. See docs/derivations_online.md.
WRONG = 1e-4

#: Rests after a stroke that are remembered; their median is compared.
REMEMBERED = 8

#: So many rests after a stroke agree if they differ by no more than this in m. Where they are further than that from
#: those before, at least `EARLIER`, which agree too, the sensor has moved, and its stop with it; where the stop before
#: does not go with them, what was before is forgotten. Within a recording levels of nine trucks differ by 0.05 mm at
#: most.
AGREEING, EARLIER, APART = 3, 2, 1.5e-4

#: The piston has stopped where the halves of a still window differ by no more than this in m: else it creeps back, and
#: its level is none. No vented piston lies further below its stop than the other, whatever creeps. The noise of a
#: sensor moves a level by 6 µm. What other limits do: `python benchmarks/creeping.py`.
STOPPED, BELOW = 2e-5, 5e-5

#: Where a calibration has its rests after a stroke further above the stop than this in m, they are holds of the
#: position: friction holds the piston of all trucks of A, B and hybrids up to 0.57 mm above it, 40 % more of it
#: 0.72 mm.
HOLD = 8e-4


class RestPace(NamedTuple):
    """Samples in a still window and in its bins, greatest range in m of the bins, and samples of a vented rest."""

    window: int
    bins: int
    range: float
    vents: int


@cache
def rest_pace(spacing: float, stroke: float) -> RestPace:
    """Numbers for samples that are `spacing` s apart, of an actuator with a stroke in m."""
    bins = max(1, round(LEVEL_BIN / spacing))
    window = max(3, round(STILL / (bins * spacing))) * bins
    return RestPace(window, bins, CREEP * stroke / 2, max(1, round(VENTS / spacing)))


def watch_rest(
    watch: RestWatch, before: VentedRest, pace: RestPace, position: FloatArray, duties: FloatArray
) -> tuple[RestWatch, list[tuple[int, float]]]:
    """Follow the vented rest through samples of a stretch; where its shift changes or is first seen, and what it is.

    A new level changes the shift only where its interval excludes it, so that recordings without a rest at the stop
    keep what an earlier one showed. Blocks of any length give the same.

    Parameters
    ----------
    before : VentedRest
        Of the calibration.
    position, duties
        Recorded positions in m, (n,), and duty cycles of supply and exhaust, (n, 2).
    """
    low = (position <= LOW) & (duties[:, 0] <= CLOSED)
    high = position > LOW
    changes: list[tuple[int, float]] = []
    at = 0
    for a, b in runs(low):
        watch = _passed(watch, high[at:a])
        watch, of_run = _low(watch, before, pace, position[a:b], duties[a:b, 1] > CLOSED)
        changes += [(a + index, shift) for index, shift in of_run]
        at = b
    return _passed(watch, high[at:]), changes


def _passed(watch: RestWatch, high: BoolArray) -> RestWatch:
    """After samples that are no rest: high ones belong to an excursion."""
    if high.size == 0:
        return watch
    away = bool(high.any())
    return watch._replace(
        window=np.empty(0), vents=0, excursion=watch.excursion or away, taken=watch.taken and not away
    )


def _low(
    watch: RestWatch, before: VentedRest, pace: RestPace, position: FloatArray, opened: BoolArray
) -> tuple[RestWatch, list[tuple[int, float]]]:
    """Follow low samples with the supply closed: the changes of the shift, by the number of the sample behind each."""
    changes: list[tuple[int, float]] = []
    at = 0
    while at < position.size:
        end = min(position.size, at + pace.window - watch.window.size)
        window = np.concatenate([watch.window, position[at:end]])
        watch = watch._replace(window=window, vents=watch.vents + int(opened[at:end].sum()))
        at = end
        if window.size < pace.window:
            break
        medians = np.median(window.reshape(-1, pace.bins), axis=1)
        still = float(np.ptp(medians)) <= pace.range
        if still and (watch.vents >= pace.vents or not watch.excursion):
            after = _with_level(watch, before, medians)
            if after is not watch and (np.isnan(watch.lowest) or after.shift != watch.shift):
                changes.append((at, after.shift))
            watch = after
        watch = watch._replace(window=np.empty(0), vents=watch.vents if still else 0)
    return watch, changes


def _with_level(watch: RestWatch, before: VentedRest, medians: FloatArray) -> RestWatch:
    """The state after a still and vented window: its level counts once a rest, where the piston has stopped.

    A level below the stop, as it is taken to be, says that this is wrong, also while the piston creeps.
    """
    level, half = float(np.median(medians)), medians.size // 2
    lowest, returned = float(np.fmin(watch.lowest, level)), watch.returned
    if not watch.taken and abs(float(np.median(medians[half:]) - np.median(medians[:half]))) <= STOPPED:
        returned = (*returned, level)[-REMEMBERED:] if watch.excursion else returned
        moved = _moved_stop(before, lowest, returned)
        if moved is not None:
            lowest, returned = moved, tuple(sorted(returned[-AGREEING:]))
        watch = watch._replace(taken=True)
    elif not (before.at_stop and level < before.lowest + watch.shift - BELOW):
        return watch
    shift = _believed(watch.shift, before, VentedRest(lowest, _median(returned), before.quantum))
    return watch._replace(shift=shift, lowest=lowest, returned=returned)


def _moved_stop(before: VentedRest, lowest: float, returned: tuple[float, ...]) -> float | None:
    """The stop in m, NaN where it is not known, where the last rests after a stroke agree that the sensor has moved.

    Without earlier ones only where they came down: above a stop that is where it was the piston creeps, or is held.
    """
    last, earlier = returned[-AGREEING:], returned[:-AGREEING]
    if not _agree(last, AGREEING):
        return None
    step = _median(last) - _median(earlier)
    if _agree(earlier, EARLIER) and abs(step) > APART:
        return lowest + step
    now = VentedRest(lowest, _median(returned), before.quantum)
    came_down = before.held <= HOLD and now.returned < before.returned
    return float("nan") if came_down and before.at_stop and now.at_stop and unlike(before, now) else None


def _agree(levels: tuple[float, ...], least: int) -> bool:
    return len(levels) >= least and bool(np.ptp(levels) <= APART)


def _median(levels: tuple[float, ...]) -> float:
    return float(np.median(levels)) if levels else float("nan")


def _believed(shift: float, before: VentedRest, now: VentedRest) -> float:
    """The shift in m after a new level: as before unless its interval excludes that."""
    apart = _compared(before, now)
    if apart is None or apart.low <= shift <= apart.high:
        return shift
    return apart.value if apart.moved else 0.0


def _compared(before: VentedRest, now: VentedRest) -> RestShift | None:
    """The shift, but by the stop alone where the calibration has holds, and not up where the stop is where it was."""
    if before.held > HOLD:
        return rest_shift(before, now._replace(returned=now.lowest + before.held)) if now.at_stop else None
    apart, stays = rest_shift(before, now), now.at_stop and now.lowest - before.lowest <= CLEARLY
    return None if apart and apart.value > 0.0 and stays and not before.at_stop else apart


def new_stretch(watch: RestWatch) -> RestWatch:
    """State after a hole, in which a sensor may have been exchanged: the shift stays until the next rest."""
    return RestWatch(shift=watch.shift)
