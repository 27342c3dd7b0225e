"""The kernels of the filter, compiled before a recording is filtered."""

from __future__ import annotations

from functools import partial

import numpy as np

from clutchid.codegen.beside import compile_beside
from clutchid.codegen.kernels import kernels_in
from clutchid.inference.filter.filtering import KERNELS, filtered
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.model.compiled import prepare, step
from clutchid.simulation.noise import Noise
from clutchid.simulation.parameter_map import parameter_map
from clutchid.simulation.plan import plan
from clutchid.simulation.sensors import lagged
from clutchid.simulation.windows import tracks

#: Samples of the recording that is filtered to compile, in s.
_TIME = np.arange(4) / 1000


#: The model that most calibrations use.
_USUAL = "energy-balance-stribeck"


def compile_filter(model: str = _USUAL) -> None:
    """Filter four samples of a piston at rest, by default with the model that calibrations use.

    The kernel that goes through the samples is one for all models.
    """
    actuator = Actuator(model=model)
    names = "position", "duty_supply", "duty_exhaust"
    log = Log(_TIME, {name: np.zeros(_TIME.size) for name in names})
    (track,) = tracks([plan(log, actuator, 1.0)])
    filtered(track, parameter_map(actuator, ["P_S"], [0], np.ones(1), 1), names[:1], Noise())


def compile_filter_beside() -> None:
    """Let a second process compile the filter on a first start, while this one compiles and calls what comes before.

    While it waits for the filter, it compiles what comes after it.
    """
    from clutchid.codegen.machine_code import is_kept

    if not is_kept(kernels_in(KERNELS).follow):
        few = (partial(call, _USUAL, few=True) for call in (step, prepare))
        compile_beside(compile_filter, _USUAL, (*few, partial(lagged, np.zeros(2), 1.0, 1.0)))
