"""Do the bands cover what they say on the model's own data? ``python benchmarks/own_data.py --trucks 240``

Every actuator is drawn around Appendix A, with another load, and recorded by the model itself, with white noise of the
sensors. It is calibrated once with pressure. Then it drifts as the prior of a reading says and its load changes, twice,
and both loads are read from position alone. Covered is the share of the points from 0.5 to 20 mm in the 95 % band; its
standard error is that of the means of the trucks, because the points and recordings of one truck err together.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np

from clutchid import FitRequest, fit
from clutchid.inference.uncertainty.change_prior import change_covariance, changeable
from clutchid.log import Log
from clutchid.model import Actuator, Load
from clutchid.numerics.interval import QUANTILE
from clutchid.parameters import Parameters
from clutchid.simulation import simulate
from clutchid.simulation.sensors import lagged
from clutchid.truck import GRID, Truck, drive

MODEL, SECONDS, READINGS = "energy-balance-stribeck", 10.0, 2

#: Shares by which the actuators differ from Appendix A, and the parameters that their calibrations free.
DRAWN = {"P_S": 0.05, "C_vs": 0.1, "C_ve": 0.1, "V_0A": 0.1, "D_v": 0.2, "F_C": 0.2}
FREE = ("load", *DRAWN, "tau_y", "tau_p", "c_F", "h_A")

#: Noise of the sensors in m and Pa, and their lags in s.
POSITION, PRESSURE, LAGS = 3e-5, 2e3, (1e-3, 1.5e-3)


class Covered(NamedTuple):
    """A reading: share of the points covered, rms of the errors over their standard deviations, rms error in %."""

    share: float
    standardised: float
    error: float


def drawn(random: np.random.Generator) -> Actuator:
    """An actuator around Appendix A."""
    parameters = Parameters(tau_y=LAGS[0], tau_p=LAGS[1])
    factors = {name: np.exp(share * random.standard_normal()) for name, share in DRAWN.items()}
    thetas = np.array([9.0e5, -0.3e5, 0.6e5]) * (1.0 + 0.1 * random.standard_normal(3))
    load = Load.on_b_splines(Load((float(thetas[0]), float(thetas[1]), float(thetas[2]))))
    return Actuator(parameters, load, MODEL).replace({n: f * getattr(parameters, n) for n, f in factors.items()})


def used(actuator: Actuator, random: np.random.Generator) -> Actuator:
    """The actuator later: it has drifted, and its load has changed as a clutch wears."""
    names = changeable(actuator)
    drift = random.multivariate_normal(np.zeros(len(names)), change_covariance(actuator, names, ()))
    y = np.linspace(0.0, 1.0, len(actuator.load.theta))
    change = 0.08 * random.standard_normal() + 0.08 * random.standard_normal() * np.sin(np.pi * y)
    moved = {name: actuator.value(name) + float(by) for name, by in zip(names, drift, strict=True)}
    moved["C_A0"] = abs(moved["C_A0"])  # a leak is not below 0
    theta = {
        name: value * float(1.0 + by)
        for name, value, by in zip(actuator.load.names, actuator.load.theta, change, strict=True)
    }
    return actuator.replace({**moved, **theta})


def recorded(actuator: Actuator, random: np.random.Generator, name: str) -> Log:
    """A recording by the model."""
    inputs = drive(Truck(), seconds=SECONDS, seed=int(random.integers(2**31))).log
    inputs = Log(inputs.time, {duty: inputs[duty] for duty in ("duty_supply", "duty_exhaust")}, name)
    states = simulate(actuator, inputs).log
    p = actuator.parameters
    position = lagged(states["position"], p.tau_y, 1e-3) + POSITION * random.standard_normal(len(inputs))
    pressure = lagged(states["pressure_a"], p.tau_p, 1e-3) + PRESSURE * random.standard_normal(len(inputs))
    return inputs.with_columns(position=position, pressure_a=pressure)


def one_truck(number: int) -> list[Covered]:
    """Readings of one actuator."""
    random = np.random.default_rng([number, 19])
    new = drawn(random)
    start = Actuator(Parameters(tau_y=LAGS[0], tau_p=LAGS[1]), Load.on_b_splines(Load((9.0e5, -0.3e5, 0.6e5))), MODEL)
    log = recorded(new, random, "calibration")
    once = fit(log, start, measure=("position", "pressure_a"), free=FREE, method="shooting")
    rows = []
    for k in range(READINGS):
        worn = used(new, random)
        log = recorded(worn, random, f"worn{k}").without("pressure_a")
        curve = fit(log, once.actuator, request=FitRequest(calibration=once.calibration)).load_curve
        force, low, high = (np.interp(GRID, curve.position, side) for side in (curve.force, curve.low, curve.high))
        truth = worn.load.force(GRID)
        off, std = force - truth, (high - low) / (2 * QUANTILE)
        rows.append(
            Covered(
                float(np.mean(np.abs(off) <= QUANTILE * std)),
                float(np.sqrt(np.mean((off / std) ** 2))),
                100 * float(np.sqrt(np.mean(off**2)) / truth.max()),
            )
        )
    return rows


def main() -> None:
    """Print the share that is covered, with its standard error by truck."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--trucks", type=int, default=240)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--workers", type=int, default=1)
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        trucks = list(pool.map(one_truck, range(chosen.seed, chosen.seed + chosen.trucks)))
    shares = np.array([[reading.share for reading in truck] for truck in trucks])
    errors = np.array([[reading.error for reading in truck] for truck in trucks])
    standardised = np.array([[reading.standardised for reading in truck] for truck in trucks])
    spread = shares.mean(axis=1).std(ddof=1) / np.sqrt(len(trucks)) if len(trucks) > 1 else np.nan
    print(
        f"{shares.size} recordings of {len(trucks)} trucks: covered {100 * shares.mean():.1f} % "
        f"(standard error {100 * spread:.1f} %), "
        f"error {np.median(errors):.2f} / {errors.max():.2f} % of the peak, "
        f"{np.sqrt(np.mean(standardised**2)):.2f} standard deviations rms"
    )


if __name__ == "__main__":
    main()
