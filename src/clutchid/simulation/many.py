"""`simulate_many`: thousands of simulations, on all processors, each with the numbers of `simulate`."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from os import PathLike
from typing import Literal, TypeAlias, overload

import numpy as np

from clutchid.arguments import checked
from clutchid.errors import DataError, ParameterError
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import Model, state_rows
from clutchid.numerics.threads import map_pairs
from clutchid.parameters import known_ambient
from clutchid.simulation.divergence import failure_message
from clutchid.simulation.partition import Partition
from clutchid.simulation.plan import Segment
from clutchid.simulation.run import KernelArrays, run_into, start_states
from clutchid.simulation.simulation import PreparedLog, Simulation, prepared_log, read_log, simulation_of
from clutchid.simulation.stiffness import steepest_slopes, stiffness_by_slope, top_speed

#: Simulations that a thread is given at once.
_TOGETHER = 64

#: A recording: read, or the path of its file.
Recording: TypeAlias = Log | str | PathLike[str]


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
    logs: Recording | Iterable[Recording],
    *,
    partition: Partition | None = None,
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
    on_failure : 'raise' or 'return'
        What to do if a simulation diverges: the status of each says so too.

    Returns
    -------
    simulations : Simulations
        A sequence of `Simulation`, with the numbers of `clutchid.simulate` to 1e-12 of each column's range;
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
    prepared = _prepared(several, recordings, partition)
    groups = _groups(several, prepared)
    speeds = [top_speed(partition)] * len(groups)
    runs: list[_Run | None] = [None] * count
    for group, simulated in zip(groups, map_pairs(_simulated, groups, speeds, smallest=1), strict=True):
        for place, result in zip(group.places, simulated, strict=True):
            runs[place] = result
    simulations = Simulations(tuple(result for result in runs if result is not None))
    if on_failure == "raise" and simulations.failed:
        simulations[simulations.failed[0]].raised()
    return simulations


def _prepared(
    actuators: Sequence[Actuator], recordings: Sequence[Recording], partition: Partition | None
) -> Iterator[PreparedLog]:
    """The recordings, each file read once for each ambient pressure."""
    logs: dict[tuple[str, float | None], Log] = {}
    for actuator, recording in zip(actuators, recordings, strict=True):
        if isinstance(recording, Log):
            log = recording
        else:
            key = str(recording), known_ambient(actuator.parameters.P_0)
            log = logs[key] = logs[key] if key in logs else read_log(recording, actuator)
        yield prepared_log(actuator, log, partition)


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Simulations of one recording by actuators of one model, whose loads are on one basis; places among all."""

    prepared: PreparedLog
    actuators: list[Actuator] = field(default_factory=list)
    places: list[int] = field(default_factory=list)


def _groups(actuators: Sequence[Actuator], prepared: Iterable[PreparedLog]) -> list[_Group]:
    """All simulations, at most `_TOGETHER` in a group."""
    groups: dict[Hashable, list[_Group]] = {}
    for place, (actuator, log) in enumerate(zip(actuators, prepared, strict=True)):
        load = actuator.load
        basis = load.basis, load.knots, load.phi2_slope, load.functions
        alike = groups.setdefault((id(log), basis), [_Group(log)])
        if len(alike[-1].places) == _TOGETHER:
            alike.append(_Group(log))
        alike[-1].actuators.append(log.fitted(actuator))
        alike[-1].places.append(place)
    return [group for alike in groups.values() for group in alike]


def _simulated(group: _Group, speed: float) -> list[_Run]:
    """The simulations of a group, each with the steps for its own stiffness, up to `speed`."""
    prepared, actuators = group.prepared, group.actuators
    first, names = actuators[0], actuators[0].states
    parameters = np.array([actuator.array() for actuator in actuators])
    breakpoints, basis = first.load.breakpoints, first.load.coefficients
    loads = first.load.combined(np.array([actuator.load.theta for actuator in actuators]))
    steps: dict[Hashable, tuple[Segment, ...]] = {}
    segments = []
    for actuator, row, slope in zip(actuators, parameters, steepest_slopes(breakpoints, loads).tolist(), strict=True):
        key = row.tobytes(), slope
        if key not in steps:
            steps[key] = prepared.stepped(stiffness_by_slope(actuator, slope, speed))
        segments.append(steps[key])
    starts = [start_states(segment, actuators, parameters) for segment in segments[0]]
    states = np.empty((len(actuators), len(prepared.values.log), len(names)))
    inside = states[:, prepared.span]
    if sum(map(len, segments[0])) < states.shape[1]:
        states[:] = np.nan
    runs = []
    for i, actuator in enumerate(actuators):
        arrays, message = KernelArrays(parameters[i], breakpoints, basis, loads[i], first.model), ""
        for segment, start in zip(segments[i], starts, strict=True):
            out = inside[i, segment.start : segment.stop]
            failed = run_into(out, segment, arrays, start[i])
            if failed >= 0 and not message:
                message = failure_message(prepared.plan.log, segment, out, failed, names, actuator)
        runs.append(_Run(prepared, actuator, states[i], message))
    return runs
