"""`simulate_many`: thousands of simulations, on all processors, each with the numbers of `simulate`."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from os import PathLike
from typing import Literal, TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

from clutchid.arguments import checked
from clutchid.codegen.kernels import vector_lanes
from clutchid.errors import DataError, ParameterError
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import Model, lanes, state_rows
from clutchid.numerics.threads import map_pairs
from clutchid.parameters import known_ambient
from clutchid.simulation.partition import Partition
from clutchid.simulation.plan import Segment
from clutchid.simulation.run import KernelArrays, run_side_by_side, start_states
from clutchid.simulation.simulation import PreparedLog, Simulation, prepared_log, read_log, simulation_of, states_of
from clutchid.simulation.stiffness import steepest_slopes, stiffness_by_slope, top_speed

#: Simulations that a thread is given at once, and into how many parts a few are divided.
_TOGETHER, _PARTS = 128, 8

#: Samples of all simulations from which on they are worth kernels that run several side by side.
_MANY_SAMPLES = 1_000_000

#: A recording: read, or the path of its file.
_Recording: TypeAlias = Log | str | PathLike[str]


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """States of a simulation at the samples of its recording, and why it diverged, if it did."""

    prepared: PreparedLog
    actuator: Actuator
    states: FloatArray
    message: str


@dataclass(frozen=True, slots=True, eq=False)
class Simulations(Sequence[Simulation]):
    """Simulations in the order of their actuators and recordings, a sequence of `Simulation`.

    Each is made of its states when it is asked for.

    Examples
    --------
    >>> t = np.arange(0, 0.1, 1e-3)
    >>> log = Log(t, {"duty_supply": np.ones(100), "duty_exhaust": np.zeros(100)})
    >>> simulations = simulate_many([Actuator(), Actuator().replace(P_S=5e5)], log)
    >>> simulations
    Simulations(2, 0 of them failed)
    >>> first, second = (simulation.log["position"][-1] for simulation in simulations)
    >>> bool(second < first)
    True
    """

    _runs: tuple[_Run, ...]

    def __len__(self) -> int:
        return len(self._runs)

    @overload
    def __getitem__(self, index: int) -> Simulation: ...

    @overload
    def __getitem__(self, index: slice) -> Simulations: ...

    def __getitem__(self, index: int | slice) -> Simulation | Simulations:
        if isinstance(index, slice):
            return Simulations(self._runs[index])
        result = self._runs[index]
        return simulation_of(result.prepared, result.actuator, result.states, result.message)

    def __iter__(self) -> Iterator[Simulation]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"Simulations({len(self):,}, {len(self.failed):,} of them failed)"

    @property
    def failed(self) -> tuple[int, ...]:
        """Numbers of the simulations that diverged."""
        return tuple(i for i, run in enumerate(self._runs) if run.message)

    def column(self, name: str) -> FloatArray:
        """A simulated column of all, shape (simulations, samples), in SI; NaN outside segments and after a divergence.

        Raises
        ------
        DataError
            If there is no such column, or the recordings have different numbers of samples.
        """
        lengths = {len(run.states) for run in self._runs}
        if len(lengths) > 1:
            most = max(lengths)
            raise DataError(f"recordings of {min(lengths)} to {most} samples: take the column of each simulation.")
        values = np.empty((len(self), *lengths))
        for row, simulation in zip(values, self._runs, strict=True):
            row[:] = simulation.states[:, _place(simulation.actuator.model, name)]
        return values


@cache
def _place(model: Model, name: str) -> int:
    columns = [row.column for row in state_rows(model).values()]
    if name not in columns:
        raise DataError(f"no simulated column '{name}'; there are {', '.join(columns)}.")
    return columns.index(name)


@checked
def simulate_many(
    actuators: Actuator | Iterable[Actuator],
    logs: _Recording | Iterable[_Recording],
    *,
    partition: Partition | None = None,
    force: bool = False,
    on_failure: Literal["raise", "return"] = "return",
) -> Simulations:
    """Simulate many actuators, many recordings, or pairs of both, on as many threads as there are processors.

    Parameters
    ----------
    actuators : Actuator, or several
        One for all recordings, or one for each.
    logs : Log or path, or several
        One for all actuators, or one for each; as of `clutchid.simulate`.
    partition : Partition, optional
        Re-initialise the position; without it the simulations are ballistic.
    force : bool
        As of `clutchid.simulate`.
    on_failure : 'raise' or 'return'
        What to do if a simulation diverges; its status also shows it.

    Returns
    -------
    simulations : Simulations
        A sequence of `Simulation`, with the numbers of `clutchid.simulate` to 1e-12 of each column's range: many are
        computed several at a time, in vector registers, by kernels that are compiled when they are first needed;
        ``simulations.column("position")`` has a column of all as one array. The environment variable OMP_NUM_THREADS
        sets the number of threads.

    Raises
    ------
    DataError, ParameterError
        As `clutchid.simulate`; and if there are several actuators and another number of recordings.
    SolveError
        If a simulation diverges and `on_failure` is 'raise'.

    Examples
    --------
    The stroke at full supply for a hundred loads:

    >>> from clutchid import Load
    >>> t = np.arange(0, 0.1, 1e-3)
    >>> log = Log(t, {"duty_supply": np.ones(100), "duty_exhaust": np.zeros(100)})
    >>> loads = [Actuator(load=Load((weight, 0.0, 0.0))) for weight in np.linspace(6e5, 12e5, 100)]
    >>> strokes = simulate_many(loads, log).column("position")[:, -1]
    >>> bool((np.diff(strokes) < 0.0).all())
    True
    """
    several = (actuators,) if isinstance(actuators, Actuator) else tuple(actuators)
    recordings = (logs,) if isinstance(logs, Log | str | PathLike) else tuple(logs)
    count = max(len(several), len(recordings)) if several and recordings else 0
    if len(several) not in (1, count) or len(recordings) not in (1, count):
        raise ParameterError(
            f"simulate_many: {len(several)} actuators and {len(recordings)} recordings; one of either is needed, or as "
            "many of both."
        )
    several = several * count if len(several) == 1 else several
    recordings = recordings * count if len(recordings) == 1 else recordings
    prepared = _prepared(several, recordings, partition, force)
    groups = _groups(several, prepared)
    samples = sum(len(log.values.log) for group in groups for log in group.prepared)
    side_by_side = vector_lanes() if samples >= _MANY_SAMPLES else 0
    for model in {group.actuators[0].model for group in groups} if side_by_side else ():
        lanes(model)  # its text is made once, before the threads ask for it
    options = [(top_speed(partition), side_by_side)] * len(groups)
    runs: list[_Run | None] = [None] * count
    for group, simulated in zip(groups, map_pairs(_simulated, groups, options, smallest=1), strict=True):
        for place, result in zip(group.places, simulated, strict=True):
            runs[place] = result
    simulations = Simulations(tuple(result for result in runs if result is not None))
    if on_failure == "raise" and simulations.failed:
        simulations[simulations.failed[0]].raised()
    return simulations


def _prepared(
    actuators: Sequence[Actuator], recordings: Sequence[_Recording], partition: Partition | None, force: bool
) -> Iterator[PreparedLog]:
    """The recordings, each file read once for each ambient pressure."""
    logs: dict[tuple[str, float | None], Log] = {}
    for actuator, recording in zip(actuators, recordings, strict=True):
        if isinstance(recording, Log):
            log = recording
        else:
            key = str(recording), known_ambient(actuator.parameters.P_0)
            log = logs[key] = logs[key] if key in logs else read_log(recording, actuator)
        yield prepared_log(actuator, log, partition, force=force)


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Simulations by actuators of one model with loads on one basis, of recordings with plans alike."""

    prepared: list[PreparedLog] = field(default_factory=list)
    actuators: list[Actuator] = field(default_factory=list)
    places: list[int] = field(default_factory=list)


def _groups(actuators: Sequence[Actuator], prepared: Iterable[PreparedLog]) -> list[_Group]:
    """All simulations, at most `_TOGETHER` in a group."""
    most = min(_TOGETHER, -(-len(actuators) // _PARTS))
    groups: dict[Hashable, list[_Group]] = {}
    for place, (actuator, log) in enumerate(zip(actuators, prepared, strict=True)):
        load = actuator.load
        key = actuator.model, log.form, load.basis, load.knots, load.phi2_slope
        alike = groups.setdefault(key, [_Group()])
        if len(alike[-1].places) == most:
            alike.append(_Group())
        alike[-1].prepared.append(log)
        alike[-1].actuators.append(log.fitted(actuator))
        alike[-1].places.append(place)
    return [group for alike in groups.values() for group in alike]


def _simulated(group: _Group, options: tuple[float, int]) -> list[_Run]:
    """The simulations of a group, each with the steps for its own stiffness up to a speed, in so many lanes or none."""
    (speed, lanes), load = options, group.actuators[0].load
    parameters = np.array([actuator.array() for actuator in group.actuators])
    loads = load.combined(np.array([actuator.load.theta for actuator in group.actuators]))
    steps: dict[Hashable, tuple[Segment, ...]] = {}
    segments = []
    slopes = steepest_slopes(load.breakpoints, loads).tolist()
    for log, actuator, row, slope in zip(group.prepared, group.actuators, parameters, slopes, strict=True):
        key = log, row.tobytes(), slope
        if key not in steps:
            steps[key] = log.stepped(stiffness_by_slope(actuator, slope, speed))
        segments.append(steps[key])
    starts = [start_states(parts, group.actuators, parameters) for parts in zip(*segments, strict=True)]
    runs = dict[int, _Run]()
    for batches in _batches(segments, lanes) if lanes else ():
        runs |= _side_by_side(group, batches, segments, (parameters, loads), starts)
    for i, (log, actuator) in enumerate(zip(group.prepared, group.actuators, strict=True)):
        if i not in runs:
            arrays = KernelArrays(parameters[i], load.breakpoints, load.coefficients, loads[i], actuator.model)
            x0 = [start[i] for start in starts]
            runs[i] = _Run(log, actuator, *states_of(log, actuator, segments[i], arrays, x0))
    return [runs[i] for i in range(len(segments))]


def _batches(segments: Sequence[tuple[Segment, ...]], lanes: int) -> Iterator[NDArray[np.intp]]:
    """Numbers of simulations with the same steps, shape (batches, lanes); lanes that are left over repeat the last one.

    Those that would fill less than half of a batch are left out.
    """
    alike: dict[Hashable, list[int]] = {}
    for i, parts in enumerate(segments):
        alike.setdefault(tuple(part.substeps.tobytes() for part in parts), []).append(i)
    for numbers in alike.values():
        batches = (len(numbers) + lanes // 2) // lanes
        if batches > 0:
            places = np.minimum(np.arange(batches * lanes), len(numbers) - 1)
            yield np.array(numbers)[places].reshape(batches, lanes)


def _side_by_side(
    group: _Group, batches: NDArray[np.intp], segments: Sequence[tuple[Segment, ...]],
    tables: tuple[FloatArray, FloatArray], starts: Sequence[FloatArray],
) -> dict[int, _Run]:  # fmt: skip
    """The simulations of some batches, without those that diverge."""
    numbers = batches.ravel().tolist()
    actuator, first, (parameters, loads) = group.actuators[0], group.prepared[numbers[0]], tables
    arrays = parameters[numbers], actuator.load.breakpoints, loads[numbers]
    samples, failed = len(first.values.log), np.zeros(batches.shape, dtype=np.bool_)
    states = np.empty((batches.shape[0], len(actuator.states), samples, batches.shape[1]))
    if sum(map(len, segments[numbers[0]])) < samples:
        states[:] = np.nan
    for x0, parts in zip(starts, zip(*(segments[i] for i in numbers), strict=True), strict=True):
        at = first.span.start + parts[0].start
        failed |= run_side_by_side(parts, actuator.model, arrays, x0[numbers], states, at)
    return {
        int(i): _Run(group.prepared[i], group.actuators[i], states[batch, :, :, lane].T, "")
        for (batch, lane), i in np.ndenumerate(batches)
        if not failed[batch, lane]
    }
