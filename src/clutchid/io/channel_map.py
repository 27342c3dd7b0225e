"""`ChannelMap`: which channel of a foreign file is what, as a TOML file that a user can read and edit."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any

from clutchid.errors import DataError, ParameterError
from clutchid.io.columns import QUANTITIES, unit_spelled
from clutchid.io.files import atomic_write, plain_file
from clutchid.parameters import unknown_name
from clutchid.units import UNITS, known_units

_TOP = ("dbc", "raster")


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a file: the quantity is ``sign * factor * sample + offset`` in `unit`, `delay` s before its stamp.

    `channel` is the name in the file and `group` the raster that it stands in, where the name alone is not enough;
    `unit` wins over the file's own. `longest` is how long, in s, a sample may stand for what follows it (a duty cycle
    that is only sent when it changes); without it five usual intervals of the channel.
    """

    channel: str
    group: str | None = None
    unit: str | None = None
    sign: float = 1.0
    factor: float = 1.0
    offset: float = 0.0
    delay: float = 0.0
    longest: float | None = None


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """The channel of each quantity, the DBC files that decode a bus log, and the raster in s that all are brought to.

    Without `raster` it is the stamps of the channel that ticks fastest. `dbc` are paths as they can be opened. What is
    said of an entry stands in `comments`, of the file as a whole under an empty name, and is written but not read.
    """

    channels: Mapping[str, Channel]
    dbc: tuple[Path, ...] = ()
    raster: float | None = None
    comments: Mapping[str, str] = field(default_factory=dict)


def read_map(path: str | PathLike[str]) -> ChannelMap:
    """The channel map in a TOML file; paths of DBC files in it are relative to it.

    Raises
    ------
    DataError
        If there is no such file.
    ParameterError
        If it is no channel map; the text lists every problem.
    """
    file = plain_file(path, "channel map")
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path}: is no TOML file ({error}); `clutchid look FILE --save` writes a map.") from None
    problems: list[str] = []
    channels = {
        name: entry
        for name, values in content.items()
        if name not in _TOP and (entry := _channel(name, values, problems)) is not None
    }
    dbc, raster = _dbc(content.get("dbc", []), file.parent, problems), _raster(content.get("raster"), problems)
    if not problems and not channels:
        problems.append("names no channel; write for example [position] with channel = 'NAME'.")
    if problems:
        raise ParameterError(_listed(path, problems))
    return ChannelMap(channels, dbc, raster)


def write_map(content: ChannelMap, path: str | PathLike[str]) -> None:
    """Write a channel map that `read_map` reads; what is as it is without saying so is left out.

    Raises
    ------
    ExportError
        If the file cannot be written; an older file is then as it was.
    """
    with atomic_write(path) as temporary:
        temporary.write_text(map_text(content, Path(path).parent), encoding="utf-8")


def map_text(content: ChannelMap, folder: Path) -> str:
    """A channel map as TOML text; DBC files are named relative to `folder` where they lie below it.

    Examples
    --------
    >>> print(map_text(ChannelMap({"position": Channel("Kupplungsweg", unit="mm", sign=-1.0)}), Path()))
    # Channel map of clutchid: quantity = sign * factor * sample + offset in the unit, taken at stamp - delay.
    <BLANKLINE>
    [position]
    channel = "Kupplungsweg"
    unit = "mm"
    sign = -1.0
    <BLANKLINE>
    """
    import tomli_w

    top: dict[str, Any] = {}
    if content.dbc:
        top["dbc"] = [_relative(file, folder) for file in content.dbc]
    if content.raster is not None:
        top["raster"] = content.raster
    parts = [
        "# Channel map of clutchid: quantity = sign * factor * sample + offset in the unit, taken at stamp - delay.",
        tomli_w.dumps(top).rstrip(),
    ]
    for name, entry in content.channels.items():
        comment = content.comments.get(name)
        values = {
            item.name: getattr(entry, item.name)
            for item in fields(entry)
            if getattr(entry, item.name) not in (None, item.default)
        }
        lines = ([f"# {comment}"] if comment else []) + [tomli_w.dumps({name: values}).rstrip()]
        parts.append("\n".join(lines))
    parts.append("\n".join(f"# {line}" for line in content.comments.get("", "").splitlines()))
    return "\n\n".join(part for part in parts if part) + "\n"


def _channel(name: str, values: Any, problems: list[str]) -> Channel | None:
    """The entry of one quantity; what is wrong with it is added to `problems`."""
    before = len(problems)
    if name not in QUANTITIES:
        problems.append(unknown_name(name, (*QUANTITIES, *_TOP), "quantity"))
        return None
    if not isinstance(values, dict):
        problems.append(f"[{name}]: write a table, for example [{name}] with channel = 'NAME' below it.")
        return None
    known = {item.name: item for item in fields(Channel)}
    problems += [f"[{name}]: {unknown_name(key, known, 'entry')}" for key in values if key not in known]
    for key in ("channel", "group", "unit"):
        if key in values and not isinstance(values[key], str):
            problems.append(f"[{name}] {key} = {values[key]!r}: a text in quotation marks is needed.")
    for key in ("sign", "factor", "offset", "delay", "longest"):
        if key in values and not _number(values[key]):
            problems.append(f"[{name}] {key} = {values[key]!r}: a finite number is needed.")
    if "channel" not in values:
        problems.append(f"[{name}]: has no channel; write channel = 'NAME' as `clutchid look` lists it.")
    if len(problems) > before:
        return None
    read: dict[str, Any] = {key: value if isinstance(value, str) else float(value) for key, value in values.items()}
    entry = Channel(**read)
    problems += [f"[{name}] {problem}" for problem in _values(name, entry)]
    return entry


def _values(name: str, entry: Channel) -> list[str]:
    """What is wrong with the values of an entry."""
    problems = []
    if entry.unit is not None:
        unit = UNITS.get(unit_spelled(entry.unit) or "")
        if unit is None or unit.si != QUANTITIES[name]:
            known = ", ".join(known_units(QUANTITIES[name]))
            problems.append(f"unit = '{entry.unit}': is not known here; use one of {known}.")
    if abs(entry.sign) != 1.0:
        problems.append(f"sign = {entry.sign:g}: is 1 or -1; another scale is the factor.")
    if entry.factor == 0.0:
        problems.append("factor = 0: nothing would be left of the channel.")
    if entry.longest is not None and entry.longest <= 0.0:
        problems.append(f"longest = {entry.longest:g} s: is above 0.")
    return problems


def _dbc(value: Any, folder: Path, problems: list[str]) -> tuple[Path, ...]:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        problems.append(f"dbc = {value!r}: a list of file names is needed.")
        return ()
    return tuple(folder / name for name in names)


def _raster(value: Any, problems: list[str]) -> float | None:
    if value is None:
        return None
    if not _number(value) or value <= 0:
        problems.append(f"raster = {value!r}: an interval above 0 in s is needed, for example 0.001.")
        return None
    return float(value)


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _relative(file: Path, folder: Path) -> str:
    try:
        return file.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        return str(file.resolve())


def _listed(path: str | PathLike[str], problems: list[str]) -> str:
    return str(DataError.of(str(path), problems))
