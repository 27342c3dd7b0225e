"""Parameter files (TOML): written by `--save`, read by `--start` and `simulate --parameters`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.estimation.actuator_section import equipment_in, section_of, with_gravity
from clutchid.estimation.calibration_section import calibration_in, calibration_section, text_entries
from clutchid.estimation.load_section import load_in
from clutchid.estimation.model_section import duty_entries, duty_period_in, model_entries, model_in
from clutchid.estimation.older_lags import with_lags
from clutchid.estimation.recording_sections import REST, Starts, own_values, starts_in
from clutchid.estimation.request import FitRequest
from clutchid.estimation.result import Fit
from clutchid.estimation.search_section import search_in, search_section
from clutchid.estimation.search_state import Continuation
from clutchid.io.files import small_file, write_text
from clutchid.io.toml_file import LARGEST, toml_of
from clutchid.log import Log
from clutchid.model.actuator import Actuator
from clutchid.model.own import OwnModel
from clutchid.model.weighted_load import Load
from clutchid.names import unknown_names
from clutchid.parameters import Parameters, is_number
from clutchid.strokes.vented_rest import Rested, from_rest
from clutchid.uncertainty.calibration import Calibration, Origin

#: Suffixes of files for MATLAB, which `clutchid.report.matlab` writes and nothing reads.
MATLAB_SUFFIXES = (".mat", ".m")

_SECTIONS = ("actuator", "model", "parameters", "recording", "fit")
_LIBRARIES = ("clutchid", "numpy", "scipy", "numba")


@dataclass(frozen=True, slots=True)
class ParameterFile:
    """An actuator, the start values of segments by recording, and how it was fitted.

    A start is (position in m, pressure in chamber A in Pa). `own` are parameters of single recordings by stem, `origin`
    is the file itself.
    """

    actuator: Actuator
    starts: Mapping[str, Starts] = field(default_factory=dict)
    fit: Mapping[str, Any] = field(default_factory=dict)
    own: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    origin: Origin = field(default_factory=Origin, compare=False)

    @property
    def calibration(self) -> Calibration | None:
        """The calibration in the file, if there is one.

        Raises
        ------
        ParameterError
            If the entry cannot be understood.
        """
        entry = self.fit.get("calibration")
        if entry is None:
            return None
        weights, method = self.actuator.load.names, str(self.fit.get("method", "shooting"))
        try:
            _check_valves(self.actuator)
            return calibration_in(entry, weights, method, self.origin)
        except ParameterError as error:
            raise ParameterError(f"{self.origin.name or 'parameter file'}: {error}") from error

    @property
    def continuation(self) -> Continuation | None:
        """The search whose result is in the file, if it was one with priors.

        Raises
        ------
        ParameterError
            If the entry cannot be understood.
        """
        entry, data, scales = self.fit.get("search"), self.fit.get("data"), self.fit.get("noise_scales")
        if entry is None or not isinstance(data, Mapping) or not isinstance(scales, Mapping):
            return None
        state = search_in(entry)
        single = {f"{name}@{stem}": value for stem, values in self.own.items() for name, value in values.items()}
        values = {name: self.actuator.value(name) for name in state.priors if name in self.actuator.names} | single
        numbers = {name: float(value) for name, value in scales.items() if is_number(value)}
        return Continuation(state, values, numbers, data)

    def starts_for(self, log: Log) -> Starts | None:
        """The start values of `log`, if they were estimated from exactly this file, by its hash under [fit] data."""
        return (self.starts.get(log.name) or None) if self._has(log) else None

    def from_rest(self, log: Log) -> Rested:
        """A recording with its position as travel from the vented rest of the calibration in the file.

        What the fit in the file subtracted from exactly this recording is subtracted again.
        """
        if self._has(log):
            subtracted = self.own.get(log.name, {}).get(REST, 0.0)
            return Rested(
                log.with_columns(position=log["position"] - subtracted) if subtracted else log, None, subtracted
            )
        return from_rest(log, self.calibration.rest if self.calibration else None)

    def _has(self, log: Log) -> bool:
        """Whether exactly this recording was fitted, by its hash under [fit] data."""
        data = self.fit.get("data")
        known = data.get(log.name) if isinstance(data, Mapping) else None
        return isinstance(known, str) and known == log.metadata.get("sha256")


def _check_valves(actuator: Actuator) -> None:
    """Refuse a calibrated valve that passes no air: its actuator cannot have moved."""
    for valve in {"C_vs", "C_ve"} & {*actuator.names}:
        if actuator.value(valve) == 0.0:
            raise ParameterError(
                f"[parameters] {valve} = 0 m³/(Pa·s): a calibrated valve passes air, a conductance above 0 is needed; "
                "save the calibration again."
            )


def started(content: ParameterFile, request: FitRequest) -> FitRequest:
    """The request with calibration and search of its start file, if it supports them.

    Raises
    ------
    ParameterError
        If the calibration or the search in the file cannot be understood.
    """
    calibration = None if request.automatic else content.calibration
    request = replace(request, rest=calibration.rest if calibration else None)
    if request.partition is not None or request.method == "simulation":
        return request
    return replace(request, calibration=calibration, continues=content.continuation)


def parameter_file(fitted: Fit, trust: str) -> ParameterFile:
    """Contents of a parameter file for a fit with a `trust`, see `clutchid.assess.verdict`."""
    covariance = np.where(np.isfinite(fitted.covariance), fitted.covariance, np.inf)
    about = {
        "status": fitted.status,
        "free": list(fitted.parameters),
        "measure": list(fitted.scales),
        "std": {name: estimate.std for name, estimate in fitted.parameters.items()},
        "bounds": {name: list(limits) for name, limits in fitted.bounds.items()},
        "covariance": covariance.tolist(),
        "noise_scales": dict(fitted.scales),
        "data": {name: _hash(recording.measured.metadata) for name, recording in fitted.recordings.items()},
        "versions": {library: version(library) for library in _LIBRARIES},
    }
    about["method"] = fitted.method
    about["created"] = datetime.now(UTC).isoformat(timespec="seconds")
    about["trust"] = trust
    if fitted.search is not None:
        about["search"] = search_section(fitted.search)
    if fitted.calibration is not None:
        about["calibration"] = calibration_section(fitted.calibration, fitted.baseline)
    starts = {name: recording.starts for name, recording in fitted.recordings.items()}
    own: dict[str, dict[str, float]] = {}
    for name, estimate in fitted.parameters.items():
        base, at, stem = name.partition("@")
        if at:
            own.setdefault(stem, {})[base] = estimate.value
    for name, recording in fitted.recordings.items():
        if recording.subtracted:
            own.setdefault(name, {})[REST] = recording.subtracted
    return ParameterFile(fitted.actuator, starts, about, own)


def _hash(metadata: Mapping[str, str]) -> str:
    return metadata.get("sha256", "unknown")


def write_parameters(content: ParameterFile, path: str | PathLike[str]) -> None:
    """Write a parameter file; an existing one is replaced only by a complete new one.

    Raises
    ------
    ExportError
        If the file cannot be written.
    """
    import tomli_w

    actuator = content.actuator
    load = actuator.load
    written = [name for name in actuator.names if not actuator.equipment.missing(name)]
    document: dict[str, Any] = {
        **section_of(actuator.equipment),
        "model": {
            **model_entries(actuator.model),
            **duty_entries(actuator.duty_period),
            "load_basis": load.basis,
            "knots": list(load.knots),
            **({"phi2_slope": load.phi2_slope} if load.basis == "paper" else {}),
        },
        "parameters": {name: actuator.value(name) for name in written},
    }
    if content.starts:
        document["recording"] = {
            stem: {
                "position_start": [y for y, _ in starts],
                "pressure_a_start": [p for _, p in starts],
                **content.own.get(stem, {}),
            }
            for stem, starts in content.starts.items()
        }
    if content.fit:
        document["fit"] = dict(content.fit)
    name = actuator.equipment.name or "an electropneumatic clutch actuator"
    text = f"# Parameters of {name}, SI units; written by clutchid.\n" + tomli_w.dumps(document)
    write_text(text, path)


def read_parameters(path: str | PathLike[str], model: OwnModel | None = None) -> ParameterFile:
    """Read a parameter file; missing entries have their defaults.

    B-splines have all weights or none. Without any, the load is the one that a search starts from, on B-splines; an
    actuator of another drawing needs them. A negative lag of a sensor, from an earlier version, is read as 0 with a
    UserWarning.

    Parameters
    ----------
    path
        The file.
    model
        The model of the user's own that the file was saved with: a file never loads code.

    Raises
    ------
    DataError
        If there is no readable plain file.
    ParameterError
        If it is for MATLAB, no TOML, was saved with another `model`, or any entry is unknown or inadmissible; the text
        lists all problems.
    """
    if Path(path).suffix.lower() in MATLAB_SUFFIXES:
        raise ParameterError(
            f"{path}: is for MATLAB, and clutchid does not read it back; save the fit as .toml too (fit LOG --save "
            "FIT.toml), and name that file."
        )
    content = small_file(path, "parameter file", LARGEST)
    document = toml_of(content, path, "parameter file")
    problems = unknown_names(document, _SECTIONS, "section")
    problems += [
        f"[{name}] must be a section with entries."
        for name in _SECTIONS
        if not isinstance(document.get(name, {}), dict)
    ]
    if problems:
        raise ParameterError(_all(path, problems))
    document = with_lags(document, path)
    known, model_problems = model_in(document.get("model", {}), model)
    if model_problems and (model is not None or "own" in document["model"]):
        raise ParameterError(_all(path, model_problems))  # what else the file has, only the right model can say
    equipment, problems = equipment_in(document)
    problems += model_problems
    section, values, gravity_problems = with_gravity(document)
    load, load_problems = load_in(section, values, defaults="actuator" not in document)
    own, own_problems = _own(values, model)
    parameters, parameter_problems = _parameters(values | equipment.fixed, load, tuple(own))
    starts, start_problems = starts_in(document.get("recording", {}), (*Parameters.names(), *own))
    duty_period, duty_problems = duty_period_in(section)
    problems += gravity_problems + own_problems + load_problems + parameter_problems + start_problems + duty_problems
    if problems or load is None or parameters is None:
        raise ParameterError(_all(path, problems))
    try:
        actuator = Actuator(parameters, load, known, equipment, tuple(own.values()), duty_period)
    except ParameterError as error:
        raise ParameterError(_all(path, [str(error)])) from error
    section = document.get("fit", {})
    hashed = sha256(content).hexdigest()
    origin = Origin(name=Path(path).name, sha256=hashed)._replace(**text_entries(section, ("created", "trust")))
    return ParameterFile(actuator, starts, section, own_values(document.get("recording", {})), origin)


def _all(path: str | PathLike[str], problems: list[str]) -> str:
    lines = [line for problem in problems for line in problem.splitlines()]
    return f"{path}: {lines[0]}" if len(lines) == 1 else f"{path}: {len(lines)} problems.\n  - " + "\n  - ".join(lines)


def _own(values: dict[str, Any], model: OwnModel | None) -> tuple[dict[str, float], list[str]]:
    """Values of the parameters of a model of the user's own, and problems with them."""
    rows = {} if model is None else model.parameters
    own = {name: values.get(name, row.default) for name, row in rows.items()}
    wrong = [name for name, value in own.items() if not is_number(value)]
    problems = [f"{name} = {own[name]!r}: a number in {rows[name].unit} is needed." for name in wrong]
    return {name: rows[name].default if name in wrong else value for name, value in own.items()}, problems


def _parameters(values: dict[str, Any], load: Load | None, own: tuple[str, ...]) -> tuple[Parameters | None, list[str]]:
    known = (*Parameters.names(), *own, *(load or Load()).names)
    # if the load itself is wrong, the number of its weights is unknown
    weights_unknown = load is None
    problems = unknown_names(
        [name for name in values if not (weights_unknown and re.fullmatch(r"theta_[1-9]\d*", name))], known
    )
    try:
        parameters = Parameters().replace({name: v for name, v in values.items() if name in Parameters.names()})
    except ParameterError as error:
        return None, problems + str(error).splitlines()
    return parameters, problems
