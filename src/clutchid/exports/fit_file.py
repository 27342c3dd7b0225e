"""A fit for MATLAB, Octave and Simulink: a ``.mat`` file with a struct."""

from __future__ import annotations

import re
from dataclasses import asdict
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any
from unicodedata import combining, normalize

import numpy as np

from clutchid.documents.fit_json import change_json, comparison_json, curve_json, origin_json
from clutchid.documents.fit_sections import parameter_meaning
from clutchid.errors import ExportError
from clutchid.estimation.assess.comparison import comparison
from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.parameter_file import MATLAB_SUFFIX
from clutchid.estimation.parameter_tables import model_entries
from clutchid.estimation.result import Fit
from clutchid.files import atomic_write
from clutchid.inference.uncertainty.estimates import Estimate
from clutchid.names import ParameterName

_SUPERSCRIPT = re.compile("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+")
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")

# of MATLAB (`iskeyword`), and those that Octave has besides
_KEYWORDS = frozenset((
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while", "do", "until", "endfor",
    "endfunction", "endif", "endparfor", "endswitch", "endwhile", "unwind_protect",
))  # fmt: skip


def write_matlab(fit: Fit, path: str | PathLike[str]) -> None:
    """Write the load as a lookup table, and the parameters, as the struct `clutchid` of a MATLAB 5 file.

    Parameters
    ----------
    fit
        Result of `clutchid.fit`.
    path
        With the suffix ``.mat``; docs/formats.md lists the fields. An existing file is replaced only by a complete new
        one.

    Raises
    ------
    ExportError
        If the file cannot be written, its suffix is another one, or a parameter of an own model has a name that MATLAB
        does not allow.
    """
    if Path(path).suffix.lower() != MATLAB_SUFFIX:
        raise ExportError(f"{path}: MATLAB loads a struct from a file with the suffix .mat; name it so.")
    unsuitable = [name for name in fit.actuator.names if not _is_name(name)]
    if unsuitable:
        raise ExportError(
            f"{path}: MATLAB has no variables with the name {unsuitable[0]}; rename the parameter in the model, or "
            "save the fit as .toml."
        )
    content = {key: _in_ascii(value) for key, value in _content(fit).items()}
    from scipy.io import savemat

    with atomic_write(path) as temporary:
        savemat(temporary, {"clutchid": _variable(content)}, appendmat=False, long_field_names=True, oned_as="column")


def _is_name(text: str) -> bool:
    return _IDENTIFIER.fullmatch(text) is not None and text not in _KEYWORDS


def _content(fit: Fit) -> dict[str, Any]:
    """Nested dictionaries of numbers in SI, texts and vectors, by name of the field."""
    actuator, curve = fit.actuator, fit.load_curve
    load = actuator.load
    names = [name for name in actuator.names if not actuator.equipment.missing(name)]
    return {
        "created_by": f"clutchid {version('clutchid')}",
        "status": fit.status,
        "message": fit.message,
        "warnings": fit.warnings,
        "method": fit.method,
        "load": {
            **_arrays(curve_json(curve)),
            "reach_m": reach(fit),
            "basis": load.basis,
            "knots_m": np.array(load.knots),
            "weights": np.array(load.theta),
            "weights_unit": load.unit,
            **({"phi2_slope": load.phi2_slope} if load.basis == "paper" else {}),
        },
        "trust": verdict(fit).trust,
        "reasons": verdict(fit).reasons,
        "experience": verdict(fit).experience,
        "parameters": {name: _parameter(fit, name, actuator.value(name), fit.parameters.get(name)) for name in names},
        "covariance": {"names": tuple(fit.parameters), "matrix": fit.covariance},
        "changes": [change_json(change) for change in fit.changes],
        **_comparison(fit),
        "model": model_entries(actuator.model),
        "actuator": asdict(actuator.equipment),
        "recordings": [_recording(fit, stem) for stem in fit.recordings],
    }


def _comparison(fit: Fit) -> dict[str, Any]:
    """The calibration that the fit started from, and its load, where there is one; as in the JSON object."""
    if fit.baseline is None:
        return {}
    changes = comparison(fit)
    compared = {} if changes is None else comparison_json(changes)
    return {"calibration": origin_json(fit), **{key: _arrays(value) for key, value in compared.items()}}


def _arrays(value: Any) -> Any:
    """`value` with arrays for lists of numbers, which elsewhere are struct arrays."""
    if isinstance(value, dict):
        return {key: _arrays(entry) for key, entry in value.items()}
    return np.array(value) if isinstance(value, list) else value


def _in_ascii(value: Any) -> Any:
    """`value` with printable ASCII in its texts: Octave cuts the end off others.

    Examples
    --------
    >>> _in_ascii("m³/(Pa·s)")
    'm^3/(Pa*s)'
    """
    if isinstance(value, dict):
        return {key: _in_ascii(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(_in_ascii(entry) for entry in value)
    if not isinstance(value, str):
        return value
    text = _SUPERSCRIPT.sub(r"^\g<0>", value).replace("·", "*").replace("µ", "u")
    plain = "".join(c for c in normalize("NFKD", text).replace("\u2212", "-") if not combining(c))
    return "".join(c if c.isprintable() else " " for c in plain.encode("ascii", "replace").decode())


def _parameter(fit: Fit, name: str, value: float, estimate: Estimate | None) -> dict[str, Any]:
    nan = float("nan")
    std, low, high = (nan, nan, nan) if estimate is None else (estimate.std, estimate.low, estimate.high)
    return {
        "value": value,
        "std": std,
        "low": low,
        "high": high,
        "unit": fit.actuator.unit(ParameterName.parse(name).base),
        "meaning": parameter_meaning(fit, name),
    }


def _recording(fit: Fit, stem: str) -> dict[str, Any]:
    """Name, hash, initial states of the segments, and parameters of its own, of one recording."""
    recording = fit.recordings[stem]
    own = {ParameterName.parse(name): estimate for name, estimate in fit.parameters.items()}
    return {
        "name": stem,
        "sha256": recording.measured.metadata.get("sha256", "unknown"),
        "position_start_m": np.array([position for position, _ in recording.starts]),
        "pressure_a_start_Pa": np.array([pressure for _, pressure in recording.starts]),
        "parameters": {
            name.base: _parameter(fit, str(name), estimate.value, estimate)
            for name, estimate in own.items()
            if name.recording == stem
        },
    }


def _variable(value: Any) -> Any:
    """`value` as SciPy writes it: a list of dictionaries is a struct array, a tuple of texts a cell array."""
    if isinstance(value, dict):
        return {key: _variable(entry) for key, entry in value.items()}
    if isinstance(value, tuple):
        cells = np.empty((len(value), 1), dtype=object)
        cells[:, 0] = value
        return cells
    return _struct_array(value) if isinstance(value, list) else value


def _struct_array(entries: list[dict[str, Any]]) -> np.ndarray[Any, np.dtype[Any]]:
    """Dictionaries with the same keys as SciPy writes a struct array, shape (1, n); no entries have no fields."""
    if not entries:
        return np.empty((0, 0))
    result = np.empty((1, len(entries)), dtype=[(key, object) for key in entries[0]])
    for i, entry in enumerate(entries):
        result[0, i] = tuple(entry.values())
    return result
