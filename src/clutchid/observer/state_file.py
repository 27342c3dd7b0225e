"""State of an observer in a TOML file, from which it goes on bit by bit."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from hashlib import sha256
from os import PathLike
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from clutchid.arguments import is_number
from clutchid.codegen.records import record_copy, values_in
from clutchid.errors import ParameterError
from clutchid.files import write_text
from clutchid.files.records import read_toml
from clutchid.inference.filter.setup import FilterState
from clutchid.inference.uncertainty.conditions import AIR
from clutchid.observer.configuration import Observer, blank, start
from clutchid.observer.rest import LOW, REMEMBERED
from clutchid.observer.state import ObserverState
from clutchid.strokes.rest_shift import FURTHEST

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
    if problem := next(_problems(state), ""):
        raise ParameterError(_damaged(path, problem))
    return state


def saved_spacing(path: str | PathLike[str]) -> float:
    """Time in s from one sample to the next of the observer whose state is in a file.

    Raises
    ------
    DataError, ParameterError
        As `read_state`.
    """
    _, head = _content(path)
    spacing = head.get("spacing")
    if not isinstance(spacing, float) or not 0.0 < spacing < np.inf:
        raise ParameterError(_damaged(path, "spacing"))
    return spacing


def saved_origin(path: str | PathLike[str]) -> float | None:
    """Stamp of the source in s that is the time 0 of the recording whose state is in a file; None if it has none.

    Raises
    ------
    DataError, ParameterError
        As `read_state`.
    """
    origin = _content(path)[1].get("origin")
    if origin is not None and not (is_number(origin) and np.isfinite(origin)):
        raise ParameterError(_damaged(path, "origin"))
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
    return _scalar(name, value, like)


def _scalar(name: str, value: Any, like: Any) -> Any:
    if isinstance(like, bool):
        if value is not True and value is not False:
            raise ValueError(f"{name} is neither true nor false")
        return value
    if isinstance(like, int):
        if type(value) is not int or not 0 <= value < 1 << 62:
            raise ValueError(f"{name} is not a number of at least 0")
        return value
    if not is_number(value):
        raise ValueError(f"{name} is no number")
    return float(value)


def _problems(state: ObserverState) -> Iterator[str]:
    """Faults of a state: values that are not finite, lengths that differ, values outside of their ranges."""
    tail, m, (intake, _, stroke, rest, *windows) = state.tail, state.tail.time.size, state.inputs
    finite: dict[str, Any] = {
        "parameters": (state.theta, state.T, state.G),
        "sound": state.sound,
        "filter": _numbers(state.filter),
        "tail": (tail.time, tail.duties, tail.open_std),
        "rest": (rest.returned, *windows),
        "faults": (state.faults.share, state.faults.strokes),
    }
    yield from (f"{name} has a value that is not finite" for name, entries in finite.items()
                if not all(np.isfinite(values).all() for values in entries))  # fmt: skip
    wrong = {
        "the columns of tail have different lengths": any(len(column) != m for column in tail),
        "the times of tail do not increase": np.any(np.diff(tail.time) <= 0.0),
        "the zero of the position is unknown, but it has not jumped": state.unzeroed and not state.jumped,
        "a duty cycle of tail is outside 0 to 1": np.any((tail.duties < 0.0) | (tail.duties > 1.0)),
        "filter, number and tail do not belong together":
            not (state.filter is None) == (state.number == 0) == (m == 0),
        "the remaining gain of the parameters is below 0": min(state.wear[0], state.sound.wear[0]) < 0,
        "a root is not lower triangular": any(np.triu(root, 1).any() for root in (state.T, state.sound.T)),
        "a root has a row of zeros, a standard deviation of 0":
            not all(np.linalg.norm(root, axis=1).all() for root in (state.T, state.sound.T)),
        "a standard deviation is below 0 or infinite":
            np.any((state.deviations < 0.0) | np.isinf(state.deviations)),
        f"{state.temperature:g} K is not a temperature of air":
            not (state.temperature == 0.0 or AIR[0] <= state.temperature <= AIR[1])
            or not (intake.air == 0.0 or AIR[0] <= intake.air <= AIR[1]),
        "a mark is neither 0 nor 1": any(mark not in (0, 1) for mark in (
            intake.sampled, intake.driven, intake.held, intake.jumped, intake.unzeroed, intake.supply_unlike,
            intake.supply_recorded, intake.air_refused, stroke.within, rest.excursion, rest.taken, state.nis.faulty,
        )),
        "more samples of a vented rest are stored than is possible":
            rest.n_returned > REMEMBERED or rest.n_bin >= windows[0].size or rest.n_medians >= windows[1].size,
        f"mismatch {state.mismatch:g} is not at least 0":
            not all(0.0 <= mean < np.inf for mean in (state.nis.running, state.nis.sound, state.nis.stored)),
        f"excess {state.excess:g} is not at least 0": not 0.0 <= state.excess < np.inf,
        f"the vented rest has moved by more than {FURTHEST:g} m":
            not (abs(rest.shift) <= FURTHEST and abs(state.zero) <= FURTHEST),
        f"a vented rest lies above {LOW:g} m":
            any(level > LOW for level in (*rest.returned, *windows[0], *windows[1], rest.lowest))
            or np.isinf(rest.lowest),
    }  # fmt: skip
    yield from (sentence for sentence, is_wrong in wrong.items() if is_wrong)
    if state.filter is not None:
        yield from _filter_problems(state, state.filter)


def _filter_problems(state: ObserverState, saved: FilterState) -> Iterator[str]:
    if not (np.array_equal(saved.theta, state.theta) and np.array_equal(saved.T, state.T)):
        yield "the parameters are not those of filter"
    if not saved.S.any():
        yield "S is 0, as if the states were known exactly"
    if not (np.array_equal(saved.wear, state.wear) and saved.due[0] in (0, 1, 3, 5, 7)):
        yield "a pending correction, or the remaining gain of the parameters, does not match filter"


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
