"""The states along the recordings that a search found, and how far the measurements are from them."""

from __future__ import annotations

import numpy as np

from clutchid.log import FloatArray
from clutchid.simulation.run import Numbers, run
from clutchid.simulation.sensors import seen
from clutchid.smoother.problem import FitProblem
from clutchid.smoother.projection import ShootingSolution

#: A noise scale is re-estimated within these factors of what sensors usually have: a sensor may be better, but what the
#: model leaves out within a window is not.
LEAST, MOST = 1.0, 10.0


def trajectory(task: FitProblem, found: ShootingSolution, log: int) -> FloatArray:
    """States of recording `log` at its samples, shape (n, n_states); NaN between segments."""
    mine = [(track, X) for track, X in zip(task.tracks, found.X, strict=True) if track.log == log]
    n = len(mine[0][0].measured) if mine else 0
    states = np.full((n, len(task.actuator.states)), np.nan)
    numbers = Numbers.of(task.actuator_of(found.x, task.stems[log]))
    for track, X in mine:
        for window, start in zip(track.windows, X, strict=True):
            out, _ = run(window, numbers, start)
            states[window.start : window.stop] = out
    return states


def recorded(task: FitProblem, found: ShootingSolution, log: int, states: FloatArray) -> dict[str, FloatArray]:
    """What the sensors would record along `states`: shifted by their lags and offsets."""
    p = task.actuator_of(found.x, task.stems[log]).parameters
    names = task.actuator.states
    y, p_A = (states[:, names.index(name)] for name in ("y", "p_A"))
    time = next(track.measured.time for track in task.tracks if track.log == log)
    return {"position": seen(y, time, p.tau_y, p.e_y), "pressure_a": seen(p_A, time, p.tau_p, p.e_p)}


def noise_scales(task: FitProblem, found: ShootingSolution) -> dict[str, float]:
    """Noise scale of each measured column: the median residual, as a standard deviation, within bounds."""
    scales = {}
    for name in task.measure:
        residuals = [
            recorded(task, found, log, trajectory(task, found, log))[name] - measured[name]
            for log, measured in {track.log: track.measured for track in task.tracks}.items()
        ]
        size = np.abs(np.concatenate(residuals))
        size = size[np.isfinite(size)]
        usual = task.noise.measured[name]
        found_scale = 1.4826 * float(np.median(size)) if size.size else usual
        scales[name] = float(np.clip(found_scale, LEAST * usual, MOST * usual))
    return scales
