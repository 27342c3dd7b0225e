"""The samples of a block as the filter takes them, by the rules of `clutchid.observer.intake`."""

from __future__ import annotations

from functools import cache, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from clutchid.codegen.kernels import kernels_in
from clutchid.codegen.records import Records, layout, new_record
from clutchid.inference.filter.setup import LONG
from clutchid.log import HOLE, INPUTS, Log
from clutchid.observer.intake import BRIDGED, Input, Intake, IntakeLimits, Sample
from clutchid.observer.rest import Rest, RestBefore
from clutchid.observer.state import Inputs
from clutchid.strokes.rest_level import CREEP, LEVEL_BIN, STILL
from clutchid.strokes.rest_shift import level_interval
from clutchid.strokes.rule import ValueLimits
from clutchid.strokes.stroke import LONGEST_US, RESOLUTION, Stroke
from clutchid.strokes.values import limits, new_watch
from clutchid.strokes.vented_rest import VENTS

if TYPE_CHECKING:
    from clutchid.observer.configuration import Observer

#: Share of the usual interval: in a shorter one a sample repeats the last one, as of a clock too coarse or a task that
#: is called twice.
SHORT = 0.1

#: Columns of `Input`.
_COLUMNS = ("position", *INPUTS, "pressure_supply")


class WindowSize(NamedTuple):
    """Samples in a bin of a vented rest, and bins in a still window."""

    bin: int
    bins: int


def window_size(spacing: float) -> WindowSize:
    """Numbers for samples that are `spacing` s apart."""
    samples = max(1, round(LEVEL_BIN / spacing))
    return WindowSize(samples, max(3, round(STILL / (samples * spacing))))


@cache
def no_inputs(spacing: float) -> Inputs:
    """State of the inputs before the first of samples that are `spacing` s apart."""
    intake = new_record(Intake, supply=np.nan, undriven=LONGEST_US)
    rest, (samples, bins) = new_record(Rest, lowest=np.nan), window_size(spacing)
    return Inputs(intake, new_watch(), new_record(Stroke), rest, np.zeros(samples), np.zeros(bins))


class Rules(NamedTuple):
    """Limits and calibrated values by which samples are taken in."""

    limits: IntakeLimits
    bounds: ValueLimits
    before: RestBefore


@lru_cache(maxsize=4)
def rules(observer: Observer) -> Rules:
    """The rules of an observer."""
    spacing, y_max = round(observer.spacing / RESOLUTION), observer.actuator.parameters.y_max
    supply, air = observer.supply, observer.air
    of_samples = new_record(
        IntakeLimits, spacing=spacing, shortest=round(SHORT * spacing), gap=int(LONG * spacing), y_max=y_max,
        hole=int(HOLE * spacing), longest=max(int(HOLE * spacing), BRIDGED + spacing),
        suspect_from=min(observer.suspect_from, 1.0),
        supply=supply.recorded if supply else 0.0, air=air.calibrated if air else 0.0,
    )  # fmt: skip
    rest = observer.calibration.rest if observer.calibration else None
    size = window_size(observer.spacing)
    before = new_record(
        RestBefore, exists=int(rest is not None), subtracted=int(observer.zero == "subtract"),
        lowest=rest.lowest if rest else np.nan, returned=rest.returned if rest else np.nan,
        level=level_interval(rest.quantum if rest else 0.0),
        range=CREEP * y_max / 2, bin=size.bin, bins=size.bins, vents=max(1, round(VENTS / observer.spacing)),
    )  # fmt: skip
    return Rules(of_samples, limits(observer.actuator, "position", observer.spacing), before)


def taken_in(observer: Observer, inputs: Inputs, latest: float, block: Log) -> tuple[Records, Inputs]:
    """The samples of a block (n,), records of `clutchid.observer.intake.Sample`, and what is known after them.

    Parameters
    ----------
    latest : s
        Time of the last sample before it, NaN without one.
    """
    samples, none = np.zeros(len(block), layout(Sample)), np.full(len(block), np.nan)
    after = inputs.copied()
    columns = np.column_stack([block.columns.get(name, none) for name in _COLUMNS])
    air = block.columns.get("temperature_ambient", none)
    kernels_in("clutchid.observer.intake_rule").take_in_all(
        *after, *rules(observer), new_record(Input), latest, block.time, columns, air, samples
    )
    return samples, after
