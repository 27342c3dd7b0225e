"""A real pneumatic cylinder as another actuator: ``python benchmarks/cylinder.py PATH_TO_SHARED_DATA``.

Reads ``wbident_pneumatic_cylinder/cylinder_1kHz.csv`` (MIT, Jeferson Lima, recorded 2017) and the actuator file
``docs/actuators/cylinder.toml``. Fits the first 4 s, holds out the next 4 s, and prints fit in % by the formula of
MATLAB's `compare`. docs/actuators.md says what the figures mean.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np

from clutchid import Actuator, Fit, FitRequest, Log, Partition, fit, read_parameters, simulate
from clutchid.estimation.assess.diagnostics import fit_percent
from clutchid.estimation.result import Recording
from clutchid.inference.uncertainty.switching_band import switching_band

ACTUATOR = Path(__file__).resolve().parents[1] / "docs" / "actuators" / "cylinder.toml"

#: The measured position as an input, and the position taken again every second.
INPUT = Partition(every=1, carry="q", take="position")
SECONDS = Partition(parts=4, carry="q", take="position")

AIR = ("P_S", "C_vs", "C_ve", "V_0A", "B_vs", "B_ve")
MOTION = ("A_A", "D_v", "F_C")
BOTH = ("position", "pressure_a")

#: Pressures above this, in Pa, are those of a pulse; all others are the vented rest.
PULSE = 1.05e5


def main() -> None:
    """Print the figures."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("data", type=Path, help="folder that holds wbident_pneumatic_cylinder")
    whole = recording(options.parse_args().data / "wbident_pneumatic_cylinder" / "cylinder_1kHz.csv")
    first, later = part(whole, 0.0, "first 4 s"), part(whole, 4.0, "next 4 s, held out")
    air = fitted_air(first)
    print(f"chamber pressure, measured position as input; fitted: {_values(air)}")
    for log in (first, later):
        print(f"  {log.name:<20}{_pressure(log, simulate(air.actuator, log, partition=INPUT).log)}")
    motion = fitted_motion(first, air.actuator, later)
    print(f"position and pressure together, ballistic over 4 s; fitted: {_values(motion)}")
    for run in (*motion.recordings.values(), *motion.verification.values()):
        print(f"  {run.measured.name:<20}{_position(run)}, {_pressure(run.measured, run.simulated)}")
    print("pressure of the next 4 s from its position alone, band from the first 4 s")
    measured, banded = later["pressure_a"], from_position(motion.actuator, later, first)
    inside = (measured >= banded["pressure_a low"]) & (measured <= banded["pressure_a high"])
    half = (banded["pressure_a high"] - banded["pressure_a low"])[measured > PULSE].mean() / 2
    print(f"  {'':<20}{_pressure(later, banded)}; the 95 % band holds {100 * inside.mean():.1f} % of the samples,")
    print(f"  {'':<20}{100 * inside[measured > PULSE].mean():.1f} % of those in a pulse; there +-{half / 1e5:.3f} bar")
    print("The valve's command was not recorded: its times were read off this very pressure, in the held-out part too.")


def recording(path: Path) -> Log:
    """The recording in SI, with the one duty cycle of the 3/2 valve; the sensor's volts are bars above 1 bar."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))

    def column(name: str) -> np.ndarray:
        return np.array([float(row[name]) for row in rows])

    pressure = column("press_sensor_V") * 1e5 + 1e5
    supply = column("valve_on_RECONSTRUCTED")
    return Log(column("t_s"), {"position": column("pos_mm") * 1e-3, "duty_supply": supply, "pressure_a": pressure})


def part(whole: Log, begin: float, name: str, seconds: float = 4.0) -> Log:
    """The samples of `whole` from `begin` s on."""
    start, stop = np.searchsorted(whole.time, [begin - 1e-9, begin + seconds - 1e-9])
    piece = whole.slice(int(start), int(stop))
    return Log(piece.time, dict(piece.columns), name)


def fitted_air(log: Log) -> Fit:
    """The supply, the valve and the dead volume, fitted to the pressure with the measured position as input."""
    start = read_parameters(ACTUATOR).actuator
    bounds = {"V_0A": (2e-5, 6e-5)}
    return fit(log, start, measure=("pressure_a",), free=AIR, bounds=bounds, request=FitRequest(partition=INPUT))


def fitted_motion(log: Log, actuator: Actuator, later: Log) -> Fit:
    """Area and friction, fitted second by second, then over the whole recording; `later` is simulated."""
    near = fit(log, actuator, measure=BOTH, free=MOTION, request=FitRequest(partition=SECONDS))
    return fit(log, near.actuator, measure=BOTH, free=MOTION, verify=[later])


def from_position(actuator: Actuator, log: Log, pressed: Log) -> Log:
    """The pressure of `log` from its position, with a band from `known`, whose pressure was measured."""
    blind = Log(log.time, {name: log[name] for name in ("position", "duty_supply")}, log.name)
    runs = [simulate(actuator, log_of_run, partition=INPUT).log for log_of_run in (blind, pressed)]
    return switching_band(runs[0], [(pressed, runs[1])])


def _values(result: Fit) -> str:
    return ", ".join(f"{name} = {estimate.value:.3g}" for name, estimate in result.parameters.items())


def _position(run: Recording) -> str:
    percent = fit_percent(run.measured["position"], run.simulated["position"])
    return f"position {percent:.1f} %, {run.errors.position_rms * 1e3:.1f} mm rms"


def _pressure(measured: Log, simulated: Log) -> str:
    missed = measured["pressure_a"] - simulated["pressure_a"]
    percent = fit_percent(measured["pressure_a"], simulated["pressure_a"])
    return f"pressure {percent:.1f} %, {np.sqrt(np.mean(missed**2)) / 1e5:.3f} bar rms"


if __name__ == "__main__":
    main()
