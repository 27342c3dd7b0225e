"""Recordings that the model itself made, and problems of multiple shooting on them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from clutchid.estimate.least_squares import Failure
from clutchid.estimate.result import Fit
from clutchid.estimate.sensing import lagged
from clutchid.estimate.shooting.calibrate import SHOOTING, Request, fit_by
from clutchid.estimate.shooting.coordinates import Prior, coordinates
from clutchid.estimate.shooting.fit import CURVATURE, prepared
from clutchid.estimate.shooting.links import first_rows, link_costs, link_sigma
from clutchid.estimate.shooting.noise import Noise
from clutchid.estimate.shooting.problem import Shooting, prior_rows
from clutchid.estimate.shooting.rows import window_cost
from clutchid.estimate.shooting.summary import position_only
from clutchid.estimate.shooting.windows import first_guess, tracks
from clutchid.log import FloatArray, Log
from clutchid.model import Actuator, Load
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from clutchid.truck import Truck, drive

MODEL = "energy-balance-stribeck"

#: Noise of the sensors: m and Pa.
POSITION_NOISE, PRESSURE_NOISE = 3e-5, 2e3


@pytest.fixture(scope="session")
def plant() -> Actuator:
    """The actuator that makes the recordings of these tests: every state of the model is at work."""
    load = Load.on_b_splines(Load((9.0e5, -0.3e5, 0.6e5)))
    return Actuator(Parameters(tau_y=1e-3, tau_p=1.5e-3), load, MODEL)


@pytest.fixture(scope="session")
def duties_of() -> Callable[[int], Log]:
    """Duty cycles of a drive as a gearbox asks for them, 8 s at 1 kHz; position and pressure are of another plant.

    They differ a millionth from sample to sample, so that their grid does not tell the carrier of the plant here.
    """

    @cache
    def of(number: int) -> Log:
        log = drive(Truck(), seconds=8.0, seed=number).log
        shares = 1.0 - 1e-6 * np.random.default_rng(8).random((2, len(log)))
        duty = {name: log[name] * by for name, by in zip(("duty_supply", "duty_exhaust"), shares, strict=True)}
        return log.with_columns(**duty)

    return of


@pytest.fixture(scope="session")
def recorded_by(duties_of: Callable[[int], Log]) -> Callable[..., Log]:
    """Make a recording of an actuator: recorded_by(actuator, seconds=4, seed=None, driven=1) without noise."""

    def make(actuator: Actuator, seconds: float = 8.0, seed: int | None = 3, name: str = "log", driven: int = 5) -> Log:
        inputs = duties_of(driven).slice(0, round(seconds * 1000))
        simulated = simulate(actuator, inputs).log
        p = actuator.parameters
        position = lagged(simulated["position"], p.tau_y, 1e-3) + p.e_y
        pressure = lagged(simulated["pressure_a"], p.tau_p, 1e-3) + p.e_p
        if seed is not None:
            generator = np.random.default_rng(seed)
            position = position + POSITION_NOISE * generator.standard_normal(position.size)
            pressure = pressure + PRESSURE_NOISE * generator.standard_normal(pressure.size)
        duty = {column: inputs[column] for column in ("duty_supply", "duty_exhaust")}
        return Log(inputs.time, {**duty, "position": position, "pressure_a": pressure}, name)

    return make


@pytest.fixture(scope="session")
def drive_log(plant: Actuator, recorded_by: Callable[..., Log]) -> Log:
    """8 s of the plant with sensor noise."""
    return recorded_by(plant)


@pytest.fixture(scope="session")
def task_of() -> Callable[..., Shooting]:
    """Make a problem: task_of(logs, actuator, names, measure)."""

    def make(
        logs: Sequence[Log],
        actuator: Actuator,
        names: Sequence[str],
        measure: tuple[str, ...] = ("position", "pressure_a"),
        bounds: dict[str, tuple[float, float]] | None = None,
        priors: dict[str, Prior] | None = None,
    ) -> Shooting:
        return Shooting(
            actuator=actuator,
            coordinates=coordinates(actuator, names, bounds or {}, priors or {}),
            tracks=tracks([prepared(log, actuator, measure) for log in logs]),
            stems=tuple(log.name for log in logs),
            measure=measure,
            noise=Noise(),
            curvature=CURVATURE,
            reference=actuator.load.theta,
        )

    return make


@pytest.fixture(scope="session")
def starts_of() -> Callable[[Shooting], list[FloatArray]]:
    """First guess of the states at the start of every window of a problem."""
    return lambda task: [first_guess(track, task.actuator, "pressure_a" in task.measure) for track in task.tracks]


@pytest.fixture(scope="session")
def calibrated(plant: Actuator, drive_log: Log) -> Fit:
    """A calibration on the recording with pressure, from an actuator whose load and valves are off."""
    start = plant.replace({"C_vs": 21e-9, "F_C": 240.0, "tau_y": 0.0, "tau_p": 0.0})
    start = replace(start, load=Load((7e5, 0.0, 0.0)))
    return fit_by(SHOOTING, [drive_log], start, Request(("position", "pressure_a"), ("auto",)))


@pytest.fixture(scope="session")
def worn(plant: Actuator) -> Actuator:
    """The plant when its load has become 8 % higher."""
    return plant.replace({n: 1.08 * v for n, v in zip(plant.load.names, plant.load.theta, strict=True)})


@pytest.fixture(scope="session")
def worn_log(worn: Actuator, recorded_by: Callable[..., Log]) -> Log:
    """6 s of the worn plant, position only."""
    return position_only(recorded_by(worn, seconds=6.0, seed=5, name="worn", driven=1))


@pytest.fixture(scope="session")
def adapted(calibrated: Fit, worn_log: Log) -> Fit:
    """The load of the worn plant, from its position and the calibration."""
    request = Request(("position",), ("load",), calibration=calibrated.calibration)
    return fit_by(SHOOTING, [worn_log], calibrated.actuator, request)


@pytest.fixture(scope="session")
def cost_at() -> Callable[..., float]:
    """Cost of a problem at a point, simulated window by window without derivatives; infinite where that fails."""

    def cost(task: Shooting, x: FloatArray, X: Sequence[FloatArray]) -> float:
        views = task.views(x)
        if isinstance(views, Failure):
            return float("inf")
        total = float(np.sum(prior_rows(task, x)[:, -1] ** 2))
        for track, starts in zip(task.tracks, X, strict=True):
            seen = views[task.stems[track.log]]
            passed = [
                window_cost(track, window, start, seen, task.measure, task.noise)
                for window, start in zip(track.windows, starts, strict=True)
            ]
            if any(isinstance(one, Failure) for one in passed):
                return float("inf")
            ends, costs = (np.array(column) for column in zip(*passed, strict=True))
            sigma = link_sigma(track, task.actuator, task.noise)
            total += first_rows(track, starts[0], seen, "pressure_a" in task.measure, task.noise)[1]
            total += float(np.sum(costs + link_costs(ends, starts, sigma, task.noise.outlier)))
        return total

    return cost
