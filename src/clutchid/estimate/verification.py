"""Recordings of a fit against what was measured, simulated on a finer time grid or with the sensors undone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchid.estimate.result import Recording, errors_over
from clutchid.log import Log
from clutchid.parameters import Parameters
from clutchid.simulation.sensors import sensed


def on_samples(one: Recording, log: Log) -> Recording:
    """What a fit says of a recording at the samples of `log`, where it was simulated on a finer raster."""
    if len(one.measured) == len(log):
        return one
    at = np.searchsorted(one.simulated.time, log.time)
    columns = {name: values[at] for name, values in one.simulated.columns.items()}
    return replace(one, measured=log, simulated=replace(one.simulated, time=log.time, columns=columns))


def as_sensed(one: Recording, log: Log, p: Parameters) -> Recording:
    """A simulation of the recording `unsensed` against `log`: its errors are those that the sensors would show."""
    shown = on_samples(replace(one, simulated=sensed(one.simulated, p)), log).simulated
    return replace(on_samples(one, log), measured=log, errors=errors_over([(log, shown)]))
