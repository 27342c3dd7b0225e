"""Meanings of parameters, and the check of what a fit is asked to free before recordings are read."""

from __future__ import annotations

from pathlib import Path

from clutchid.parameters import Parameters
from clutchid.verbs.options import RequestText


def meanings() -> dict[str, str]:
    """Meanings of the parameters by their names."""
    return {name: row.meaning for name, row in Parameters.rows().items()}


def check_search(verb: str, search: RequestText, start: Path | None) -> None:
    """Check the names and bounds of a fit as far as recordings do not decide on them.

    Raises
    ------
    DataError, ParameterError
        If an option, a name or a bound cannot be used, or the calibration cannot be read.
    """
    from clutchid.estimation.request import bounds_of, free_names
    from clutchid.verbs.start import start_of

    actuator, request = start_of(start, search.request(verb))
    names = free_names([name for name in request.free if name != "auto" and "@" not in name], actuator)
    stated = {name: limits for name, limits in request.bounds.items() if "@" not in name}
    if request.automatic:  # its load has other weights, and the recordings decide on what else is free
        stated = {name: limits for name, limits in stated.items() if name in actuator.parameter_names}
        names = (*names, *stated)
    bounds_of(names, actuator, stated)
