"""The last samples of a stretch without holes, and what the next ones need of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.log import INPUTS, FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.recordings.signals.excitation import VENTED_POSITION
from clutchid.simulation.inputs import held_inputs
from clutchid.simulation.plan import OUTSIDE, Segment

Mask = NDArray[np.bool_]

#: As many equal samples of the position in a row are a frozen sensor, and the later ones are left out.
FROZEN = 15


class Tail(NamedTuple):
    """The last samples of a stretch without holes: what the next one needs of them, and how many equal positions.

    `supply` is the recorded supply pressure in Pa, NaN where there is none.
    """

    time: FloatArray
    duties: FloatArray
    position: FloatArray
    supply: FloatArray


#: Before the first sample of a stretch.
EMPTY = Tail(np.empty(0), np.empty((0, 2)), np.empty(0), np.empty(0))


def segment_of(samples: Tail, actuator: Actuator) -> Segment:
    """The samples for the filter; nothing but the first is used to start."""
    m = samples.time.size
    log = Log(samples.time, dict(zip(INPUTS, samples.duties.T, strict=True)))
    dt = np.diff(samples.time)
    position = float(np.clip(samples.position[0], -OUTSIDE, actuator.parameters.y_max + OUTSIDE))
    return Segment(
        start=0,
        stop=m,
        inputs=held_inputs(log, actuator, 0, m) if m > 1 else np.zeros((1, 2)),
        dt=dt,
        open_std=np.zeros(dt.size),
        substeps=np.zeros(dt.size, dtype=np.int32),
        jump=np.zeros(m, dtype=np.uint8),
        measured=np.zeros((m, 2)),
        position_start=position,
        pressure_start=np.nan,
        vented=abs(position) <= VENTED_POSITION,
    )


def usable_positions(position: FloatArray) -> Mask:
    """Whether each position is finite and not that of a frozen sensor."""
    index = np.arange(position.size)
    changed = np.append(True, position[1:] != position[:-1])
    usable: Mask = np.isfinite(position) & (index - np.maximum.accumulate(np.where(changed, index, 0)) < FROZEN)
    return usable


def measured_values(samples: Tail, usable: Mask, supply: float | None) -> FloatArray:
    """What the filter compares with, NaN for none: the position, and the supply pressure if a ratio of it is given.

    It counts while no valve is open, when it is the same in the vehicle's reservoir and before the valve.

    Parameters
    ----------
    supply : 1
        Estimated over recorded supply pressure, see `Supply`.

    Returns
    -------
    values : (samples, columns)
    """
    position = np.where(usable, samples.position, np.nan)
    if supply is None:
        return position[:, None]
    closed = np.all(samples.duties <= 0.0, axis=1) & np.isfinite(samples.supply)
    return np.column_stack([position, np.where(closed, supply * samples.supply, np.nan)])


def last_samples(samples: Tail, seconds: float) -> Tail:
    """The samples that the next one needs: those of the last `seconds`, and those that may be frozen."""
    begin = int(np.searchsorted(samples.time, samples.time[-1] - seconds))
    begin = max(0, min(begin, samples.time.size - FROZEN - 1))
    return Tail(*(array[begin:].copy() for array in samples))
