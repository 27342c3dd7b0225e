"""TOML files that people write, and records (frozen dataclasses, named tuples) as their tables."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from os import PathLike
from types import MappingProxyType, NoneType, UnionType
from typing import Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from clutchid.arguments import is_number
from clutchid.errors import ParameterError
from clutchid.files import small_file
from clutchid.messages import shortened
from clutchid.names import unknown_name, unknown_names

#: Bytes of a TOML file; the largest that clutchid writes, a calibration with many recordings, has a fifth of it.
LARGEST_TOML = 4_000_000


def read_toml(path: str | PathLike[str], what: str) -> dict[str, Any]:
    """Contents of a TOML file, with or without a byte-order mark; `what` names the kind of file in messages.

    Raises
    ------
    DataError
        If there is no readable plain file, or it is too large for what it should be.
    ParameterError
        If it is no TOML.
    """
    return toml_of(small_file(path, what, LARGEST_TOML), path, what)


def toml_of(content: bytes, path: str | PathLike[str], what: str) -> dict[str, Any]:
    """The `content` of the TOML file at `path`, as `read_toml`.

    Raises
    ------
    ParameterError
        If it is no TOML.
    """
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except RecursionError:
        raise ParameterError(f"{path}: is not a {what}: its lists are nested too deeply.") from None
    except ValueError as error:  # no UTF-8, no TOML, or an integer of thousands of digits
        reason = "a number has too many digits" if "digits" in str(error) else error
        raise ParameterError(f"{path}: is not a TOML file ({reason}).") from None


#: Correlations may differ from those of a covariance by as much: what rounding adds to a matrix of ill condition.
_ROUNDING = 1e-6

#: Types in messages; the others are sections.
_NOUNS: Mapping[Any, str] = {
    float: "number", int: "whole number", str: "text in quotes", bool: "flag, true or false,",
    tuple: "list of the right length", list: "list of texts", np.ndarray: "list of numbers, in rows of equal length,",
}  # fmt: skip

T = TypeVar("T")


class Rule(NamedTuple):
    """Requirement on an entry or a section, in words with what to do next; and a check of a value of its type."""

    needed: str
    valid: Callable[[Any], bool] = lambda _: True


def table(record: Any, names: Iterable[str] = ()) -> dict[str, Any]:
    """The table of a record, with the fields `names` in this order, by default all.

    None and NaN are left out, and what has no elements where it may be left out: `read_record` then takes the default.

    Examples
    --------
    >>> class Levels(NamedTuple):
    ...     quantum: float
    ...     shift: float = float("nan")
    ...     rests: tuple[float, ...] = ()
    >>> table(Levels(1e-5))
    {'quantum': 1e-05}
    >>> read_record(Levels, {"quantum": 1, "rests": [2e-4, 3e-4]}, "[levels]")
    Levels(quantum=1.0, shift=nan, rests=(0.0002, 0.0003))
    """
    entries = _entries(type(record))
    values = {name: plain(getattr(record, name)) for name in names or entries}
    unknown = [name for name, item in values.items() if item is None or (isinstance(item, float) and np.isnan(item))]
    empty = [name for name, item in values.items() if item in ([], {}) and not entries[name][1]]
    return {name: value for name, value in values.items() if name not in (*unknown, *empty)}


def plain(value: Any) -> Any:
    """A value as TOML has it: tables, lists, texts, numbers."""
    if _entries(type(value)):
        return table(value)
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def read_record(kind: type[T], content: object, where: str, rules: Mapping[str, Rule] = MappingProxyType({})) -> T:
    """The record, or value of another type, that `table` or `plain` made of it.

    Parameters
    ----------
    kind
        A record, or float, int, bool, str, a Literal, an array of floats, or lists, tuples or mappings of these. A
        record may also stand as a list of its fields.
    content
        Of a TOML file.
    where
        Its place in the file, ``[section]`` or ``[section] entry``; sections in it are ``[section.name]``.
    rules
        By name of an entry or of a section, for what is wrong with it or in it.

    Raises
    ------
    ParameterError
        If anything is missing, unknown or inadmissible; the text lists all problems, one a line.

    Examples
    --------
    >>> above = {"level": Rule("a share above 0 is needed", lambda share: share > 0.0)}
    >>> class Settings(NamedTuple):
    ...     level: float
    >>> read_record(Settings, {"level": -1, "lvl": 2}, "[fit]", above)
    Traceback (most recent call last):
    clutchid.errors.ParameterError: no entry of [fit] 'lvl'; did you mean 'level'? Known are level.
    [fit] level = -1: a share above 0 is needed.
    """
    name = where.rstrip("]").replace(".", " ").rpartition(" ")[2]
    try:
        value: T = _read(kind, content, where, rules)
    except ParameterError:
        if name not in rules:
            raise
    else:
        if name not in rules or rules[name].valid(value):
            return value
    raise ParameterError(f"{where}{_got(content, where)}: {rules[name].needed}.")


def collected(problems: list[str], make: Callable[..., T], *arguments: Any) -> T | None:
    """The result of `make`; None, with its sentences added to `problems`, if it refuses the arguments."""
    try:
        return make(*arguments)
    except ParameterError as error:
        problems += str(error).splitlines()
        return None


def _entries(kind: Any) -> Mapping[str, tuple[Any, bool]]:
    """Types of the fields of a record, and whether each is required; empty for any other type."""
    return _fields(kind) if is_dataclass(kind) or hasattr(kind, "_field_defaults") else {}


@cache  # to evaluate the annotations takes longer than all the rest
def _fields(kind: Any) -> Mapping[str, tuple[Any, bool]]:
    if is_dataclass(kind):
        required = {item.name: item.default is MISSING and item.default_factory is MISSING for item in fields(kind)}
    else:
        required = {name: name not in kind._field_defaults for name in kind._fields}
    hints = get_type_hints(kind)
    return {name: (hints[name], needed) for name, needed in required.items()}


def _got(content: object, where: str) -> str:
    """The content of an entry for a message; empty for a section or a missing entry."""
    return "" if where.endswith("]") or content is MISSING else f" = {shortened(repr(content))}"


def _read(kind: Any, content: Any, where: str, rules: Mapping[str, Rule]) -> Any:
    if get_origin(kind) in (Union, UnionType):  # X | None: there is no null in TOML
        kind = next(option for option in get_args(kind) if option is not NoneType)
    origin, inner, entries = _origin(kind), get_args(kind), _entries(kind)
    if entries and isinstance(content, list) and len(content) == len(entries):
        content = dict(zip(entries, content, strict=True))
    if isinstance(content, dict) and (entries or origin in (dict, Mapping)):
        wanted = entries or dict.fromkeys(content, (inner[-1], True))
        problems = unknown_names(content, tuple(wanted), f"entry of {where}")
        values = {
            name: collected(problems, read_record, entry, content.get(name, MISSING), _place(where, name, entry), rules)
            for name, (entry, required) in wanted.items()
            if required or name in content
        }
        if problems:
            raise ParameterError("\n".join(problems))
        return kind(**values) if entries else values
    if origin is Literal and content not in list(inner):
        raise ParameterError(
            f"{where}: {unknown_name(str(content), inner, where.rpartition(' ')[2].replace('_', ' '))}"
        )
    value = _value(kind, origin, inner, content, where)
    if value is None:
        raise ParameterError(f"{where}{_got(content, where)}: a {_NOUNS.get(origin or kind, 'section')} is needed.")
    return value


def _origin(kind: Any) -> Any:
    """Origin of a generic type: union, tuple, array; from NumPy 2.5 the array type is a named alias."""
    origin = get_origin(kind)
    return get_origin(origin.__value__) if hasattr(origin, "__value__") else origin


def _value(kind: Any, origin: Any, inner: tuple[Any, ...], content: Any, where: str) -> Any:
    """A list, number, text or flag; None if it is not of this kind."""
    if isinstance(content, list) and origin in (tuple, list):
        kinds = inner[:1] * len(content) if origin is list or inner[1:] == (...,) else inner
        same = len(kinds) == len(content)
        return origin(_read(of, item, where, {}) for of, item in zip(kinds, content, strict=True)) if same else None
    if isinstance(content, list) and origin is np.ndarray:
        return _array(content)
    if kind is float and is_number(content):
        return float(content)
    return content if origin is Literal or type(content) is kind else None


def _array(content: list[Any]) -> NDArray[np.float64] | None:
    try:
        array = np.array(content)
    except ValueError:  # rows of different lengths
        return None
    return array.astype(np.float64) if array.dtype.kind in "iuf" else None


def _place(where: str, name: str, kind: Any) -> str:
    records = any(_entries(part) for part in (kind, *get_args(kind)))
    return f"{where[:-1]}.{name}]" if records and where.endswith("]") else f"{where} {name}"


def covariance_problem(matrix: NDArray[np.float64], names: Sequence[str], largest: Sequence[float]) -> str:
    """Reason why a matrix is not the covariance of the parameters `names` in SI; empty if it may be one.

    A parameter that the data do not determine has an infinite variance and covariances of zero.

    Parameters
    ----------
    matrix
        Shape (k, k).
    largest
        Standard deviations that are possible, k of them.

    Examples
    --------
    >>> covariance_problem(np.diag([1.0, -4.0]), ["a", "b"], [3.0, 3.0])
    'the variance of b is -4, from 0 to 9 is possible'
    """
    determined = np.flatnonzero(np.diag(matrix) != np.inf)
    matrix = matrix[np.ix_(determined, determined)]
    if not np.isfinite(matrix).all():
        return "has a value that is not finite"
    variances = np.diag(matrix)
    for index, variance in zip(determined.tolist(), variances.tolist(), strict=True):
        if not 0.0 <= variance <= largest[index] ** 2:
            return f"the variance of {names[index]} is {variance:g}, from 0 to {largest[index] ** 2:g} is possible"
    scale = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    correlations = matrix / scale / scale[:, None]
    if np.abs(correlations - correlations.T).max(initial=0.0) > _ROUNDING:
        return "is not symmetric"
    if np.linalg.eigvalsh(correlations).min(initial=0.0) < -_ROUNDING:
        return "has correlations beyond -1 to 1, or that exclude each other"
    return ""
