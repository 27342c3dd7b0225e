"""The reason against a fit of recordings that lack edges of the valves."""

from __future__ import annotations

from clutchid.estimation.assess.reason import Reason
from clutchid.estimation.result import Fit
from clutchid.inference.uncertainty.identifiability import listed
from clutchid.log import sample_interval
from clutchid.recordings.signals.duty_cycle import is_slow


def slow_reasons(fit: Fit) -> list[Reason]:
    """That recordings are slower than the changes of their duty cycles; none if none of them is."""
    logs = {name: one.measured for name, one in fit.recordings.items()}
    slow = [name for name, log in logs.items() if is_slow(log)]
    if not slow:
        return []
    slowest = min(1.0 / sample_interval(logs[name].time) for name in slow)
    text = f"{listed(slow)}: at {slowest:.3g} Hz the valves open and close between the samples, at times that are not "
    text += "recorded. "
    if fit.baseline is not None and "pressure_a" not in fit.scales:
        text += "The interval is widened for that, but by what it costs on virtual trucks only; "
    else:
        text += "The load may have errors that its interval does not include; "
    return [Reason(f"{text}record position and duty cycles at 1 kHz.")]
