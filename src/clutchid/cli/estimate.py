"""``clutchid estimate``: the load of a worn clutch from position alone, with a calibration."""

from __future__ import annotations

from pathlib import Path

from clutchid.cli.common import guarded
from clutchid.cli.fit import DEFAULTS, FitOptions, fitted
from clutchid.errors import ParameterError


@guarded
def estimate(*logs: Path, options: FitOptions = DEFAULTS) -> int:
    """Estimate the load from position alone, with a calibration, and what has changed since.

    The calibration is made once with pressure: `clutchid calibrate CAL.csv --save CAL.toml`. It is `clutchid fit
    --start CAL.toml --free load`.

    Parameters
    ----------
    logs
        Recordings with position and duty cycles, in any format with a --map. Put them before --verify, --bounds and
        --dbc, which take all arguments that follow.
    """
    if options.start is None:
        raise ParameterError(
            "no --start: a load is estimated from position alone with a calibration, clutchid estimate WORN.csv "
            "--start CAL.toml. It is made once, from a recording with pressure: clutchid calibrate CAL.csv --save "
            "CAL.toml. Without one, clutchid fit WORN.csv assumes the truck of the paper."
        )
    return fitted(options.command("estimate", logs), options)
