"""A `Log`: recorded, simulated or observed signals over time.

Columns are in SI under the names of `COLUMNS`; a missing sample is NaN.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import DataError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

#: Column names of a recording or a simulation and their SI units.
COLUMNS: Mapping[str, str] = MappingProxyType(
    {
        "position": "m",
        "duty_supply": "1",
        "duty_exhaust": "1",
        "pressure_a": "Pa",
        "velocity": "m/s",
        "pressure_b": "Pa",
        "deflection": "m",
        "temperature_a": "K",
        "temperature_b": "K",
        "pressure_supply": "Pa",
        "temperature_ambient": "K",
        "pressure_governor": "Pa",
        "deflection_bearing": "m",
        "spool_supply": "1",
        "spool_exhaust": "1",
        "force": "N",
        "pressure_a low": "Pa",
        "pressure_a high": "Pa",
    }
)

#: A column of another name carries its unit: ``z_1 [m]``, a state of an own model.
_WITH_UNIT = re.compile(r"(\w+) \[([^\[\]]+)\]")

INPUTS = ("duty_supply", "duty_exhaust")

#: An interval above this multiple of the median is a hole; exactly five medians, up to rounding, are not.
HOLE = 5.0 * (1 + 1e-6)


@dataclass(frozen=True, eq=False)
class Log:
    """A recording: time in s, columns in SI by name, and metadata about its origin.

    Arrays are read-only, so a `Log` can be shared between threads and results.

    Raises
    ------
    DataError
        If the columns differ in length, a name is unknown, or time is not finite and strictly increasing.
    """

    time: FloatArray
    columns: Mapping[str, FloatArray]
    name: str = "log"
    metadata: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time = _frozen(self.time)
        columns = {name: _frozen(values) for name, values in self.columns.items()}
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "metadata", MappingProxyType(dict(self.metadata)))
        unknown = [name for name in columns if name not in COLUMNS and not _WITH_UNIT.fullmatch(name)]
        problems = [f"column '{name}' is not known; known columns are {', '.join(COLUMNS)}." for name in unknown]
        problems += [
            f"column '{name}' has {values.size} samples, time has {time.size}."
            for name, values in columns.items()
            if values.shape != time.shape
        ]
        if time.ndim != 1 or not np.all(np.isfinite(time)) or not np.all(time[1:] > time[:-1]):
            problems.append("time must be one column of finite, strictly increasing values.")
        if problems:
            raise DataError.of(self.name, problems)

    def __repr__(self) -> str:
        span = ""
        if len(self) > 1:
            rate = 1.0 / float(np.median(np.diff(self.time)))
            span = f" from {self.time[0]:.6g} to {self.time[-1]:.6g} s, {rate:.4g} Hz"
        count = len(self.warnings)
        warnings = f"; {count} warning{'s' if count > 1 else ''}" if count else ""
        return f"Log({self.name!r}, {len(self):,} samples{span}: {', '.join(self.columns) or 'no columns'}{warnings})"

    def _repr_html_(self) -> str:
        from clutchid.report.notebook import log_html

        return log_html(self)

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

    def plot(self) -> Figure:
        """Position, pressure and duty cycles over time, as a matplotlib figure without pyplot."""
        from clutchid.report.notebook import log_figure

        return log_figure(self)

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
        return replace(self, columns={name: values for name, values in self.columns.items() if name not in names})

    def with_columns(self, **columns: FloatArray) -> Log:
        """The same log with columns added or replaced."""
        return replace(self, columns={**self.columns, **columns})


def name_and_unit(column: str) -> tuple[str, str]:
    """Name and SI unit of a column of a `Log`.

    Examples
    --------
    >>> name_and_unit("velocity"), name_and_unit("z_1 [m]")
    (('velocity', 'm/s'), ('z_1', 'm'))
    """
    match = _WITH_UNIT.fullmatch(column)
    return (match[1], match[2]) if match else (column, COLUMNS[column])


def _frozen(values: FloatArray) -> FloatArray:
    array = np.ascontiguousarray(values, dtype=np.float64).view()
    array.flags.writeable = False
    return array
