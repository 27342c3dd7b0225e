"""State of an observer between two samples: its filter, strokes, and the last samples of its stretch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.inference.filter.setup import FilterState
from clutchid.log import BoolArray, FloatArray, IntArray, all_of, read_only
from clutchid.model.actuator import Actuator
from clutchid.simulation.inputs import with_carrier
from clutchid.simulation.plan import Segment
from clutchid.strokes.excitation import VENTED_POSITION
from clutchid.strokes.stroke import NO_STROKES, Strokes
from clutchid.strokes.values import NO_SUPPLY, new_watch

#: As many equal samples of the position in a row are a frozen sensor, and the later ones are left out.
FROZEN = 15


class Tail(NamedTuple):
    """The last samples of a stretch without holes: what the next one needs of them, and how many equal positions.

    `supply` is the recorded supply pressure in Pa, NaN where there is none; `open_std` how long in s a valve may have
    been open besides its duty cycle in the interval that ends at a sample: 0 where that is known, see `gaps`.
    """

    time: FloatArray
    duties: FloatArray
    position: FloatArray
    supply: FloatArray
    open_std: FloatArray


#: Before the first sample of a stretch.
EMPTY = Tail(np.empty(0), np.empty((0, 2)), *np.empty((3, 0)))


def segment_of(samples: Tail, actuator: Actuator) -> Segment:
    """The samples for the filter; nothing but the first is used to start."""
    m = samples.time.size
    dt = samples.time[1:] - samples.time[:-1]
    position = float(samples.position[0])
    return Segment(
        start=0,
        stop=m,
        inputs=with_carrier(samples.time, samples.duties, actuator) if m > 1 else np.zeros((1, 2)),
        dt=dt,
        open_std=samples.open_std[1:],
        substeps=np.zeros(dt.size, dtype=np.int32),
        jump=np.zeros(m, dtype=np.uint8),
        measured=np.zeros((m, 2)),
        position_start=position,
        pressure_start=np.nan,
        vented=position <= VENTED_POSITION,
    )


def usable_positions(position: FloatArray) -> BoolArray:
    """Whether each position is finite and not that of a frozen sensor."""
    usable: BoolArray = np.isfinite(position)
    changed = position[1:] != position[:-1]
    if all_of(changed):
        return usable
    index, changed = np.arange(position.size), np.append(True, changed)
    usable &= (index - np.maximum.accumulate(np.where(changed, index, 0))) < FROZEN
    return usable


def filter_values(samples: Tail, usable: BoolArray, supply: float | None) -> FloatArray:
    """Measured values of the filter, NaN for none: the position, and the supply pressure if a ratio of it is given.

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
    begin = int(samples.time.searchsorted(samples.time[-1] - seconds))
    begin = max(0, min(begin, samples.time.size - FROZEN - 1))
    return Tail(*(array[begin:].copy() for array in samples))


class RestWatch(NamedTuple):
    """State of the vented rest between two samples.

    `shift` is how far in m it is taken to have moved since the calibration. `lowest` and `returned` are the levels in m
    of the stretch: the lowest, NaN before there is one, and the last ones after a stroke. `window` are the positions
    since the last still window, `vents` the samples with an open exhaust valve since the piston came to rest;
    `excursion` says whether the piston was away before, `taken` whether the level of the present rest has been.
    """

    shift: float = 0.0
    lowest: float = float("nan")
    returned: tuple[float, ...] = ()
    window: FloatArray = np.empty(0)
    vents: int = 0
    excursion: bool = False
    taken: bool = False


#: Before the first sample.
NOTHING = RestWatch()


class Sound(NamedTuple):
    """The parameters as known at the end of a stroke: theta, T, G and wear of `ObserverState`."""

    theta: FloatArray
    T: FloatArray
    G: FloatArray
    wear: IntArray


class ObserverState(NamedTuple):
    """State of an observer between two samples.

    `theta` (k,) and `T` (k, k), a root of their covariance, are what is known of the parameters that adapt, `G` (k, c)
    the derivatives of their error with respect to what is considered, and `wear` (1,) counts what T has still to gain
    for strokes that have ended, see `FilterState`; `filter` is None before the first sample of a stretch. `deviations`
    (states,) are those of the last correction, NaN before it. `number` counts the samples of the stretch, and `partial`
    says whether it began within the stroke that goes on, which then teaches nothing. `sound` is what was known at the
    end of the last stroke, to which the observer goes back if it diverges; `mismatch` is the present mean of the NIS
    over the usual one, see `mismatch`; `leaking` says whether chamber A leaked at the end of the last stroke; `rest` is
    what is known of the vented rest, and `zero` what is subtracted from the position in m; `values` watches for
    positions that are no values; `jumped` says whether one has jumped and stayed, and `unzeroed` are the times in s of
    such jumps, in order, since which no vented rest has shown the zero; `latest` is the time in s of the last sample
    that counts, and `known` that of the last one with both duty cycles, NaN for none; `excess` is the sum of the
    innovations' excess in s, and `contradicted` is the time in s at which innovations last contradicted the inputs, NaN
    if they have not; `supply` watches for supply pressures that cannot be right; `temperature` is that of the air in K
    that the model is at, `aired` the time in s at which one last counted, NaN where none has, and `air_refused` says
    whether the last recorded temperature does not.
    """

    filter: FilterState | None
    theta: FloatArray
    T: FloatArray
    G: FloatArray
    wear: IntArray
    tail: Tail
    deviations: FloatArray
    sound: Sound
    number: int = 0
    partial: bool = False
    strokes: Strokes = NO_STROKES
    mismatch: float = 1.0
    leaking: bool = False
    rest: RestWatch = NOTHING
    zero: float = 0.0
    values: FloatArray = read_only(new_watch())
    jumped: bool = False
    unzeroed: tuple[float, ...] = ()
    latest: float = float("nan")
    known: float = float("nan")
    excess: float = 0.0
    contradicted: float = float("nan")
    supply: FloatArray = read_only(np.array(NO_SUPPLY))
    temperature: float = float("nan")
    aired: float = float("nan")
    air_refused: bool = False
