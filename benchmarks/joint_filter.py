"""Cost of a sample of the joint filter: ``python benchmarks/joint_filter.py --seconds 30``.

A recording of a truck is filtered with all load weights and three parameters free, with a correction at every tenth
sample and at every sample. The time of a sample is compared with that of `clutchid.simulate` with the same actuator, in
the same process; all run in turn, and medians over the rounds are printed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import clutchid
from clutchid.inference.filter.joint_filter import JointSettings, follow, init, inputs, joint_filter
from clutchid.inference.uncertainty.coordinates import coordinates
from clutchid.preparation.prepare import CALIBRATED_MARGIN, prepare, tracks_with_steps
from clutchid.simulation.noise import Noise
from clutchid.simulation.windows import with_window_steps
from clutchid.truck import Truck, drive

FREE = ("F_C", "V_0A", "y_max")


def main() -> None:
    """Print the microseconds of a sample, and their ratio to the simulation."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seconds", type=float, default=30.0)
    options.add_argument("--rounds", type=int, default=7)
    chosen = options.parse_args()
    actuator = clutchid.Actuator(model="energy-balance-stribeck", load=clutchid.Load.on_b_splines(clutchid.Load()))
    log = drive(Truck(), seconds=chosen.seconds, seed=1, pressure=False).log
    track = with_window_steps(tracks_with_steps([prepare(log, actuator, ("position",))], CALIBRATED_MARGIN)[0])
    free = coordinates(actuator, (*actuator.load.names, *FREE), {}, {})
    k, count = len(free), len(track.segment)
    bounds = -5.0 * np.ones(k), 5.0 * np.ones(k)

    def filtered(every: int, memory: float) -> Callable[[], object]:
        settings = JointSettings(every=every)
        joint = joint_filter(actuator, free, bounds, ("position",), Noise(memory=memory), settings)
        state, inputs_of_track = init(joint, track.segment, np.zeros(k), 0.3 * np.eye(k)), inputs(joint, track)
        return lambda: follow(joint, state, inputs_of_track, (0, count))

    runs: dict[str, Callable[[], object]] = {
        "simulate": lambda: clutchid.simulate(actuator, log),
        "joint filter, every tenth sample": filtered(10, 0.01),
        "joint filter, every sample": filtered(1, 0.01),
    }
    times: dict[str, list[float]] = {name: [] for name in runs}
    for number in range(1 + chosen.rounds):
        for name, run in runs.items():
            begin = time.perf_counter()
            run()
            if number > 0:
                times[name].append((time.perf_counter() - begin) / count * 1e6)
    print(f"{k} free parameters, {count} samples, {track.segment.substeps.mean():.2f} integration steps a sample")
    for name, seconds in times.items():
        ratio = np.median(np.array(seconds) / np.array(times["simulate"]))
        print(f"{name:<36}{np.median(seconds):8.2f} us a sample{ratio:8.1f} times simulate")


if __name__ == "__main__":
    main()
