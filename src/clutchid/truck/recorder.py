"""Recorded columns: ambient temperature and supply, late duty cycles, drop-outs, and the bus log with its own clock."""

from __future__ import annotations

import numpy as np

from clutchid.log import INPUTS, FloatArray, Log
from clutchid.truck.vehicle import Vehicle

#: Standard deviations of offset and noise of the sensors of ambient temperature in K and supply pressure in Pa, and
#: what a bus message resolves. Guessed from data sheets; the offset is drawn for every recording.
_AMBIENT, _SUPPLY = (1.5, 0.05, 0.1), (3e3, 1e3, 5e2)

#: Period of a message on the bus in s.
BUS = 0.01


def measured_conditions(truck: Vehicle, supply: FloatArray, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Measured ambient temperature in K, and supply pressure in Pa from the true supply pressure."""
    true = {"temperature_ambient": np.full(supply.size, truck.T_0), "pressure_supply": supply}
    columns = {}
    for (name, values), (offset, noise, step) in zip(true.items(), (_AMBIENT, _SUPPLY), strict=True):
        noisy = values + offset * rng.standard_normal() + noise * rng.standard_normal(supply.size)
        columns[name] = step * np.round(noisy / step)
    return columns


def with_late_duties(log: Log, samples: int) -> Log:
    """`log` with duty cycles recorded late by a number of samples; the first ones are held before."""
    if samples == 0:
        return log
    late = {name: np.concatenate([np.full(samples, log[name][0]), log[name]])[: len(log)] for name in INPUTS}
    return log.with_columns(**late)


def with_dropouts(log: Log, count: int, rng: np.random.Generator) -> Log:
    """`log` with `count` drop-outs of 5 to 60 ms, in which measurements are missing (NaN)."""
    gone = np.zeros(len(log), dtype=bool)
    for start in rng.integers(0, len(log), count):
        end = log.time[start] + rng.uniform(0.005, 0.06)
        gone[start : np.searchsorted(log.time, end) + 1] = True
    measured = {name: np.where(gone, np.nan, values) for name, values in log.columns.items() if name not in INPUTS}
    return log.with_columns(**measured)


def bus_log(truck: Vehicle, log: Log, rng: np.random.Generator) -> Log:
    """`log` as recorded on the bus: a message every 10 ms with the controller's last values and another clock.

    The clock has a random phase within the message period, a drift `e_clock`, and jitter.
    """
    sent = np.arange(rng.uniform(0, BUS), log.time[-1], BUS)
    index = np.searchsorted(log.time, sent, side="right") - 1
    stamps = sent * (1 + truck.e_clock) + rng.uniform(0, truck.j_clock, sent.size)
    columns = {name: values[index] for name, values in log.columns.items()}
    return Log(np.maximum.accumulate(stamps) + 1e-9 * np.arange(sent.size), columns, log.name, log.metadata)
