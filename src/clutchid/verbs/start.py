"""Start of a verb: an actuator, a parameter file, a calibration."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.documents.results import SavedLoad
from clutchid.errors import ClutchidError, ParameterError
from clutchid.estimation.automatic import AUTOMATIC
from clutchid.estimation.parameter_file import ParameterFile, read_parameters, started
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Fit
from clutchid.files.records import read_record, read_toml
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.model.own import OwnModel

if TYPE_CHECKING:
    from clutchid.model.compiled import Model

#: A calibration: a result, the contents of its file, or the path of that.
CalibrationSource = Fit | ParameterFile | str | PathLike[str]

#: The same, or an actuator; None is the one that a request needs.
FitStart = CalibrationSource | Actuator | None


def content_of(start: CalibrationSource, model: Model | None = None) -> ParameterFile:
    """Parameters and calibration to start from; a file defines the model, and one of the user's own must be the same.

    Raises
    ------
    DataError, ParameterError
        If the file cannot be read or understood, or a different `model` is given.
    """
    from clutchid.verbs.saving import parameter_file

    if isinstance(start, ParameterFile):
        return start
    if isinstance(start, Fit):
        return parameter_file(start)
    content = read_parameters(start, model if isinstance(model, OwnModel) else None)
    if model is not None and model != content.actuator.model:
        own = content.actuator.model
        raise ParameterError(f"--model {model}: {start} is for the model '{own}'; leave --model out.")
    return content


def start_of(start: FitStart, request: FitRequest, model: Model | None = None) -> tuple[Actuator, FitRequest]:
    """The actuator to start from, and the request with calibration and search of its file, if it supports them.

    Raises
    ------
    DataError, ParameterError
        As `content_of`.
    """
    if start is None:
        start = Actuator(model=model or (AUTOMATIC if request.automatic else "isothermal"))
    if isinstance(start, Actuator):
        return start, request
    content = content_of(start, model)
    return content.actuator, started(content, request)


def compile_models(calibrations: Iterable[Path]) -> None:
    """Compile the models of calibrations, and the filter, before the workers start; unreadable files are skipped."""
    from clutchid.inference.filter.filtering import compile_filter
    from clutchid.model.compiled import compile_ahead

    models = set()
    for path in calibrations:
        with suppress(ClutchidError):
            models.add(content_of(path).actuator.model)
    compile_ahead(models)
    compile_filter()


@dataclass(frozen=True, slots=True)
class _Kept:
    """Section [fit.load] of a parameter file, in SI."""

    position: FloatArray
    force: FloatArray
    low: FloatArray
    high: FloatArray
    reach: float


def saved_load(path: Path) -> SavedLoad:
    """The load in a parameter file: as it was fitted, or that of its calibration.

    Raises
    ------
    DataError, ParameterError
        If the file cannot be understood, or has no load.
    """
    from clutchid.estimation.result import calibrated_curve
    from clutchid.inference.uncertainty.estimates import LoadCurve
    from clutchid.numerics.interval import QUANTILE

    content = read_parameters(path)
    calibration, curve, reach = content.calibration, None, math.nan
    if "load" in content.fit:
        section = read_record(_Kept, content.fit["load"], f"{path}: [fit.load]")
        sides = section.position, section.force, section.low, section.high
        curve, reach = LoadCurve(*sides), section.reach
        if len({side.size for side in sides}) != 1 or section.position.size < 2:
            raise ParameterError(f"{path}: [fit.load]: as many positions as forces are needed; save the fit again.")
    elif calibration and (by_data := calibrated_curve(content.actuator, calibration)):
        curve = by_data.widened(QUANTILE * calibration.missed)
        reach = calibration.travel.reach if calibration.travel else math.nan
    if curve is None:
        raise ParameterError(
            f"{path}: is a parameter file without a fitted load; `clutchid calibrate` and `estimate` write one with "
            "--save."
        )
    return SavedLoad(*content.origin, curve, reach, calibration is not None)


def calibration_file(start: CalibrationSource) -> ParameterFile:
    """The calibration of an observer; a file must have a load.

    Raises
    ------
    DataError, ParameterError
        If it cannot be read, or has none.
    """
    content = content_of(start)
    if isinstance(start, Fit | ParameterFile):
        return content
    if not set(read_toml(Path(start), "parameter file").get("parameters", {})) & set(content.actuator.load.names):
        raise ParameterError(
            f"{start}: has no load weights (theta_1, ...) in [parameters], and an observer starts from a load; "
            "calibrate with pressure first: clutchid calibrate LOG --save CAL.toml."
        )
    return content
