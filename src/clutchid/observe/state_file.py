"""State of an observer in a TOML file, from which it goes on bit by bit."""

from __future__ import annotations

from hashlib import sha256
from os import PathLike
from typing import Any

import numpy as np
import tomli_w

from clutchid.errors import ParameterError
from clutchid.filter.joint_filter import JointState
from clutchid.io.files import atomic_write
from clutchid.io.toml_file import read_toml
from clutchid.log import FloatArray
from clutchid.observe.observer import Observer, ObserverState, blank, start
from clutchid.observe.rest import RestWatch
from clutchid.observe.strokes import Strokes
from clutchid.observe.tail import Tail
from clutchid.strokes.vented_rest import FURTHEST

FORMAT = 4


def write_state(observer: Observer, state: ObserverState, path: str | PathLike[str]) -> None:
    """Write a state; an existing file is replaced atomically.

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
        "number": state.number,
        "deviations": state.deviations.tolist(),
        "strokes": {name: value for name, value in state.strokes._asdict().items() if value is not None},
        "mismatch": state.mismatch,
        "leaking": state.leaking,
        "zero": state.zero,
        "rest": {**state.rest._asdict(), "returned": list(state.rest.returned), "window": state.rest.window.tolist()},
        "parameters": {"theta": state.theta.tolist(), "root": state.T.tolist()},
        "sound": {"theta": state.sound[0].tolist(), "root": state.sound[1].tolist()},
        "tail": {name: array.tolist() for name, array in state.tail._asdict().items()},
    }
    if state.filter is not None:
        content["filter"] = {name: array.tolist() for name, array in state.filter._asdict().items()}
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        tomli_w.dump(content, file)


def read_state(observer: Observer, path: str | PathLike[str]) -> ObserverState:
    """A state that `write_state` wrote for the same observer.

    Raises
    ------
    DataError
        If there is no readable file.
    ParameterError
        If it is damaged, or of another calibration or method.
    """
    content, head = _content(path)
    if head.get("method") != observer.method or head.get("fingerprint") != fingerprint(observer):
        raise ParameterError(
            f"{path}: the state of the method '{head.get('method')}' of another calibration or method; give the "
            "calibration and method that it was saved with, or start without it."
        )
    try:
        return _state(observer, content)
    except (KeyError, TypeError, ValueError) as error:
        raise ParameterError(f"{path}: the state of an observer is damaged ({error}); start without it.") from None


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
        raise ParameterError(f"{path}: the state of an observer is damaged (spacing); start without it.")
    return spacing


def _content(path: str | PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The file, and the section that says what it belongs to."""
    content = read_toml(path, "state of an observer")
    head = content.get("observer")
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        raise ParameterError(f"{path}: is no state of an observer that this version reads; start without it.")
    return content, head


def _state(observer: Observer, content: dict[str, Any]) -> ObserverState:
    def array(section: str, name: str, *shape: int) -> FloatArray:
        return np.array(content[section][name], dtype=np.float64).reshape(shape)

    columns = {"time": (-1,), "duties": (-1, 2), "position": (-1,), "supply": (-1,)}
    tail = Tail(**{name: array("tail", name, *shape) for name, shape in columns.items()})
    found = None
    if "filter" in content:
        saved = content["filter"]
        shapes = blank(observer)._asdict().items()
        found = JointState(**{name: np.array(saved[name], a.dtype).reshape(a.shape) for name, a in shapes})
    made = start(observer)
    (theta, root), sound = (
        (array(section, "theta", *made.theta.shape), array(section, "root", *made.T.shape))
        for section in ("parameters", "sound")
    )
    deviations = np.array(content["deviations"], dtype=np.float64).reshape(made.deviations.shape)
    strokes = Strokes(int(content["strokes"]["ended"]), content["strokes"].get("began"))
    number, mismatch = int(content["number"]), float(content["mismatch"])
    leaking, zero, rest = bool(content["leaking"]), float(content["zero"]), _rest(content["rest"])
    return ObserverState(found, theta, root, tail, deviations, sound, number, strokes, mismatch, leaking, rest, zero)


def _rest(content: dict[str, Any]) -> RestWatch:
    shift, lowest = float(content["shift"]), float(content["lowest"])
    if not abs(shift) <= FURTHEST:
        raise ValueError(f"rest shift {shift:g} m")
    returned, window = tuple(map(float, content["returned"])), np.array(content["window"], dtype=np.float64)
    vents, stroke, taken = int(content["vents"]), bool(content["stroke"]), bool(content["taken"])
    return RestWatch(shift, lowest, returned, window, vents, stroke, taken)


def fingerprint(observer: Observer) -> str:
    """SHA-256 of what the numbers of a state depend on: actuator, adapting parameters, settings, rule, usual NIS."""
    told = repr((
        observer.actuator, observer.joint.coordinates, observer.joint.settings, observer.joint.noise,
        observer.joint.rule, observer.usual, observer.zero, observer.calibration.rest if observer.calibration else None,
    ))  # fmt: skip
    return sha256(told.encode()).hexdigest()
