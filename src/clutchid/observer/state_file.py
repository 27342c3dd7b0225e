"""State of an observer in a TOML file, from which it goes on bit by bit.

Its checksum covers every entry, so that what is read is what an observer wrote.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from os import PathLike
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from clutchid.codegen.records import record_copy, values_in
from clutchid.errors import ParameterError
from clutchid.files import write_text
from clutchid.files.records import read_toml
from clutchid.inference.filter.setup import FilterState
from clutchid.observer.configuration import Observer, blank, start
from clutchid.observer.state import ObserverState

FORMAT = 19

#: Entries of the section ``[parameters]``, and the fields of a state that they are.
_PARAMETERS = {"theta": "theta", "root": "T", "considered": "G", "wear": "wear"}

#: Records whose arrays have any length.
_OF_ANY_LENGTH = ("tail",)


def write_state(
    observer: Observer, state: ObserverState, path: str | PathLike[str], origin: float | None = None
) -> None:
    """Write a state; an existing file is replaced atomically.

    Parameters
    ----------
    origin : s
        Stamp of the source, such as a bus, that is the time 0 of the recording; None where its own stamps count.

    Raises
    ------
    ExportError
        If the file cannot be written.
    """
    content: dict[str, Any] = {
        "observer": {
            "format": FORMAT,
            "method": observer.method,
            "spacing": observer.spacing,
            "fingerprint": fingerprint(observer),
        },
        "parameters": {name: _plain(getattr(state, field)) for name, field in _PARAMETERS.items()},
    } | {
        field: _plain(value)
        for field, value in state._asdict().items()
        if field not in _PARAMETERS.values() and value is not None
    }
    if origin is not None:
        content["observer"]["origin"] = float(origin)
    content["observer"]["sha256"] = _checksum(content)
    write_text(tomli_w.dumps(content), path)


def read_state(observer: Observer, path: str | PathLike[str]) -> ObserverState:
    """A state that `write_state` wrote for the same observer.

    Raises
    ------
    DataError
        If there is no readable file.
    ParameterError
        If it is damaged, or of another calibration, method or format.
    """
    content, head = _content(path)
    if head.get("method") != observer.method or head.get("fingerprint") != fingerprint(observer):
        raise ParameterError(
            f"{path}: holds a state of the method '{head.get('method')}' from another calibration or method; give "
            "the calibration and method with which the state was saved, or start without it."
        )
    try:
        state = _state(observer, content)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ParameterError(_damaged(path, f"entry {error}" if isinstance(error, KeyError) else str(error))) from None
    if not all(np.isfinite(values).all() for values in (state.theta, state.T, state.G, *_numbers(state.filter))):
        raise ParameterError(_damaged(path, "a value of its filter is not finite"))
    return state


def saved_spacing(path: str | PathLike[str]) -> float:
    """Time in s from one sample to the next of the observer whose state is in a file.

    Raises
    ------
    DataError, ParameterError
        As `read_state`.
    """
    return float(_content(path)[1]["spacing"])


def saved_origin(path: str | PathLike[str]) -> float | None:
    """Stamp of the source in s that is the time 0 of the recording whose state is in a file; None if it has none.

    Raises
    ------
    DataError, ParameterError
        As `read_state`.
    """
    origin = _content(path)[1].get("origin")
    return None if origin is None else float(origin)


def _damaged(path: str | PathLike[str], reason: str) -> str:
    return f"{path}: the observer state is damaged ({reason}); start without it."


def _content(path: str | PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The file, whose checksum is right, and the section that says what it belongs to."""
    content = read_toml(path, "state of an observer")
    head = content.get("observer")
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        raise ParameterError(
            f"{path}: is not an observer state that this version can read (format {FORMAT}); start without it and "
            "save a new one: clutchid observe LOG --start CAL.toml --save STATE.toml."
        )
    if head.get("sha256") != _checksum(content):
        raise ParameterError(_damaged(path, "it was changed after it was written: its checksum does not match"))
    return content, head


def _checksum(content: Mapping[str, Any]) -> str:
    """SHA-256 of the entries of a state, apart from the checksum itself; floats by their shortest decimal digits."""
    head = {name: value for name, value in content["observer"].items() if name != "sha256"}
    return sha256(json.dumps({**content, "observer": head}, sort_keys=True, default=str).encode()).hexdigest()


def _plain(value: Any) -> Any:
    """A value of a state as TOML has it."""
    if hasattr(value, "_asdict"):
        return {name: _plain(entry) for name, entry in value._asdict().items() if entry is not None}
    if isinstance(value, np.record):
        return values_in(value)
    return value.tolist() if isinstance(value, np.ndarray) else value


def _state(observer: Observer, content: dict[str, Any]) -> ObserverState:
    like = start(observer)
    entries = content | {field: content["parameters"][name] for name, field in _PARAMETERS.items()}
    values = {field: _alike(entries, field, value) for field, value in like._asdict().items() if field != "filter"}
    return like._replace(**values, filter=_alike(content, "filter", blank(observer)) if "filter" in content else None)


def _alike(section: Mapping[str, Any], name: str, like: Any, *, any_length: bool = False) -> Any:
    """The entry of a section with type and shape of another value; with `any_length` of its arrays."""
    if like is None and name not in section:
        return None
    value = section[name]
    if hasattr(like, "_asdict"):
        of_any_length = name in _OF_ANY_LENGTH
        return like._replace(**{
            field: _alike(value, field, entry, any_length=of_any_length) for field, entry in like._asdict().items()
        })  # fmt: skip
    if isinstance(like, np.record):
        fields = {field: _alike(value, field, entry) for field, entry in values_in(like).items()}
        return record_copy(like, **fields)
    if isinstance(like, (np.ndarray, list)):
        shape = np.shape(like)
        return np.array(value, np.asarray(like).dtype).reshape((-1, *shape[1:]) if any_length else shape)
    return type(like)(value)


def _numbers(saved: FilterState | None) -> tuple[NDArray[Any], ...]:
    """Arrays of a filter that are finite; a measurement that is missing is not."""
    return () if saved is None else tuple(a for name, a in saved._asdict().items() if name != "at_values")


def fingerprint(observer: Observer) -> str:
    """SHA-256 of what the numbers of a state depend on: actuator, adapting parameters, settings, method, usual NIS."""
    joint, calibration = observer.joint, observer.calibration
    told = repr((
        observer.actuator, joint.coordinates, joint.settings, joint.noise,
        observer.usual, observer.zero, calibration.rest if calibration else None, observer.supply_std,
        observer.air and (observer.air.calibrated, observer.air.powers),
    ))  # fmt: skip
    return sha256(told.encode()).hexdigest()
