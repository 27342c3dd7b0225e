"""Parameter files (TOML): written by `--save`, read by `--start` and `simulate --parameters`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from clutchid.arguments import checked, is_number
from clutchid.errors import DataError, ParameterError
from clutchid.estimation.parameter_tables import (
    REST,
    Starts,
    actuator_in,
    actuator_tables,
    recording_tables,
    recordings_in,
)
from clutchid.estimation.request import Continuation, FitRequest, SearchState
from clutchid.estimation.result import Fit
from clutchid.files import small_file, write_text
from clutchid.files.records import LARGEST_TOML, Rule, covariance_problem, plain, read_record, table, toml_of
from clutchid.inference.uncertainty.calibration import Calibration, Origin, PositionOnlyErrors
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.model.own import OwnModel
from clutchid.names import unknown_names
from clutchid.parameters import Parameters
from clutchid.strokes.vented_rest import VentedRest, ZeroedLog, from_rest

#: Suffix of a file for MATLAB, which `clutchid.exports.fit_file` writes and nothing reads.
MATLAB_SUFFIX = ".mat"

#: No standard deviation is larger, in SI: ten times the largest admissible value, that of a stiffness.
_LARGEST_STD = 1e12

_SECTIONS = ("actuator", "model", "parameters", "recording", "fit")
_LIBRARIES = ("clutchid", "numpy", "scipy", "numba")

#: Number of `[fit] format`; a file without it has this one.
_FORMAT = 1

#: Fields of a calibration in its section, in this order.
_CALIBRATED = (
    "names", "covariance", "converged", "theta", "theta_covariance", "origin", "conditions", "nis", "rest",
    "vented", "travel", "missed", "position_only",
)  # fmt: skip

#: Values of missing entries of a section, beside the defaults of its record: there may be no level, and a
#: dispersion that is missing is refused.
_LACKING = {"rest": {"returned": math.nan}, "travel": {"stop": math.nan}, "position_only": {"dispersion": math.nan}}


def _possible(errors: PositionOnlyErrors) -> bool:
    """Whether these can be the errors of fits to position alone."""
    names, hypotheses = errors.names, errors.hypotheses
    different = len({*names}) == len(names) and len({*hypotheses}) == len(hypotheses) and hypotheses[:1] == ((),)
    sizes = (errors.shifts.size, errors.log_evidence.size) == (len(hypotheses) * len(names), len(hypotheses))
    finite = np.isfinite(errors.shifts).all() and np.isfinite(errors.log_evidence).all()
    return bool(different and sizes and finite and 0.0 < errors.dispersion < math.inf and not errors.misfit <= 0.0)


_AGAIN = "; save the calibration again"
_COVARIANCE = Rule(f"names and a square covariance are needed{_AGAIN}")
_LOAD = f"finite load weights and their square theta_covariance are needed{_AGAIN}"
_RULES = {
    "names": _COVARIANCE,
    "covariance": _COVARIANCE,
    "theta": Rule(_LOAD, lambda theta: bool(np.isfinite(theta).all())),
    "theta_covariance": Rule(_LOAD),
    "converged": Rule(f"true or false is needed{_AGAIN}"),
    "vented": Rule(f"true or false is needed{_AGAIN}"),
    "nis": Rule(f"a number above 0 is needed{_AGAIN}", lambda nis: 0.0 < nis < math.inf),
    "missed": Rule(f"a number of N, 0 or above, is needed{_AGAIN}", lambda missed: 0.0 <= missed < math.inf),
    "conditions": Rule(
        f"temperature in K, supply and supply_estimated in Pa, above 0, are allowed{_AGAIN}",
        lambda conditions: all(value is None or 0.0 < value < math.inf for value in conditions),
    ),
    "rest": Rule(
        f"finite levels lowest and returned, and quantum, in m, are needed{_AGAIN}",
        lambda rest: math.isfinite(rest.lowest) and math.isfinite(rest.quantum) and not math.isinf(rest.returned),
    ),
    "travel": Rule(
        f"a finite reach, and the far stop where it was reached, in m, are needed{_AGAIN}",
        lambda travel: math.isfinite(travel.reach) and not math.isinf(travel.stop),
    ),
    "position_only": Rule(
        "hypotheses (the first empty), names, finite shifts of each name and log_evidence of each hypothesis, a "
        f"dispersion and a misfit above 0 are needed{_AGAIN}",
        _possible,
    ),
    "search": Rule(
        "status (converged, stalled or limit), evaluations, free, and priors as NAME = [mean, std] are needed; save "
        "the fit again, or take the section out to start a new search",
        lambda state: all(math.isfinite(p.mean) and 0.0 < p.std < math.inf for p in state.priors.values()),
    ),
}


@dataclass(frozen=True, slots=True)
class ParameterFile:
    """An actuator, the start values of segments by recording, and how it was fitted.

    Attributes
    ----------
    actuator
        Model, parameters and load.
    starts : m, Pa
        Position and pressure in chamber A at the start of each segment, by stem of the recording.
    fit
        Section [fit] of the file: free names, bounds, covariance, calibration, versions.
    own : SI
        Parameters of single recordings by stem.
    origin
        The file itself: name, time, checksum, trust.
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
            raise ParameterError(_all(self.origin.name or "parameter file", [str(error)])) from error

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

    @property
    def rest(self) -> VentedRest | None:
        """Vented rest of the calibration in the file; None where it is not known."""
        calibration = self.calibration
        return calibration.rest if calibration else None

    def from_rest(self, log: Log) -> ZeroedLog:
        """A recording with its position as travel from the vented rest of the calibration in the file.

        What the fit in the file subtracted from exactly this recording is subtracted again.
        """
        if self._has(log):
            subtracted = self.own.get(log.name, {}).get(REST, 0.0)
            return ZeroedLog(
                log.with_columns(position=log["position"] - subtracted) if subtracted else log, None, subtracted
            )
        return from_rest(log, self.rest)

    def _has(self, log: Log) -> bool:
        """Whether exactly this recording was fitted, by its hash under [fit] data."""
        data = self.fit.get("data")
        fitted = data.get(log.name) if isinstance(data, Mapping) else None
        return isinstance(fitted, str) and fitted == log.metadata.get("sha256")


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


def contents_of_fit(fitted: Fit, trust: str) -> ParameterFile:
    """Contents of a parameter file for a fit with a `trust`, see `clutchid.estimation.assess.verdict`."""
    about = {
        "format": _FORMAT,
        "status": fitted.status,
        "free": list(fitted.parameters),
        "measure": list(fitted.scales),
        "std": {name: estimate.std for name, estimate in fitted.parameters.items()},
        "bounds": fitted.bounds,
        "covariance": np.where(np.isfinite(fitted.covariance), fitted.covariance, np.inf),
        "noise_scales": fitted.scales,
        "data": {
            name: recording.measured.metadata.get("sha256", "unknown") for name, recording in fitted.recordings.items()
        },
        "versions": {library: version(library) for library in _LIBRARIES},
        "method": fitted.method,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "trust": trust,
    }
    if np.isfinite(fitted.load_curve.force).all():
        reach = max((recording.measured.reach() for recording in fitted.recordings.values()), default=math.nan)
        position, force, low, high = fitted.load_curve.table().T
        about["load"] = {"position": position, "force": force, "low": low, "high": high, "reach": reach}
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
    return ParameterFile(fitted.actuator, starts, plain(about), own)


def search_section(state: SearchState) -> dict[str, Any]:
    """Entries of a search, for `search_in`."""
    return {**table(state), "priors": {name: list(astuple(prior)) for name, prior in state.priors.items()}}


def search_in(section: object) -> SearchState:
    """The search in a file.

    Raises
    ------
    ParameterError
        If an entry cannot be understood.
    """
    return read_record(SearchState, section, "[fit.search]", _RULES)


def calibration_section(calibration: Calibration, baseline: Calibration | None = None) -> dict[str, Any]:
    """Entries of a calibration in the file of a fit that started from `baseline`.

    If it is that one, the new file is not its origin.
    """
    origin = Origin() if calibration.origin is None and calibration is baseline else calibration.origin
    return table(replace(calibration, origin=origin), _CALIBRATED)


def calibration_in(section: object, load_names: Sequence[str], method: str, file: Origin) -> Calibration:
    """The calibration in a `file` by `method`, for a load with the weights `load_names`.

    Raises
    ------
    ParameterError
        If an entry cannot be understood.
    """
    if not isinstance(section, Mapping):
        raise ParameterError(f"[fit.calibration]: {_COVARIANCE.needed}.")
    entries = {name: value for name, value in section.items() if name != "origin"}
    for name in _LACKING.keys() & section.keys():
        if isinstance(section[name], Mapping):
            entries[name] = {**_LACKING[name], **section[name]}
    calibration = read_record(Calibration, entries, "[fit.calibration]", _RULES)
    weights, errors = len(calibration.theta), calibration.position_only
    if weights not in (0, len(load_names)):
        raise ParameterError(f"[fit.calibration] theta: {weights} numbers for {len(load_names)} load weights.")
    if errors is not None:
        shifts = errors.shifts.reshape(len(errors.hypotheses), len(errors.names))
        errors = replace(errors, shifts=shifts, log_evidence=errors.log_evidence.ravel())
    spread = _covariance(calibration.theta_covariance, load_names[:weights], "[fit.calibration] theta_covariance")
    return replace(
        calibration,
        covariance=_covariance(calibration.covariance, calibration.names, "[fit.calibration] covariance"),
        theta_covariance=spread,
        position_only=errors,
        method=method,
        origin=_with_texts(file, section.get("origin")),
    )


def _covariance(matrix: FloatArray, names: Sequence[str], where: str) -> FloatArray:
    """The covariance of `names` at the place `where` in a file."""
    if matrix.size != len(names) ** 2:
        raise ParameterError(f"{where.removesuffix('_covariance')}: {_RULES[where.rpartition(' ')[2]].needed}.")
    matrix = matrix.reshape(len(names), len(names))
    largest = [Parameters.row(name).width if name in Parameters.names() else _LARGEST_STD for name in names]
    if problem := covariance_problem(matrix, names, largest):
        raise ParameterError(f"{where}: {problem}{_AGAIN}.")
    return matrix


def _with_texts(origin: Origin, section: object) -> Origin:
    """`origin` with the texts of a section; an entry that is no text is left out."""
    entries = section if isinstance(section, Mapping) else {}
    return origin._replace(**{k: entries[k] for k in Origin._fields if isinstance(entries.get(k), str)})


@checked
def write_parameters(content: ParameterFile, path: str | PathLike[str]) -> None:
    r"""Write a parameter file; an existing one is replaced only by a complete new one.

    Parameters
    ----------
    content : ParameterFile
        Of a fit, `clutchid.parameter_file` makes it.
    path : path
        Of the file (TOML).

    Raises
    ------
    ExportError
        If the file cannot be written.

    Examples
    --------
    A file has values in SI, here of a supply at 7 bar:

    >>> import clutchid, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_parameters(ParameterFile(clutchid.Actuator().replace(P_S=7e5)), f"{folder}/seven.toml")
    ...     [line for line in Path(folder, "seven.toml").read_text().splitlines() if line.startswith("P_S")]
    ['P_S = 700000.0']
    """
    import tomli_w

    document = actuator_tables(content.actuator)
    if content.starts:
        document["recording"] = recording_tables(content.starts, content.own)
    if content.fit:
        document["fit"] = dict(content.fit)
    name = content.actuator.equipment.name or "an electropneumatic clutch actuator"
    text = f"# Parameters of {name}, SI units; written by clutchid.\n" + tomli_w.dumps(document)
    write_text(text, path)


@checked
def read_parameters(path: str | PathLike[str], model: OwnModel | None = None) -> ParameterFile:
    """Read a parameter file; missing entries have their defaults.

    The file has all weights of the B-splines or none. Without weights the load is the start of a search, on
    B-splines; an actuator of another drawing needs the weights.

    Parameters
    ----------
    path
        The file.
    model
        The user's own model with which the file was saved; a file never loads code.

    Returns
    -------
    content : ParameterFile
        With actuator, start values and, from a fit, its section.

    Raises
    ------
    DataError
        If there is no readable plain file.
    ParameterError
        If it is for MATLAB, no TOML, was saved with another `model`, or any entry is unknown or inadmissible; the text
        lists all problems.

    Examples
    --------
    What was written is read again; a supply at 7 bar instead of 9:

    >>> import clutchid, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_parameters(ParameterFile(clutchid.Actuator().replace(P_S=7e5)), f"{folder}/seven.toml")
    ...     f"{read_parameters(f'{folder}/seven.toml').actuator.value('P_S') / 1e5:.1f} bar"
    '7.0 bar'
    """
    if Path(path).suffix.lower() == MATLAB_SUFFIX:
        raise ParameterError(
            f"{path}: is for MATLAB, and clutchid does not read it back; save the fit as .toml too (fit LOG --save "
            "FIT.toml), and name that file."
        )
    content = small_file(path, "parameter file", LARGEST_TOML)
    document = toml_of(content, path, "parameter file")
    problems = unknown_names(document, _SECTIONS, "section")
    problems += [
        f"[{name}] must be a section with entries."
        for name in _SECTIONS
        if not isinstance(document.get(name, {}), dict)
    ]
    if problems:
        raise ParameterError(_all(path, problems))
    about, recordings = document.get("fit", {}), document.get("recording", {})
    if "format" in about and about["format"] != _FORMAT:
        raise ParameterError(
            f"{path}: [fit] format = {about['format']!r}: this version of clutchid reads format {_FORMAT}; use the "
            "version that saved the file, or save the fit again with this one."
        )
    try:
        actuator = actuator_in(document, model, problems)
        starts, own = recordings_in(recordings, model, problems)
    except ParameterError as error:
        raise ParameterError(_all(path, [str(error)])) from error
    if problems or actuator is None:
        raise ParameterError(_all(path, problems))
    hashed = sha256(content).hexdigest()
    said = {name: about.get(name) for name in ("created", "trust")}
    origin = _with_texts(Origin(name=Path(path).name, sha256=hashed), said)
    return ParameterFile(actuator, starts, about, own, origin)


def _all(path: str | PathLike[str], problems: list[str]) -> str:
    return str(DataError.of(str(path), [line for problem in problems for line in problem.splitlines()]))
