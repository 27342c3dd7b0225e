"""Recordings of the virtual truck, and ways to break them on purpose."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.preparation.inspection import Check, inspect
from clutchid.truck import drive, truck
from fixtures.changed_logs import spoiled


@cache
def driven_truck(number: int, manoeuvre: str = "mix", recorder: str = "controller", dropouts: int = 0) -> Log:
    made = drive(truck(number), manoeuvre=manoeuvre, seconds=20, seed=number, recorder=recorder, dropouts=dropouts)
    return made.log


@pytest.fixture(scope="session")
def recorded() -> Callable[..., Log]:
    """20 s of a virtual truck: recorded(7, "creep", recorder="bus", dropouts=3)."""
    return driven_truck


@pytest.fixture(scope="session")
def check_of() -> Callable[..., Check]:
    """Result of one check: check_of(log, "time shift", actuator)."""

    def look(log: Log, check: str, actuator: Actuator | None = None) -> Check:
        return next(entry for entry in inspect(log, actuator).checks if entry.name == check)

    return look


@pytest.fixture(scope="session")
def shifted() -> Callable[[Log, float], Log]:
    """Move the measurements by so many ms against the duty cycles; later is positive."""

    def shift(log: Log, ms: float) -> Log:
        k, n = round(abs(ms) * 1e-3 / float(np.median(np.diff(log.time)))), len(log)
        late = {name: (name in ("position", "pressure_a")) == (ms > 0) for name in log.columns}
        columns = {name: v[: n - k] if late[name] else v[k:] for name, v in log.columns.items()}
        return Log(log.time[: n - k], columns, log.name)

    return shift


@pytest.fixture(scope="session")
def frozen() -> Callable[[Log, str], Log]:
    """Let a column keep its value for 2 s from 50 ms after a supply pulse."""

    def freeze(log: Log, name: str, supply: float = 0.3) -> Log:
        step = float(np.median(np.diff(log.time)))
        pulse = int(np.flatnonzero((log["duty_supply"] > supply) & (log.time > 8))[0])
        start, length = pulse + round(0.05 / step), round(2 / step)
        return spoiled(log, name, slice(start, start + length), log[name][start])

    return freeze
