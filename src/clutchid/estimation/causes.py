"""Faults of the inputs of a recording that its calibration does not explain, compared by an observer.

A position that is late or filtered, weaker duty cycles, a clock that drifts, an inverted valve: each is undone, and the
innovations of the observer say how well the recording then agrees with the calibration. The fault that does best is
the cause if a reading of the recording without it is explained.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.estimation.assess.reasons import SUSPICIOUS, is_explained, named_cause
from clutchid.estimation.result import Fit, InputFault
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import GAUGE, supply_difference
from clutchid.log import INPUTS, Log
from clutchid.model.actuator import Actuator

#: Longest part of a recording in s that is compared.
_COMPARED = 30.0

#: Halvings of the distance to the neighbouring sizes by which the size of a fault is found, of the likeliest faults.
_HALVINGS, _REFINED = 4, 2


class _Fault(NamedTuple):
    """A fault with the sizes that are tried, how one is undone, and its words with a size in their unit.

    A fault of a size below 0 has the second words. Sizes between those of `harmless` are none.
    """

    name: str
    sizes: tuple[float, ...]
    undone: Callable[[Log, float], Log]
    words: tuple[str, ...]
    unit: float
    remedy: str
    harmless: tuple[float, float] = (0.0, 0.0)


#: Follows a recording without a fault of a size, see `_cause`.
_Follow = Callable[[_Fault | None, float], InputFault | None]


def _moved(log: Log, late: float) -> Log:
    return log.with_columns(position=np.interp(log.time + late, log.time, log["position"]))


def _unfiltered(log: Log, lag: float) -> Log:
    """The recording before a first-order filter of its position."""
    decay, y = np.exp(-np.diff(log.time) / lag), log["position"]
    return log.with_columns(position=np.append(y[:1], (y[1:] - decay * y[:-1]) / (1.0 - decay)))


def _divided(log: Log, gain: float) -> Log:
    return log.with_columns(**{name: np.clip(log[name] / gain, 0.0, 1.0) for name in INPUTS})


def _on_clock(log: Log, fast: float) -> Log:
    sent = log.time[0] + (log.time - log.time[0]) * (1.0 - fast)
    at = np.clip(np.searchsorted(log.time, sent, side="right") - 1, 0, len(log) - 1)
    return log.with_columns(**{name: log[name][at] for name in INPUTS})


def _inverted(*names: str) -> Callable[[Log, float], Log]:
    return lambda log, _: log.with_columns(**{name: 1.0 - log[name] for name in names})


def _swapped(log: Log, _: float) -> Log:
    return log.with_columns(**{name: log[other] for name, other in zip(INPUTS, INPUTS[::-1], strict=True)})


def _signed(*sizes: float) -> tuple[float, ...]:
    return (*(-size for size in reversed(sizes)), *sizes)


_BY_MAP = "correct it in the channel map"

_FAULTS = (
    _Fault(
        "shift", _signed(0.005, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1), _moved,
        ("the position is {:.0f} ms late against the duty cycles", "the duty cycles are {:.0f} ms late"), 1e-3,
        "give the channel that delay in the channel map", (-0.003, 0.003),
    ),
    _Fault(
        "filter", (0.004, 0.008, 0.016, 0.032), _unfiltered,
        ("the position is filtered with a time constant of {:.0f} ms",), 1e-3,
        "record it before the filter", (0.0, 0.003),
    ),
    _Fault(
        "gain of the duty cycles", (0.5, 0.6, 0.7, 0.8, 1.25, 1.6), _divided,
        ((
            "the recorded duty cycles are {:.2f} times those of the valves, or the flow of the valves has changed "
            "by this factor"
        ),),
        1.0, f"check the drivers of the valves, or {_BY_MAP}", (0.9, 1.1),
    ),
    _Fault(
        "clock", _signed(0.0005, 0.001, 0.002, 0.004, 0.008), _on_clock,
        ("the clock of the duty cycles is {:.2f} % fast", "the clock of the duty cycles is {:.2f} % slow"), 1e-2,
        "record all channels on one clock", (-3e-4, 3e-4),
    ),
    _Fault("duty_supply inverted", (0.0,), _inverted(INPUTS[0]), ("duty_supply is inverted",), 1.0, _BY_MAP),
    _Fault("duty_exhaust inverted", (0.0,), _inverted(INPUTS[1]), ("duty_exhaust is inverted",), 1.0, _BY_MAP),
    _Fault("both inverted", (0.0,), _inverted(*INPUTS), ("both duty cycles are inverted",), 1.0, _BY_MAP),
    _Fault("swapped", (0.0,), _swapped, ("duty_supply and duty_exhaust are swapped",), 1.0, _BY_MAP),
)  # fmt: skip


def with_causes(fit: Fit, log: Log, start: Actuator, calibration: Calibration, read: Callable[[Log], Fit]) -> Fit:
    """A reading with what may be wrong with its inputs: faults that were compared, and readings without them.

    Parameters
    ----------
    fit : Fit
        Reading of `log`.
    start : Actuator
        As calibrated.
    read
        Reads another recording from the same calibration.
    """
    alternatives: dict[str, Fit] = {}
    if supply_difference(log, start, calibration.conditions) is not None:
        alternatives[GAUGE] = read(log.without("pressure_supply"))
    if is_explained(fit):
        return replace(fit, alternatives=alternatives)
    causes = compared_causes(log, start, calibration)
    if cause := named_cause(causes):
        fault = next(fault for fault in _FAULTS if fault.name == cause.name)
        reading = read(fault.undone(log, cause.size))
        alternatives |= {fault.name: reading} if is_explained(reading) else {}
    return replace(fit, causes=causes, alternatives=alternatives)


def compared_causes(log: Log, actuator: Actuator, calibration: Calibration) -> tuple[InputFault, ...]:
    """Faults of the inputs, and none, by the likelihood of the innovations without them, the best first.

    Faults are compared where the innovations are suspicious. Empty for a recording that an observer cannot follow.
    """
    part = log.slice(0, int(np.searchsorted(log.time, log.time[0] + _COMPARED)))
    follow = partial(_cause, part, actuator, calibration)
    as_recorded = follow(None, 0.0)
    if as_recorded is None or as_recorded.innovations <= SUSPICIOUS:
        return (as_recorded,) if as_recorded else ()
    sizes = [_tried(fault, fault.sizes, {}, follow) for fault in _FAULTS]
    best = [_best(fault, tried) for fault, tried in zip(_FAULTS, sizes, strict=True)]
    likeliest = sorted(filter(None, best), key=lambda cause: -cause.log_likelihood)[:_REFINED]
    for i, fault in enumerate(_FAULTS):
        if best[i] in likeliest and len(fault.sizes) > 1:
            best[i] = _refined(fault, sizes[i], follow)
    return tuple(sorted([as_recorded, *filter(None, best)], key=lambda cause: -cause.log_likelihood))


def _tried(
    fault: _Fault, sizes: Iterable[float], tried: Mapping[float, InputFault], follow: _Follow
) -> dict[float, InputFault]:
    """Sizes of a fault that were `tried`, and further ones; those that cannot be followed are left out."""
    further = {size: follow(fault, size) for size in sizes if size not in tried}
    return {**tried, **{size: cause for size, cause in further.items() if cause}}


def _refined(fault: _Fault, tried: Mapping[float, InputFault], follow: _Follow) -> InputFault | None:
    """A fault with its size found by halving the distance to the neighbouring ones."""
    for _ in range(_HALVINGS):
        ordered = sorted(tried)
        at = ordered.index(max(tried, key=lambda size: tried[size].log_likelihood))
        around = ordered[max(0, at - 1) : at + 2]
        tried = _tried(fault, ((a + b) / 2.0 for a, b in pairwise(around)), tried, follow)
    return _best(fault, tried)


def _best(fault: _Fault, tried: Mapping[float, InputFault]) -> InputFault | None:
    """A fault with the size that does best; None where no size can be followed."""
    low, high = fault.harmless
    faults = [cause for size, cause in tried.items() if not low < size < high]
    return max(faults, key=lambda cause: cause.log_likelihood, default=None)


def _cause(
    log: Log, actuator: Actuator, calibration: Calibration, fault: _Fault | None, size: float
) -> InputFault | None:
    """The innovations without a fault of this size; None for a recording that an observer cannot follow."""
    from clutchid.observer import observer  # on use: most readings do without an observer
    from clutchid.observer.configuration import start
    from clutchid.observer.following import observe
    from clutchid.observer.mismatch import normalised
    from clutchid.observer.run import spacing, too_slow, usable

    corrected = fault.undone(log, size) if fault else log
    if not usable(corrected) or too_slow(corrected, actuator) or not calibration.nis > 0.0:
        return None
    try:
        follower = observer(actuator, spacing=spacing(corrected), calibration=calibration)
        _, samples = observe(follower, start(follower), corrected)
    except (DataError, ParameterError):  # a reading is not lost for it
        return None
    nis = normalised(follower, samples.states, samples.innovations)
    innovation, variance = samples.innovations[np.isfinite(samples.innovations[:, 0])].T
    if not np.isfinite(nis).any():
        return None
    squared = np.minimum(innovation**2 / variance, float(follower.joint.noise.outlier) ** 2)
    likelihood = -0.5 * float(np.mean(squared + np.log(variance)))
    ratio = float(np.nanmean(nis)) / calibration.nis
    if fault is None:
        return InputFault("as recorded", "", "", 0.0, ratio, likelihood)
    words = fault.words[-1 if size < 0.0 else 0].format(abs(size) / fault.unit)
    return InputFault(fault.name, words, fault.remedy, size, ratio, likelihood)
