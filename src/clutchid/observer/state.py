"""State of an observer between two samples: its filter, strokes, and the last samples of its stretch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from clutchid.codegen.records import new_record, record_copy
from clutchid.inference.filter.setup import FilterState
from clutchid.log import BoolArray, FloatArray, IntArray, all_of
from clutchid.model.actuator import Actuator
from clutchid.observer.flags import HEALED, Faults
from clutchid.observer.intake import Intake
from clutchid.observer.mismatch import Mismatch, mismatch_from
from clutchid.observer.rest import Rest
from clutchid.simulation.inputs import with_carrier
from clutchid.simulation.plan import Segment
from clutchid.strokes.excitation import VENTED_POSITION
from clutchid.strokes.rule import Watch
from clutchid.strokes.stroke import Stroke

#: As many equal samples of the position in a row are a frozen sensor, and the later ones are left out.
FROZEN = 15


class Tail(NamedTuple):
    """The last samples of a stretch without holes: what the next one needs of them, and how many equal positions.

    `supply` is the recorded supply pressure in Pa, NaN where there is none; `open_std` how long in s a valve may have
    been open besides its duty cycle in the interval that ends at a sample: 0 where that is known.
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


class Inputs(NamedTuple):
    """State of the inputs between two samples: records of the intake, and memory of its vented rest."""

    intake: Intake
    watch: Watch
    stroke: Stroke
    rest: Rest
    bin: FloatArray
    medians: FloatArray

    def copied(self) -> Inputs:
        """A copy that kernels may change."""
        return Inputs._make(map(record_copy, self))


class Sound(NamedTuple):
    """The parameters as known at the end of a stroke: theta, T, G and wear of `ObserverState`."""

    theta: FloatArray
    T: FloatArray
    G: FloatArray
    wear: IntArray


#: Before the first sample.
NO_FAULTS, AS_CALIBRATED = new_record(Faults, strokes=HEALED), mismatch_from(1.0)


class ObserverState(NamedTuple):
    """State of an observer between two samples.

    `theta` (k,) and `T` (k, k), a root of their covariance, are what is known of the parameters that adapt, `G` (k, c)
    the derivatives of their error with respect to what is considered, and `wear` (1,) counts what T has still to gain
    for strokes that have ended, see `FilterState`; `filter` is None before the first sample of a stretch. `deviations`
    (states,) are those of the last correction, NaN before it. `number` counts the samples of the stretch, and `partial`
    says whether it began within the stroke that goes on, which then teaches nothing. `sound` is what was known at the
    end of the last of `strokes`, to which the observer goes back if it diverges; `nis` are the means of the NIS over
    the usual one, see `mismatch`; `leaking` says whether chamber A leaked at the end of the last stroke; `zero` is what
    is subtracted from the position in m; `latest` is the time in s of the last sample; `excess` is the sum of the
    innovations' excess in s, and `contradicted` is the time in s at which innovations last contradicted the inputs, NaN
    if they have not; `faults` are those of late; `temperature` is that of the air in K that the model is at, 0 where
    none is known, and `air_known` says whether it is not lost; `inputs` are what is known of the samples.
    """

    filter: FilterState | None
    theta: FloatArray
    T: FloatArray
    G: FloatArray
    wear: IntArray
    tail: Tail
    deviations: FloatArray
    sound: Sound
    inputs: Inputs
    number: int = 0
    partial: bool = False
    strokes: int = 0
    nis: Mismatch = AS_CALIBRATED
    leaking: bool = False
    zero: float = 0.0
    latest: float = float("nan")
    excess: float = 0.0
    contradicted: float = float("nan")
    faults: Faults = NO_FAULTS
    temperature: float = 0.0
    air_known: bool = False

    @property
    def mismatch(self) -> float:
        """Mean of the NIS over that in the calibration recordings."""
        return float(self.nis.running)

    @property
    def rest_shift(self) -> float:
        """How far in m the vented rest is taken to have moved since the calibration."""
        return float(self.inputs.rest.shift)

    @property
    def jumped(self) -> bool:
        """Whether the position has jumped and stayed."""
        return bool(self.inputs.intake.jumped)

    @property
    def unzeroed(self) -> bool:
        """Whether no vented rest has shown the zero of the position since."""
        return bool(self.inputs.intake.unzeroed)
