"""Recordings that the model itself made, and problems of prediction error on them."""

from collections.abc import Callable

import numpy as np
import pytest

from clutchid.estimate.shooting.coordinates import coordinates
from clutchid.estimate.shooting.fit import CURVATURE, prepared
from clutchid.estimate.shooting.noise import Noise
from clutchid.estimate.shooting.problem import Shooting
from clutchid.estimate.shooting.windows import tracks
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from clutchid.truck import Truck, drive

MODEL = "energy-balance-stribeck"

#: Noise of the sensors in m and Pa, as the filter assumes it.
NOISE = Noise().measured


@pytest.fixture(scope="session")
def plant() -> Actuator:
    """The actuator that makes the recordings of these tests."""
    return Actuator(Parameters(tau_y=1e-3, tau_p=1.5e-3), Load.on_b_splines(Load((9.0e5, -0.3e5, 0.6e5))), MODEL)


@pytest.fixture(scope="session")
def duties() -> Log:
    """Duty cycles as a gearbox asks for them, 6 s at 1 kHz."""
    return drive(Truck(), seconds=6.0, seed=1).log


@pytest.fixture(scope="session")
def recorded_by(duties: Log) -> Callable[..., Log]:
    """Make a recording of an actuator; seed=None without noise."""

    def make(actuator: Actuator, seconds: float = 6.0, seed: int | None = 3, name: str = "log") -> Log:
        inputs = duties.slice(0, round(seconds * 1000))
        simulated = simulate(actuator, inputs).log
        p = actuator.parameters
        pressure = simulated["pressure_a"]
        # the rate that the filter sees: since the sample before
        rate = np.diff(pressure, prepend=pressure[0]) * 1e3
        columns = {
            "position": simulated["position"] - p.tau_y * simulated["velocity"] + p.e_y,
            "pressure_a": pressure - p.tau_p * rate + p.e_p,
        }
        if seed is not None:
            rng = np.random.default_rng(seed)
            columns = {n: v + NOISE[n] * rng.standard_normal(v.size) for n, v in columns.items()}
        duty = {column: inputs[column] for column in ("duty_supply", "duty_exhaust")}
        return Log(inputs.time, {**duty, **columns}, name)

    return make


@pytest.fixture(scope="session")
def task_of() -> Callable[..., Shooting]:
    """Make a problem: task_of(log, actuator, names, measure)."""

    def make(
        log: Log, actuator: Actuator, names: tuple[str, ...], measure: tuple[str, ...] = ("position", "pressure_a")
    ) -> Shooting:
        return Shooting(
            actuator=actuator,
            coordinates=coordinates(actuator, names, {}, {}),
            tracks=tracks([prepared(log, actuator, measure)]),
            stems=(log.name,),
            measure=measure,
            noise=Noise(),
            curvature=CURVATURE,
            reference=actuator.load.theta,
        )

    return make
