"""A fit for MATLAB, Octave and Simulink: a ``.mat`` file, or a ``.m`` function that returns the same struct."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from textwrap import fill
from typing import Any
from unicodedata import combining, normalize

import numpy as np

from clutchid.documents.fit_json import change_json, comparison_json, curve_json, origin_json
from clutchid.documents.fit_sections import parameter_meaning
from clutchid.errors import ExportError
from clutchid.estimation.assess.comparison import comparison
from clutchid.estimation.assess.evidence import reach
from clutchid.estimation.assess.verdict import verdict
from clutchid.estimation.parameter_file import MATLAB_SUFFIXES
from clutchid.estimation.parameter_tables import model_entries
from clutchid.estimation.result import Fit
from clutchid.files import atomic_write, write_text
from clutchid.inference.uncertainty.estimates import Estimate
from clutchid.names import ParameterName

_VARIABLE = "clutchid"
_SUPERSCRIPT = re.compile("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+")
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,62}")

# of MATLAB (`iskeyword`), and those that Octave has besides
_KEYWORDS = frozenset((
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while", "do", "until", "endfor",
    "endfunction", "endif", "endparfor", "endswitch", "endwhile", "unwind_protect",
))  # fmt: skip

# what a function file itself uses
_USED = frozenset((_VARIABLE, "load_force", "struct", "interp1", "reshape", "cell", "true", "false", "Inf", "NaN"))

_SECTIONS = {
    "trust": "Whether the result can be trusted (good, with care, none), and why not",
    "covariance": "Covariance of the free parameters in SI, in the order of the names",
    "changes": "What has changed since the calibration: value before, value after with its standard error, probability",
    "calibration": "The calibration that the fit started from, its load, and the load above less that one",
    "load": "Load on the piston over its position with a pointwise 95 % interval, reach of the position, and the basis",
    "parameters": "Value in SI, standard error and 95 % interval (NaN: fixed, or fitted by recording), unit, meaning",
    "model": "Variant of the model",
    "actuator": "Chambers and valves",
    "recordings": "Fitted recordings: SHA-256 of the file, initial states of its segments, parameters of its own",
}


def check_name(path: str | PathLike[str]) -> None:
    """Check, before a long computation, that `path` is a name that MATLAB can use.

    Raises
    ------
    ExportError
        If the suffix is neither ``.mat`` nor ``.m``, or a ``.m`` file has a name that no function can have.

    Examples
    --------
    >>> check_name("fit-1.m")
    Traceback (most recent call last):
    clutchid.errors.ExportError: fit-1.m: MATLAB has no function files with such a name; name it fit_1.m.
    """
    file = Path(path)
    if file.suffix.lower() not in MATLAB_SUFFIXES:
        raise ExportError(f"{path}: the suffix '{file.suffix}' is not one of MATLAB; name the file .mat or .m.")
    if file.suffix.lower() == ".m" and not (file.suffix == ".m" and _is_function_name(file.stem)):
        valid = re.sub(r"\W", "_", file.stem, flags=re.ASCII)
        other = valid if _is_function_name(valid) else f"fit_{valid}"[:63]
        raise ExportError(f"{path}: MATLAB has no function files with such a name; name it {other}.m.")


def function_name(*words: str) -> str:
    """Name of a function of MATLAB made of words; a single word could hide a function of its own.

    Examples
    --------
    >>> function_name("estimate", "run 1.mf4", "load"), function_name("", "7.csv")
    ('estimate_run_1_mf4_load', 'clutch_7_csv')
    """
    parts = (re.sub(r"\W+", "_", word, flags=re.ASCII).strip("_") for word in words)
    name = "_".join(filter(None, parts))[:63]
    return (name if _is_function_name(name) and "_" in name else f"clutch_{name}")[:63]


def function_in(path: str | PathLike[str]) -> str:
    """Name of the function in a ``.m`` file of `write_matlab`, which the file must have as well."""
    with Path(path).open(encoding="ascii") as file:
        return file.readline().partition("= ")[2].partition("(")[0]


def write_matlab(fit: Fit, path: str | PathLike[str], function: str = "") -> None:
    """Write the load as a lookup table, and the parameters, for MATLAB, Octave and Simulink.

    Parameters
    ----------
    fit
        Result of `clutchid.fit`.
    path
        ``.mat`` for a MATLAB 5 file with the struct `clutchid`, ``.m`` for a function that returns it; docs/formats.md
        lists its fields. An existing file is replaced only by a complete new one.
    function
        Name of the function, if the file is not called by that of its path but given on under its name.

    Raises
    ------
    ExportError
        If the file cannot be written, its name is unsuitable, or a parameter of an own model has a name that MATLAB
        does not allow.
    """
    check_name(path)
    unsuitable = [name for name in fit.actuator.names if not _is_name(name)]
    if unsuitable:
        raise ExportError(
            f"{path}: MATLAB has no variables with the name {unsuitable[0]}; rename the parameter in the model, or "
            "save the fit as .toml."
        )
    content = {key: _in_ascii(value) for key, value in _content(fit).items()}
    if Path(path).suffix == ".m":
        write_text(_function(content, function or Path(path).stem), path)
        return
    from scipy.io import savemat

    with atomic_write(path) as temporary:
        variables = {_VARIABLE: _variable(content)}
        savemat(temporary, variables, appendmat=False, long_field_names=True, oned_as="column")


def _is_name(text: str) -> bool:
    return _IDENTIFIER.fullmatch(text) is not None and text not in _KEYWORDS


def _is_function_name(text: str) -> bool:
    return _is_name(text) and text not in _USED


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
    """`value` with printable ASCII in its texts: Octave cuts others off in ``.mat``, old MATLAB garbles them in ``.m``.

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


def _function(content: Mapping[str, Any], name: str) -> str:
    """Text of a function file."""
    usage = (
        (f"{_VARIABLE} = {name};", "a struct"),
        (f"[{_VARIABLE}, load_force] = {name};", "and the load over the position as a function"),
        ("load_force(5e-3)", "load in N at 5 mm"),
    )
    lines = [
        f"function [{_VARIABLE}, load_force] = {name}()",
        f"% {name.upper()}  Clutch load and parameters, SI units; written by {content['created_by']}.",
        "%",
        *(f"%   {how:<{len(name) + 30}}% {what}" for how, what in usage),
        "%",
        f"% Simulink, 1-D Lookup Table: breakpoints {_VARIABLE}.load.position_m, table data {_VARIABLE}.load.force_N.",
    ]
    for key, value in content.items():
        lines += ["", f"% {_SECTIONS[key]}"] if key in _SECTIONS else []
        lines += _statements(f"{_VARIABLE}.{key}", value)
    table = f"{_VARIABLE}.load.position_m, {_VARIABLE}.load.force_N"
    lines += ["", "% Linear between the points, and beyond the first and the last one"]
    lines += [f"load_force = @(y) interp1({table}, y, 'linear', 'extrap');", "end", ""]
    return "\n".join(lines)


def _statements(target: str, value: Any) -> Iterator[str]:
    """Assignments of `value` to `target`."""
    if isinstance(value, list):
        yield from () if value else (f"{target} = [];",)
        for i, entry in enumerate(value, 1):
            yield from _statements(f"{target}({i})", entry)
    elif isinstance(value, dict) and any(isinstance(entry, (dict, tuple, np.ndarray)) for entry in value.values()):
        for key, entry in value.items():
            yield from _statements(f"{target}.{key}", entry)
    elif isinstance(value, np.ndarray):
        numbers = "; ".join(_literal(number) for number in value.ravel(order="F").tolist())
        shaped = f"[{numbers}]" if value.ndim == 1 else f"reshape([{numbers}], [{'; '.join(map(str, value.shape))}])"
        yield fill(f"{target} = {shaped};", 118, subsequent_indent="    ", break_on_hyphens=False)
    elif isinstance(value, tuple):
        yield f"{target} = {{{'; '.join(map(_literal, value))}}};" if value else f"{target} = cell(0, 1);"
    else:
        yield f"{target} = {_literal(value)};"


def _literal(value: Any) -> str:
    """A number (with all its bits), truth value, text or struct of these as MATLAB reads it."""
    if isinstance(value, dict):
        return f"struct({', '.join(f'{_literal(key)}, {_literal(entry)}' for key, entry in value.items())})"
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    if isinstance(value, bool):
        return "true" if value else "false"
    return {"inf": "Inf", "-inf": "-Inf", "nan": "NaN"}.get(text := repr(float(value)).removesuffix(".0"), text)
