"""Kinds of the arguments of public functions, checked against their annotations at the border.

A value of a wrong kind is one sentence that names the argument, instead of an error from inside.
"""

from __future__ import annotations

import ast
import inspect
import types
import typing
from collections import abc
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache, wraps
from importlib import import_module
from numbers import Integral, Real
from os import PathLike
from typing import Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin

import numpy as np

from clutchid.errors import DataError, ParameterError
from clutchid.messages import shortened
from clutchid.names import unknown_name

_Function = TypeVar("_Function", bound=Callable[..., Any])


def is_number(value: object) -> bool:
    """Whether a value, of a TOML file for example, is a number within the range of a float."""
    if isinstance(value, bool | np.timedelta64) or not isinstance(value, (int, float, np.floating, np.integer)):
        return False
    try:
        float(value)  # TOML has no largest integer
    except OverflowError:
        return False
    return True


def is_frame(value: object) -> bool:
    """Whether a value is a table of pandas, polars or Arrow, which iterates over its columns."""
    return hasattr(value, "__arrow_c_stream__") or hasattr(value, "__dataframe__")


def check_share(option: str, share: float, example: float) -> None:
    """Refuse what is no share.

    Raises
    ------
    ParameterError
        If it is not from 0 to 1.
    """
    if not 0.0 <= share <= 1.0:
        raise ParameterError(f"{option} {share}: is a share from 0 to 1, such as {example:g}.")


def checked(function: _Function) -> _Function:
    """The function, with the kinds of its arguments checked.

    Raises
    ------
    DataError, ParameterError
        At a call with an argument of another kind than its annotation says, that of a recording or another one.

    Examples
    --------
    >>> @checked
    ... def stroke(reach: float, valves: Mapping[str, float] | None = None) -> float:
    ...     return reach
    >>> stroke("far")
    Traceback (most recent call last):
    clutchid.errors.ParameterError: stroke: reach = 'far': a number is needed, not a text; see help(clutchid.stroke).
    """
    signature = inspect.signature(function)
    name, places = function.__name__, tuple(signature.parameters)

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        hints = _hints(function)
        stated = {**dict(zip(places, arguments, strict=False)), **options}
        if not hints.keys() >= stated.keys():  # an argument that it does not have
            signature.bind(*arguments, **options)
        for place, value in stated.items():
            hint, usual = hints[place]
            if type(value) not in usual:
                _check(name, value, hint, place)
        return function(*arguments, **options)

    return typing.cast(_Function, call)


def check_fields(record: object) -> None:
    """Check the kinds of the fields of a record like those of arguments; the record itself checks its choices of texts.

    Raises
    ------
    ParameterError
        If one is of another kind than its annotation says.
    """
    kind: Any = type(record)
    for place, (hint, usual) in _hints(kind).items():
        value = getattr(record, place)
        if type(value) not in usual and not (isinstance(value, str) and _choices(hint)):
            _check(type(record).__name__, value, hint, place)


class _Misfit(NamedTuple):
    """A value of a wrong kind, its place in an argument, and the kind that is needed."""

    place: str
    value: object
    hint: Any


def _check(name: str, value: object, hint: Any, place: str) -> None:
    misfit = _misfit(value, hint, place)
    if misfit is None:
        return
    where, choices = f"{name}: {misfit.place} = {_shown(misfit.value)}", _choices(misfit.hint)
    if choices and isinstance(misfit.value, str):
        raise ParameterError(f"{where}: {unknown_name(misfit.value, choices, misfit.place)}")
    parts = {getattr(get_origin(part) or part, "__name__", "") for part in _alternatives(misfit.hint)}
    recording = {"Log", "PathLike"} <= parts
    needed = "a recording is a clutchid.Log or the path of a file" if recording else f"{_needed(misfit.hint)} is needed"
    error = DataError if recording else ParameterError
    framed = "Log" in parts and is_frame(misfit.value)
    way = "clutchid.Log.from_frame(frame) makes one of a data frame" if framed else f"see help(clutchid.{name})"
    raise error(f"{where}: {needed}, not {_kind(misfit.value)}; {way}.")


@lru_cache(maxsize=256)
def _hints(owner: Any) -> dict[str, tuple[Any, frozenset[type]]]:
    """Annotations of a function or record by name, each with the types that need no further look.

    An annotation that cannot be resolved admits anything.
    """
    module = import_module(owner.__module__)
    texts = {name: text for name, text in owner.__annotations__.items() if name != "return"}
    names = vars(module)
    try:
        hints = {name: _resolved(text, names) for name, text in texts.items()}
    except NameError:
        names = {**names, **_imported_for_types(module)}
        hints = {name: _resolved(text, names, otherwise=Any) for name, text in texts.items()}
    return {name: (hint, frozenset(filter(inspect.isclass, _alternatives(hint)))) for name, hint in hints.items()}


def _resolved(text: Any, names: dict[str, Any], otherwise: Any = None) -> Any:
    if not isinstance(text, str):
        return text
    try:
        return eval(text, names)
    except NameError:
        if otherwise is None:
            raise
        return otherwise


def _imported_for_types(module: types.ModuleType) -> dict[str, Any]:
    """Names that a module imports for its annotations only."""
    try:
        lines = ast.parse(inspect.getsource(module)).body
    except OSError:  # without sources
        return {}
    blocks = [line.body for line in lines if isinstance(line, ast.If) and ast.unparse(line.test) == "TYPE_CHECKING"]
    imports = [line for block in blocks for line in block if isinstance(line, ast.ImportFrom) and line.module]
    return {
        alias.asname or alias.name: getattr(import_module(str(line.module)), alias.name)
        for line in imports
        if str(line.module).startswith("clutchid")
        for alias in line.names
    }


def _misfit(value: object, hint: Any, place: str) -> _Misfit | None:
    """Where a value is of a wrong kind, as deep in it as can be said; None where it fits."""
    parts = _alternatives(hint)
    if len(parts) > 1:
        misfits = [_misfit(value, part, place) for part in parts]
        deeper = [misfit for misfit in misfits if misfit is not None and misfit.place != place]
        return None if None in misfits else deeper[0] if deeper else _Misfit(place, value, hint)
    origin, arguments = get_origin(hint) or hint, get_args(hint)
    if not _is_kind(value, origin, arguments):
        return _Misfit(place, value, hint)
    return next((misfit for part in _parts(value, origin, arguments, place) if (misfit := _misfit(*part))), None)


def _alternatives(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def _choices(hint: Any) -> list[str]:
    """The texts of a Literal."""
    return [text for part in _alternatives(hint) if get_origin(part) is Literal for text in get_args(part)]


def _is_kind(value: object, origin: Any, arguments: tuple[Any, ...]) -> bool:
    """Whether a value is of a kind, without what it contains."""
    if simple := _SIMPLE.get(origin):
        return simple(value)
    if origin is Literal:
        return isinstance(value, str) and value in arguments
    return not isinstance(origin, type) or (
        _is_container(value, origin, arguments) if arguments else isinstance(value, origin)
    )


#: Whether a value is of a kind, by kind: a bool is no number.
_SIMPLE: Mapping[Any, Callable[[object], bool]] = {
    None: lambda value: value is None,
    types.NoneType: lambda value: value is None,
    float: lambda value: isinstance(value, Real) and not isinstance(value, bool | np.timedelta64),
    int: lambda value: isinstance(value, Integral) and not isinstance(value, bool | np.timedelta64),
    bool: lambda value: isinstance(value, bool | np.bool_),
    abc.Callable: callable,
}


def _is_container(value: object, origin: type, arguments: tuple[Any, ...]) -> bool:
    """Whether a value is a container of this kind; an iterable that is no text counts as a sequence."""
    if origin is tuple:
        return isinstance(value, tuple | list) and (arguments[-1] is Ellipsis or len(value) == len(arguments))
    if issubclass(origin, Mapping) or not issubclass(origin, Iterable):
        return isinstance(value, origin)
    return isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping) and not is_frame(value)


def _parts(value: Any, origin: Any, arguments: tuple[Any, ...], place: str) -> Iterator[tuple[object, Any, str]]:
    """Elements of a container, with the kind and the place of each."""
    if not arguments or not isinstance(origin, type):
        return
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield key, arguments[0], f"a key of {place}"
            yield item, arguments[-1], f"{place}[{key!r}]"
    elif isinstance(value, list | tuple):
        kinds = arguments if origin is tuple and arguments[-1] is not Ellipsis else (arguments[0],) * len(value)
        yield from (
            (item, kind, f"{place}[{i}]")
            for i, (item, kind) in enumerate(zip(value, kinds, strict=True))
            if type(item) is not kind
        )


#: Kinds in words.
_WORDS: Mapping[Any, str] = {
    float: "a number", int: "a whole number", bool: "True or False", str: "a text", PathLike: "a path",
    types.NoneType: "None", abc.Callable: "a function", tuple: "a tuple", list: "a list", dict: "a mapping",
}  # fmt: skip


def _needed(hint: Any) -> str:
    """A kind in words."""
    parts = [get_origin(part) or part for part in _alternatives(hint)]
    words = [_word(part) for part in _alternatives(hint) if part not in (None, types.NoneType)]
    if PathLike in parts:  # a path may be a text
        words.remove(_WORDS[str])
    if None in parts or types.NoneType in parts:
        words.append("None")
    return " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _word(hint: Any) -> str:
    origin, arguments = get_origin(hint) or hint, get_args(hint)
    if origin is Literal:
        return "one of " + ", ".join(map(repr, arguments))
    if origin is tuple and arguments and arguments[-1] is not Ellipsis:
        return f"a tuple of {len(arguments)}"
    if isinstance(origin, type) and issubclass(origin, Mapping) and arguments:
        return f"a mapping from {_bare(arguments[0])} to {_bare(arguments[-1])}"
    if isinstance(origin, type) and issubclass(origin, Iterable) and arguments:
        return f"a list of {_bare(arguments[0])}"
    return _WORDS.get(origin) or _named(origin)


def _bare(hint: Any) -> str:
    """A kind in words without an article."""
    return _needed(hint).removeprefix("a ").removeprefix("an ").replace(" or a ", " or ").replace(", a ", ", ")


def _named(kind: Any) -> str:
    name = getattr(kind, "__name__", str(kind))
    return name if name.endswith("s") else f"{'an' if name[:1] in 'AEIOU' else 'a'} {name}"


def _kind(value: object) -> str:
    if value is None or isinstance(value, bool):
        return repr(value)
    return _WORDS.get(type(value)) or _named(type(value))


def _shown(value: object) -> str:
    """A value in a sentence; of a large container only the number of elements."""
    if isinstance(value, int | float | str | bytes | complex | None | list | tuple | dict):
        return shortened(repr(value))
    return _kind(value)
