"""Parameters that a fit may free, to choose from, and the check of what was chosen before recordings are read."""

from __future__ import annotations

from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from clutchid.parameters import Parameters
from clutchid.processes import LostWork, results
from clutchid.verbs.options import RequestText

if TYPE_CHECKING:
    from clutchid.estimation.request import FitRequest
    from clutchid.model.actuator import Actuator
    from clutchid.model.compiled import Model


class Choice(NamedTuple):
    """A parameter or load weight that may be free, with its start value and its default bounds in SI.

    `group` is ``'auto'`` or ``'load'`` where that name frees it with others, else empty.
    """

    name: str
    meaning: str
    unit: str
    start: float
    low: float
    high: float
    group: str


def meanings() -> dict[str, str]:
    """Meanings of the parameters by their names."""
    return {name: row.meaning for name, row in Parameters.rows().items()}


def checked_search(verb: str, search: RequestText, start: Path | None) -> tuple[Actuator, FitRequest]:
    """The actuator and the request of a fit; names and bounds are checked as far as recordings do not decide on them.

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
    return actuator, request


@cache
def _acting(model: Model, T_pwm: float) -> frozenset[str]:
    """Parameters with an effect, found in a process of its own: the server of a page stays small without Numba."""
    from clutchid.model.actuator import Actuator

    (work,) = results(attrgetter("acting"), [Actuator(model=model).replace(T_pwm=T_pwm)], 1)
    return frozenset(Parameters.names()) if isinstance(work.result, LostWork) else work.result


def choices(verb: str, free: str, start: Path | None) -> list[Choice]:
    """The parameters that have an effect in the model of a fit, and its load weights unless ``'auto'`` frees a load.

    Raises
    ------
    DataError, ParameterError
        If the calibration cannot be read.
    """
    from clutchid.estimation.request import bounds_of
    from clutchid.verbs.start import start_of

    actuator, request = start_of(start, RequestText(free=free or None).request(verb))
    acting = _acting(actuator.model, actuator.parameters.T_pwm)
    rows = {name: row for name, row in actuator.rows.items() if name in acting and not actuator.equipment.missing(name)}
    weights = () if request.automatic else actuator.load.names
    bounds = bounds_of((*weights, *rows), actuator, {})
    unit = actuator.load.unit
    return [
        *(
            Choice(name, row.meaning, row.unit, actuator.value(name), *bounds[name], "auto" if row.freed else "")
            for name, row in rows.items()
        ),
        *(Choice(name, "weight of the load", unit, actuator.value(name), *bounds[name], "load") for name in weights),
    ]
