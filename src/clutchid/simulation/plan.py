"""Plan of a simulation of a recording, fixed once: segments, steps, resets and starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log import FloatArray, Log, holes
from clutchid.messages import listed
from clutchid.model.actuator import Actuator
from clutchid.simulation.inputs import held_inputs, with_both_duties
from clutchid.simulation.partition import Partition
from clutchid.simulation.stiffness import substeps
from clutchid.strokes.excitation import VENTED_POSITION
from clutchid.strokes.sampled import runs

#: Least number of samples between holes: a shorter stretch determines less than its own unknown start needs.
SHORTEST_STRETCH = 10

#: A position further outside the stroke than this, in m, is no position of a piston: start and resets stop there.
OUTSIDE = 2e-4

#: Further outside than this part of the stroke, a position has another unit, sign or zero.
_ALIEN = 0.2

#: A recording starts vented and at rest when it stays within `VENTED_POSITION` of zero, and this still, for
#: `_REST_TIME` s or until the supply valve opens. The rest before that, up to `REST_WINDOW` s, gives the position at
#: the start.
_REST_RANGE, _REST_TIME, REST_WINDOW = 3e-4, 0.02, 0.5


_JUMPS = {("p", False): 1, ("q", False): 2, ("p", True): 3, ("q", True): 4}


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A stretch of a recording without holes in its inputs.

    `start` and `stop` are sample numbers in the recording; `jump` and `measured` say where and with what the state is
    re-initialised. `vented`: Eq. (24) gives the start, and `rest` samples before the supply valve opens its position;
    else position and pressure there are unknown, unless `pressure_start` is measured. `open_std` (n - 1,) is the
    standard deviation in s of the time that a fully open valve is open in each interval, 0 where the recording has
    every change of the duty cycles.
    """

    start: int
    stop: int
    inputs: FloatArray
    dt: FloatArray
    open_std: FloatArray
    substeps: NDArray[np.int32]
    jump: NDArray[np.uint8]
    measured: FloatArray
    position_start: float
    pressure_start: float
    vented: bool
    rest: int = 0

    def __len__(self) -> int:
        return self.stop - self.start


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A recording prepared for simulation with `actuator`.

    `phase_std` is the standard deviation of the carrier's phase ``s_pwm`` in the recording, 0 where it is known.
    """

    log: Log
    segments: tuple[Segment, ...]
    warnings: tuple[str, ...]
    actuator: Actuator
    phase_std: float = 0.0


def plan(
    log: Log,
    actuator: Actuator,
    rate: float,
    partition: Partition | None = None,
    use_pressure: bool = False,
    open_std: FloatArray | None = None,
) -> Plan:
    """Cut `log` into segments and fix steps, resets and starts.

    Parameters
    ----------
    log : Log
        With both duty cycles; resets and starts need the position, `use_pressure` the pressure.
    actuator : Actuator
        Its ambient pressure and the closing of its valves show a vented start.
    rate : 1/s
        Stiffness that the integration steps must follow, see `clutchid.simulation.stiffness`.
    partition : Partition, optional
        Where the measured position is taken again; ballistic without.
    use_pressure : bool
        Whether the measured pressure of chamber A is in use: then starts and resets take it.
    open_std : (n - 1,) in s, optional
        Standard deviation of the time that a fully open valve is open in each interval, see `Segment`; default 0.

    Raises
    ------
    DataError
        As `input_span`; and if no stretch has two samples with known inputs.
    """
    has_inputs = with_both_duties(log)
    first, bounds = int(np.argmax(has_inputs)), _stretches(log.time, has_inputs)
    if not bounds:
        raise DataError(f"{log.name}: no two neighbouring samples have both duty cycles; nothing can be simulated.")
    y_max = actuator.parameters.y_max
    resets = _resets(log, partition, use_pressure)
    np.clip(resets[1][:, 0], -OUTSIDE, y_max + OUTSIDE, out=resets[1][:, 0])
    uncertain = np.zeros(len(log) - 1) if open_std is None else open_std
    segments = [
        _segment(log, actuator, rate, use_pressure, resets, uncertain, span, span[0] == first) for span in bounds
    ]
    warnings = []
    if len(segments) > 1:
        cuts = listed(f"{log.time[s.start]:.3f} s" for s in segments[1:])
        warnings.append(
            f"{log.name}: gaps in time or in an input divide the recording into {len(segments)} segments; position "
            f"and pressure start again at {cuts}."
        )
    return Plan(log, tuple(segments), (*warnings, *outside_stroke(log, y_max).sentences), actuator)


class OutsideStroke(NamedTuple):
    """The sentence where a position leaves the stroke, or none, and whether it is not one of such a piston."""

    sentences: tuple[str, ...]
    alien: bool


def outside_stroke(log: Log, y_max: float) -> OutsideStroke:
    """Whether the measured position leaves the stroke of `y_max` m."""
    position = log["position"][np.isfinite(log["position"])] if "position" in log else np.zeros(0)
    if position.size == 0:
        return OutsideStroke((), False)
    low, high = (float(q) for q in np.percentile(position, (0.5, 99.5)))
    if low > -OUTSIDE and high < y_max + 5 * OUTSIDE:
        return OutsideStroke((), False)
    sentence = (
        f"{log.name}: the position runs from {position.min() * 1e3:.4g} to {position.max() * 1e3:.4g} mm, outside the "
        f"stroke of 0 to {y_max * 1e3:g} mm; check its unit, its sign and its zero."
    )
    return OutsideStroke((sentence,), low < -_ALIEN * y_max or high > (1 + _ALIEN) * y_max)


def _stretches(time: FloatArray, has_inputs: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Sample ranges with known inputs and without holes in time; stretches that are too short are left out."""
    stretches = [(a, b + 1) for a, b in runs(has_inputs[:-1] & has_inputs[1:] & ~holes(time))]
    return stretches if len(stretches) < 2 else [(a, b) for a, b in stretches if b - a >= SHORTEST_STRETCH]


def _resets(log: Log, partition: Partition | None, use_pressure: bool) -> tuple[NDArray[np.uint8], FloatArray]:
    """Kind of reset per sample and the measured position and pressure that it takes.

    Where the position is missing at a reset, the reset waits for the next finite one.
    """
    n = len(log)
    jump = np.zeros(n, dtype=np.uint8)
    measured = np.zeros((n, 2))
    if partition is None:
        return jump, measured
    measured[:, 0] = log["position"]
    measured[:, 1] = log["pressure_a"] if use_pressure and partition.take == "all" else np.nan
    finite = np.flatnonzero(np.isfinite(measured[:, 0]))
    at = np.searchsorted(finite, partition.resets(n))
    taken = np.unique(finite[at[at < finite.size]])
    pressure = np.isfinite(measured[taken, 1])
    jump[taken] = np.where(pressure, _JUMPS[partition.carry, True], _JUMPS[partition.carry, False])
    return jump, measured


def _segment(
    log: Log,
    actuator: Actuator,
    rate: float,
    use_pressure: bool,
    resets: tuple[NDArray[np.uint8], FloatArray],
    open_std: FloatArray,
    span: tuple[int, int],
    begins: bool,
) -> Segment:
    """The samples of a `span` of a recording, which `begins` there, or goes on after a hole."""
    start, stop = span
    jump, measured = resets[0][start:stop].copy(), resets[1][start:stop]
    jump[0] = 0
    dt = np.diff(log.time[start:stop])
    inputs = held_inputs(log, actuator, start, stop)
    position = log["position"][start:stop] if "position" in log else np.full(stop - start, np.nan)
    pressure = log["pressure_a"][start:stop] if use_pressure else np.full(stop - start, np.nan)
    rest = _rest(log.time[start:stop], position, inputs[:, 0] <= actuator.parameters.R_0vs)
    vented = begins and _vented(rest[: max(2, int(_REST_TIME / dt[0]))], position)
    first = float(np.median(rest)) if vented and rest.size else _first_finite(position, 0.0)
    return Segment(
        start=start,
        stop=stop,
        inputs=inputs,
        dt=dt,
        open_std=open_std[start : stop - 1],
        substeps=substeps(dt, rate),
        jump=jump,
        measured=np.ascontiguousarray(measured),
        position_start=float(np.clip(first, -OUTSIDE, actuator.parameters.y_max + OUTSIDE)),
        pressure_start=_first_finite(pressure[: max(2, int(_REST_TIME / dt[0]))], np.nan),
        vented=vented,
        rest=rest.size if vented else 0,
    )


def _rest(time: FloatArray, position: FloatArray, closed: NDArray[np.bool_]) -> FloatArray:
    """Measured positions before the supply valve first opens, at most `REST_WINDOW` s of them."""
    opens = int(np.argmin(closed)) if not closed.all() else closed.size
    within = int(np.searchsorted(time, time[0] + REST_WINDOW))
    before = position[: max(1, min(opens, within))]
    return before[np.isfinite(before)]


def _vented(rest: FloatArray, position: FloatArray) -> bool:
    """Whether a segment starts vented and at rest: still and near zero until the supply valve opens."""
    if not np.isfinite(position).any():
        return True
    if rest.size == 0:
        rest = np.array([_first_finite(position, 0.0)])
    return bool(abs(float(np.median(rest))) <= VENTED_POSITION and float(np.ptp(rest)) <= _REST_RANGE)


def _first_finite(values: FloatArray, otherwise: float) -> float:
    finite = values[np.isfinite(values)]
    return float(finite[0]) if finite.size else otherwise
