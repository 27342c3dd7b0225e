"""`simulate_many`: thousands of simulations, on all processors, each with the numbers of `simulate`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from typing import Literal, TypeAlias, overload

import numpy as np

from clutchid.arguments import checked
from clutchid.errors import DataError, ParameterError
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.threads import map_pairs
from clutchid.parameters import known_ambient
from clutchid.simulation.partition import Partition
from clutchid.simulation.simulation import (
    PreparedLog,
    Simulation,
    prepared_log,
    read_log,
    simulation_of,
    states_of,
    stepped,
)

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
        values = []
        for simulation in self._runs:
            columns = [row.column for row in simulation.actuator.state_rows.values()]
            if name not in columns:
                raise DataError(f"no simulated column '{name}'; there are {', '.join(columns)}.")
            values.append(simulation.states[:, columns.index(name)])
        return np.array(values)


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
        A sequence of `Simulation`, with the numbers of `clutchid.simulate` bit by bit;
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
    simulations = Simulations(tuple(map_pairs(partial(_run, partition), several, prepared)))
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


def _run(partition: Partition | None, actuator: Actuator, prepared: PreparedLog) -> _Run:
    """Simulate a recording that was prepared for an actuator like this one, with the steps for its own stiffness."""
    actuator = prepared.fitted(actuator)
    return _Run(prepared, actuator, *states_of(prepared, actuator, stepped(prepared, actuator, partition)))
