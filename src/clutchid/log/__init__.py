"""A `Log`: recorded, simulated or observed signals over time.

Columns are in SI under the names of `COLUMNS`; a missing sample is NaN.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError
from clutchid.log.numbers import as_numbers
from clutchid.log.states import STATES
from clutchid.names import made_anew

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]

INPUTS = ("duty_supply", "duty_exhaust")

#: Column names of a recording or a simulation and their SI units: states of the models, duty cycles, and what else is
#: measured or estimated.
COLUMNS: Mapping[str, str] = MappingProxyType(
    {
        **{state.column: state.unit for state in STATES.values()},
        **dict.fromkeys(INPUTS, "1"),
        "temperature_ambient": "K",
        "force": "N",
        "pressure_a low": "Pa",
        "pressure_a high": "Pa",
        "innovation": "m",
        "innovation std": "m",
    }
)

#: A column of another name carries its unit: ``z_1 [m]``, a state of an own model.
_WITH_UNIT = re.compile(r"(\w+) \[([^\[\]]+)\]")

#: An interval above this multiple of the median is a hole; exactly five medians, up to rounding, are not.
HOLE = 5.0 * (1 + 1e-6)


#: Time stamps in s and values of a channel.
Samples = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Log:
    """A recording: time, columns by name, and metadata about its origin.

    Arrays are read-only, and copies of those that can be written to, so a `Log` can be shared between threads and
    results. What a mask hides is missing; quantities with units, complex numbers and text are refused.

    Parameters
    ----------
    time : s, (n,)
        Finite and strictly increasing; dates count from the first of them, which the metadata has as ``start``.
    columns : SI, (n,) each
        By name, such as position [m], pressure_a [Pa, absolute] and duty_supply [1]; NaN is a missing sample.
    name
        Stem of the file, as results name the recording.
    metadata
        Origin as text, such as source, sha256 and ambient_Pa.
    warnings
        Suspicious but usable data, one sentence each.
    edges : s and 1
        Samples of a duty cycle that was recorded with time stamps of its own, (stamps, values); its column holds the
        last one at each of `time`.

    Raises
    ------
    DataError
        If a column holds no real numbers, the columns differ in length, a name is unknown, or time or the stamps of
        edges are not finite and strictly increasing.

    Examples
    --------
    A piston that moves 20 mm in 0.2 s:

    >>> t = np.arange(0.0, 0.2, 1e-3)
    >>> log = Log(t, {"position": 0.1 * t, "duty_supply": np.ones(200), "duty_exhaust": np.zeros(200)}, "ramp")
    >>> log
    Log('ramp', 200 samples from 0 to 0.199 s, 1000 Hz: position, duty_supply, duty_exhaust)
    >>> f"{np.ptp(log['position']) * 1e3:.1f} mm"
    '19.9 mm'
    """

    time: FloatArray
    columns: Mapping[str, FloatArray]
    name: str = "log"
    metadata: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    edges: Mapping[str, Samples] = field(default_factory=dict)

    def __post_init__(self) -> None:
        problems: list[str] = []
        if not isinstance(self.columns, Mapping):
            kind = type(self.columns).__name__
            raise DataError(f"{self.name}: columns are a mapping, not a {kind}; see clutchid.Log.from_frame(frame).")
        time, start = as_numbers(self.time, "time", "s", problems)
        columns = {}
        for name, values in self.columns.items():
            si, place = COLUMNS.get(name, "SI"), f"column '{name}'"
            columns[name], _ = as_numbers(values, place, si, problems, truth=si in ("1", "SI"))
        edges = {}
        for name, (stamps, values) in self.edges.items():
            at, begin = as_numbers(stamps, f"time of the edges of '{name}'", "s", problems, start)
            edges[name] = at, as_numbers(values, f"duty cycle of the edges of '{name}'", "1", problems, truth=True)[0]
            if begin != start:
                problems.append(f"time of the edges of '{name}' and of the columns: both must be dates, or neither.")
        if problems:
            raise DataError.of(self.name, problems)
        metadata = dict(self.metadata) if start is None else {"start": str(start), **self.metadata}
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "edges", MappingProxyType(edges))
        object.__setattr__(self, "metadata", MappingProxyType(metadata))
        unknown = [name for name in columns if name not in COLUMNS and not _WITH_UNIT.fullmatch(name)]
        problems = [f"column '{name}' is not known; known columns are {', '.join(COLUMNS)}." for name in unknown]
        problems += [
            f"column '{name}' has {values.size if values.ndim == 1 else values.shape} samples, time has {time.size}."
            for name, values in columns.items()
            if values.shape != time.shape
        ]
        if time.ndim != 1 or not _finite_and_increasing(time):
            problems.append("time must be one column of finite, strictly increasing values.")
        problems += [sentence for name in edges if (sentence := _wrong_edges(name, edges[name], name in columns))]
        if problems:
            raise DataError.of(self.name, problems)

    @cached_property
    def derived(self) -> dict[object, object]:
        """Cache of what is computed from this log alone and from what a key holds, for as long as the log lives."""
        return {}

    __reduce__ = made_anew  # a view of a mapping cannot be pickled, and copies of arrays could be written to

    def duties(self) -> FloatArray:
        """Both duty cycles side by side, (n, 2)."""
        both = np.empty((len(self), len(INPUTS)))
        for i, name in enumerate(INPUTS):
            both[:, i] = self[name]
        return both

    def __repr__(self) -> str:
        span = ""
        if len(self) > 1:
            rate = 1.0 / sample_interval(self.time)
            span = f" from {self.time[0]:.6g} to {self.time[-1]:.6g} s, {rate:.4g} Hz"
        count = len(self.warnings)
        warnings = f"; {count} warning{'s' if count > 1 else ''}" if count else ""
        return f"Log({self.name!r}, {len(self):,} samples{span}: {', '.join(self.columns) or 'no columns'}{warnings})"

    def __len__(self) -> int:
        return int(self.time.size)

    def __getitem__(self, name: str) -> FloatArray:
        """The column `name`, in SI."""
        try:
            return self.columns[name]
        except KeyError:
            raise DataError(f"{self.name}: no column '{name}'; it has {', '.join(self.columns) or 'none'}.") from None

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    if TYPE_CHECKING:  # attached by `clutchid.verbs.attached`

        def plot(self) -> Figure: ...

        @staticmethod
        def from_frame(
            frame: object, name: str = "frame", *, ambient: float | None = None, channels: Any = None,
            required: Sequence[str] = ("time", "position", *INPUTS),
        ) -> Log: ...  # fmt: skip

    def slice(self, start: int, stop: int) -> Log:
        """Samples `start` to `stop` (exclusive), as a view."""
        columns = {name: values[start:stop] for name, values in self.columns.items()}
        return replace(self, time=self.time[start:stop], columns=columns)

    def reach(self) -> float:
        """Position in m that all but a thousandth of the samples stay within; 0 where none is measured."""
        position = self.columns.get("position", np.zeros(0))
        return float(np.nanpercentile(position, 99.9)) if np.isfinite(position).any() else 0.0

    def without(self, *names: str) -> Log:
        """A copy without the columns `names`."""
        columns = {name: values for name, values in self.columns.items() if name not in names}
        return replace(self, columns=columns, edges=self._edges_without(names))

    def with_columns(self, **columns: FloatArray) -> Log:
        """The same log with columns added or replaced, without the edges of these."""
        return replace(self, columns={**self.columns, **columns}, edges=self._edges_without(columns))

    def _edges_without(self, names: Iterable[str]) -> dict[str, Samples]:
        return {name: samples for name, samples in self.edges.items() if name not in names}


def concatenated(logs: Sequence[Log]) -> Log:
    """Consecutive logs with the same columns as one: with name and metadata of the first, and without edges if several.

    Examples
    --------
    >>> log = Log(np.arange(4.0), {"position": np.zeros(4)})
    >>> len(concatenated([log.slice(0, 1), log.slice(1, 4)]))
    4
    """
    first, *others = logs
    if not others:
        return first
    columns = {name: np.concatenate([log[name] for log in logs]) for name in first.columns}
    return Log(np.concatenate([log.time for log in logs]), columns, first.name, first.metadata)


def _finite_and_increasing(time: FloatArray) -> bool:
    """Whether the stamps (n,) are; its ends alone can be infinite where all increase."""
    ends = time.size == 0 or (math.isfinite(time[0]) and math.isfinite(time[-1]))
    return ends and (time.size < 2 or all_of(time[1:] > time[:-1]))


def read_only(values: FloatArray) -> FloatArray:
    """`values` as an array that kernels can read and nobody can write to; a view, if possible."""
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


def sample_interval(time: FloatArray, otherwise: float = math.nan) -> float:
    """Median interval between samples in s; `otherwise` where there are fewer than two.

    Examples
    --------
    >>> sample_interval(np.array([0.0, 0.01, 0.02, 0.5]))
    0.01
    """
    if time.size < 2:
        return otherwise
    return median(time[1:] - time[:-1])


def median(values: FloatArray) -> float:
    """Median of at least one value; `np.median` takes several times as long for a few.

    Examples
    --------
    >>> median(np.array([3.0, 1.0, 2.0])), median(np.array([4.0, 1.0, 2.0, 3.0]))
    (2.0, 2.5)
    """
    middle = values.size // 2
    if values.size % 2:
        return float(np.partition(values, middle)[middle])
    low, high = np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1].tolist()
    return float(low + high) / 2


def any_of(mask: BoolArray) -> bool:
    """Whether an entry is True; `mask.any()` takes four times as long for a few."""
    return bool(np.count_nonzero(mask))


def all_of(mask: BoolArray) -> bool:
    """Whether all entries are True, as `any_of`."""
    return bool(np.count_nonzero(mask) == mask.size)


def holes(time: FloatArray) -> NDArray[np.bool_]:
    """Whether each interval between samples is a hole, shape (n - 1,).

    Examples
    --------
    >>> holes(np.array([0.0, 0.01, 0.02, 0.5])).tolist()
    [False, False, True]
    """
    intervals = time[1:] - time[:-1]
    if intervals.size and intervals.max() <= HOLE * intervals.min():  # no median is needed
        return np.zeros(intervals.size, dtype=bool)
    return intervals > HOLE * sample_interval(time, 0.0)


def name_and_unit(column: str) -> tuple[str, str]:
    """Name and SI unit of a column of a `Log`.

    Examples
    --------
    >>> name_and_unit("velocity"), name_and_unit("z_1 [m]")
    (('velocity', 'm/s'), ('z_1', 'm'))
    """
    match = _WITH_UNIT.fullmatch(column)
    return (match[1], match[2]) if match else (column, COLUMNS[column])


def _wrong_edges(name: str, samples: Samples, has_column: bool) -> str:
    """Reason to refuse the edges of a column, else nothing."""
    stamps, values = samples
    if not has_column or name not in INPUTS:
        return (
            f"edges of '{name}': only the columns {' and '.join(INPUTS)} can have edges, and the log must have the "
            "column."
        )
    if stamps.ndim != 1 or stamps.shape != values.shape:
        return f"edges of '{name}': {stamps.size} time stamps and {values.size} values; the numbers must be equal."
    wrong = np.flatnonzero(~(stamps[1:] > stamps[:-1]))
    if wrong.size:
        before, after = stamps[wrong[0]], stamps[wrong[0] + 1]
        return f"edges of '{name}' go from {before:.6g} s to {after:.6g} s: their time stamps must increase strictly."
    return "" if np.isfinite(stamps).all() else f"edges of '{name}': a time stamp is not finite."
