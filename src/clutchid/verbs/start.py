"""Start of a verb: an actuator, a parameter file, a calibration."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.errors import ClutchidError, ParameterError
from clutchid.estimation.parameter_file import ParameterFile, read_parameters, started
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Fit
from clutchid.model.actuator import Actuator
from clutchid.model.own import OwnModel

if TYPE_CHECKING:
    from clutchid.inference.uncertainty.calibration import Origin
    from clutchid.inference.uncertainty.estimates import LoadCurve
    from clutchid.model.compiled import Model

#: A calibration: a result, the contents of its file, or the path of that.
CalibrationSource = Fit | ParameterFile | str | PathLike[str]


def content_of(start: CalibrationSource) -> ParameterFile:
    """Parameters and calibration to start from.

    Raises
    ------
    DataError, ParameterError
        If the file cannot be read.
    """
    from clutchid.verbs.saving import parameter_file

    if isinstance(start, ParameterFile):
        return start
    return parameter_file(start) if isinstance(start, Fit) else read_parameters(start)


def start_file(path: Path, model: Model | None = None) -> ParameterFile:
    """The parameter file to start from, which defines the model; a model of the user's own must be the same.

    Raises
    ------
    ParameterError
        If the file cannot be understood, or a different `model` is given.
    """
    content = read_parameters(path, model if isinstance(model, OwnModel) else None)
    if model is not None and model != content.actuator.model:
        raise ParameterError(f"--model {model}: {path} is for the model '{content.actuator.model}'; leave --model out.")
    return content


def start_of(path: Path | None, model: Model | None, request: FitRequest) -> tuple[Actuator | None, FitRequest]:
    """The actuator to start from, and the request with calibration and search of its file, if it supports them.

    Without both it is the actuator that the request needs, None.

    Raises
    ------
    ParameterError
        As `start_file`.
    """
    if path is None:
        return None if model is None else Actuator(model=model), request
    content = start_file(path, model)
    return content.actuator, started(content, request)


def compile_models(calibrations: Iterable[Path]) -> None:
    """Compile the models of calibrations, and the filter, before the workers start; unreadable files are skipped."""
    from clutchid.inference.filter.filtering import compile_filter
    from clutchid.model.compiled import compile_ahead

    models = set()
    for path in calibrations:
        with suppress(ClutchidError):
            models.add(start_file(path).actuator.model)
    compile_ahead(models)
    compile_filter()


def read_calibration(path: Path) -> tuple[Origin, LoadCurve | None]:
    """Origin of the calibration in a parameter file, and its load, None if the file has none.

    Raises
    ------
    DataError, ParameterError
        If it cannot be understood, or has none.
    """
    from clutchid.estimation.result import calibrated_curve
    from clutchid.numerics.interval import QUANTILE

    content = read_parameters(path)
    if content.calibration is None:
        raise ParameterError(
            f"{path}: is a parameter file without a calibration; a calibration is written by "
            "`clutchid calibrate --save CAL.toml`."
        )
    by_data = calibrated_curve(content.actuator, content.calibration)
    return content.origin, by_data and by_data.widened(QUANTILE * content.calibration.missed)


def calibration_file(path: Path) -> ParameterFile:
    """The calibration of an observer, whose file must have a load.

    Raises
    ------
    DataError, ParameterError
        If it cannot be read, or has none.
    """
    from clutchid.files.records import read_toml

    content = start_file(path)
    if not set(read_toml(path, "parameter file").get("parameters", {})) & set(content.actuator.load.names):
        raise ParameterError(
            f"{path}: has no load weights (theta_1, ...) in [parameters], and an observer starts from a load; "
            "calibrate with pressure first: clutchid calibrate LOG --save CAL.toml."
        )
    return content
