"""Parameter files (TOML): what `--save` writes, `--start` and `simulate --parameters` accept."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.errors import ParameterError
from clutchid.estimate.result import Fit
from clutchid.io.files import atomic_write
from clutchid.log import Log
from clutchid.model.actuator import Actuator, Load
from clutchid.parameters import Parameters, unknown_name

_SECTIONS = ("model", "parameters", "recording", "fit")
_MODEL_KEYS = ("variant", "load_basis", "knots", "phi2_slope")
_START_KEYS = ("position_start", "pressure_a_start")
_LIBRARIES = ("clutchid", "numpy", "scipy", "numba")

Starts = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class ParameterFile:
    """An actuator with what a file says besides: starts of the segments of recordings by stem, and how it was fitted.

    A start is (position in m, pressure in chamber A in Pa).
    """

    actuator: Actuator
    starts: Mapping[str, Starts] = field(default_factory=dict)
    fit: Mapping[str, Any] = field(default_factory=dict)

    def starts_for(self, log: Log) -> Starts | None:
        """The starts of `log`, if they were estimated from just this file: the hash under [fit] data says so."""
        data = self.fit.get("data")
        known = data.get(log.name) if isinstance(data, Mapping) else None
        same = isinstance(known, str) and known == log.metadata.get("sha256")
        return (self.starts.get(log.name) or None) if same else None


def parameter_file(fitted: Fit) -> ParameterFile:
    """What is kept of a fit."""
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
    starts = {name: recording.starts for name, recording in fitted.recordings.items()}
    return ParameterFile(fitted.actuator, starts, about)


def _hash(metadata: Mapping[str, str]) -> str:
    return metadata.get("sha256", "unknown")


def write_parameters(content: ParameterFile, path: str | PathLike[str]) -> None:
    """Write a parameter file; an older one is replaced only by a whole new one.

    Raises
    ------
    ExportError
        If the file cannot be written.
    """
    import tomli_w

    actuator = content.actuator
    load = actuator.load
    document: dict[str, Any] = {
        "model": {
            "variant": actuator.model,
            "load_basis": load.basis,
            "knots": list(load.knots),
            "phi2_slope": load.phi2_slope,
        },
        "parameters": {name: actuator.value(name) for name in actuator.names},
    }
    if content.starts:
        document["recording"] = {
            stem: {"position_start": [y for y, _ in starts], "pressure_a_start": [p for _, p in starts]}
            for stem, starts in content.starts.items()
        }
    if content.fit:
        document["fit"] = dict(content.fit)
    text = "# Parameters of an electropneumatic clutch actuator, SI units; written by clutchid.\n" + tomli_w.dumps(
        document
    )
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_parameters(path: str | PathLike[str]) -> ParameterFile:
    """Read a parameter file; what it does not name has the value of Appendix A.

    Raises
    ------
    ParameterError
        If the file cannot be read or any entry is unknown or inadmissible; the text lists all problems.
    """
    try:
        document = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read ({error.strerror}).") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ParameterError(f"{path}: is no TOML file: {error}.") from error
    problems = [unknown_name(name, _SECTIONS, "section") for name in document if name not in _SECTIONS]
    problems += [
        f"[{name}] must be a section with entries."
        for name in _SECTIONS
        if not isinstance(document.get(name, {}), dict)
    ]
    if problems:
        raise ParameterError(_all(path, problems))
    load, load_problems = _load(document.get("model", {}), document.get("parameters", {}))
    parameters, parameter_problems = _parameters(document.get("parameters", {}), load)
    starts, start_problems = _starts(document.get("recording", {}))
    problems = load_problems + parameter_problems + start_problems
    if problems or load is None or parameters is None:
        raise ParameterError(_all(path, problems))
    try:
        actuator = Actuator(parameters, load, document.get("model", {}).get("variant", "isothermal"))
    except ParameterError as error:
        raise ParameterError(_all(path, [str(error)])) from error
    return ParameterFile(actuator, starts, document.get("fit", {}))


def _all(path: str | PathLike[str], problems: list[str]) -> str:
    lines = [line for problem in problems for line in problem.splitlines()]
    return f"{path}: {lines[0]}" if len(lines) == 1 else f"{path}: {len(lines)} problems.\n  - " + "\n  - ".join(lines)


def _load(model: dict[str, Any], values: dict[str, Any]) -> tuple[Load | None, list[str]]:
    problems = [unknown_name(name, _MODEL_KEYS, "entry of [model]") for name in model if name not in _MODEL_KEYS]
    variant, basis = model.get("variant", "isothermal"), model.get("load_basis", "paper")
    if not isinstance(variant, str):
        problems.append(f"[model] variant = {variant!r}: a name in quotes is needed, for example 'isothermal'.")
    if basis != "paper":
        problems.append(unknown_name(str(basis), ("paper",), "load basis"))
    default = Load()
    theta = [values.get(name, value) for name, value in zip(default.names, default.theta, strict=True)]
    knots, slope = model.get("knots", list(default.knots)), model.get("phi2_slope", default.phi2_slope)
    numbers = {"knots": knots, "phi2_slope": [slope], "theta": theta}
    for name, value in numbers.items():
        if not isinstance(value, list) or not all(_is_number(v) for v in value):
            problems.append(f"{name} = {value!r}: numbers are needed.")
    if problems:
        return None, problems
    try:
        return Load(tuple(theta), tuple(knots), float(slope)), []
    except ParameterError as error:
        return None, str(error).splitlines()


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        float(value)  # TOML has no largest integer
    except OverflowError:
        return False
    return True


def _parameters(values: dict[str, Any], load: Load | None) -> tuple[Parameters | None, list[str]]:
    weights = (load or Load()).names
    known = (*Parameters.names(), *weights)
    problems = [unknown_name(name, known) for name in values if name not in known]
    try:
        parameters = Parameters().replace({name: v for name, v in values.items() if name in Parameters.names()})
    except ParameterError as error:
        return None, problems + str(error).splitlines()
    return parameters, problems


def _starts(recordings: dict[str, Any]) -> tuple[dict[str, Starts], list[str]]:
    starts: dict[str, Starts] = {}
    problems = []
    for stem, entry in recordings.items():
        wrong = _start_problems(stem, entry)
        if wrong:
            problems += wrong
        else:
            pairs = zip(*(entry.get(key, []) for key in _START_KEYS), strict=True)
            starts[stem] = tuple((float(position), float(pressure)) for position, pressure in pairs)
    return starts, problems


def _start_problems(stem: str, entry: object) -> list[str]:
    """What is wrong with the starts of one recording."""
    if not isinstance(entry, dict):
        return [f"[recording] {stem} = {entry!r}: a section [recording.'{stem}'] with {_in_words()} is needed."]
    where = f"[recording.'{stem}']"
    problems = [unknown_name(name, _START_KEYS, f"entry of {where}") for name in entry if name not in _START_KEYS]
    lists = {key: entry.get(key, []) for key in _START_KEYS}
    for key, values in lists.items():
        if not isinstance(values, list) or not all(_is_number(v) and math.isfinite(v) for v in values):
            problems.append(f"{where} {key} = {values!r}: a list of finite numbers is needed, one a segment.")
        elif key == "pressure_a_start" and not all(v > 0 for v in values):
            problems.append(f"{where} {key} = {values!r}: pressures are absolute, in Pa, and above 0.")
    if not problems and len({len(values) for values in lists.values()}) > 1:
        counts = " and ".join(str(len(values)) for values in lists.values())
        problems.append(f"{where}: {_in_words()} must be equally many numbers, they are {counts}.")
    return problems


def _in_words() -> str:
    return " and ".join(_START_KEYS)
