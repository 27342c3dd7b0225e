"""``clutchid calibrate``: estimate load, valves, friction and sensors of a truck from recordings with pressure."""

from __future__ import annotations

from pathlib import Path

from clutchid.cli.common import guarded
from clutchid.cli.fit import DEFAULTS, FitOptions, fitted


@guarded
def calibrate(*logs: Path, options: FitOptions = DEFAULTS) -> int:
    """Calibrate a truck once, from recordings with pressure: its load, valves, friction and sensors.

    Save the calibration, and estimate the load of the worn clutch from position alone with it: `clutchid estimate
    WORN.csv --start CAL.toml`. It is `clutchid fit --measure position,pressure_a --free auto`.

    Parameters
    ----------
    logs
        Recordings with position, duty cycles and `pressure_a`, all of one state of wear. Put them before --verify,
        --bounds and --dbc, which take all arguments that follow.
    """
    return fitted(options.command("calibrate", logs), options)
