"""`ChannelMap`: assignment of the channels of any file to quantities, as a TOML file that users can edit."""

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
from clutchid.names import unknown_name
from clutchid.units import UNITS, known_units

_TOP = ("dbc", "raster")


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a file: the quantity is ``sign * factor * sample + offset`` in `unit`, `delay` s before its stamp.

    `channel` is the name in the file and `group` its group there, if the name is not unique; `unit` overrides that of
    the file. `longest` is the time in s for which a sample remains valid (for a duty cycle that is only sent when it
    changes); by default five usual intervals of the channel.
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
    """The channel of each quantity, the DBC files that decode a bus log, and the interval of the common time grid in s.

    Without the interval `raster`, the time grid is that of the channel with the highest rate. `dbc` are paths of files.
    `comments` has comments by entry, and on the file as a whole under an empty name; they are written but not read.
    """

    channels: Mapping[str, Channel]
    dbc: tuple[Path, ...] = ()
    raster: float | None = None
    comments: Mapping[str, str] = field(default_factory=dict)


def read_map(path: str | PathLike[str]) -> ChannelMap:
    """Read a channel map from a TOML file; paths of DBC files in it are relative to it.

    Raises
    ------
    DataError
        If there is no such file.
    ParameterError
        If it is not a channel map; the text lists all problems.
    """
    file = plain_file(path, "channel map")
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParameterError(
            f"{path}: is not a TOML file ({error}); `clutchid look FILE --save` writes a map."
        ) from None
    problems: list[str] = []
    channels = {
        name: entry
        for name, values in content.items()
        if name not in _TOP and (entry := _channel(name, values, problems)) is not None
    }
    dbc, raster = _dbc(content.get("dbc", []), file.parent, problems), _raster(content.get("raster"), problems)
    if not problems and not channels:
        problems.append("contains no channel; write for example [position] with channel = 'NAME'.")
    if problems:
        raise ParameterError(_listed(path, problems))
    return ChannelMap(channels, dbc, raster)


def write_map(content: ChannelMap, path: str | PathLike[str]) -> None:
    """Write a channel map for `read_map`; default values are omitted.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is then unchanged.
    """
    with atomic_write(path) as temporary:
        temporary.write_text(map_text(content, Path(path).parent), encoding="utf-8")


def map_text(content: ChannelMap, folder: Path) -> str:
    """A channel map as TOML text; paths of DBC files below `folder` are relative to it.

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
    """The entry of one quantity; its problems are appended to `problems`."""
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
            problems.append(f"[{name}] {key} = {values[key]!r}: a string is needed.")
    for key in ("sign", "factor", "offset", "delay", "longest"):
        if key in values and not _number(values[key]):
            problems.append(f"[{name}] {key} = {values[key]!r}: a finite number is needed.")
    if "channel" not in values:
        problems.append(f"[{name}]: has no channel; write channel = 'NAME' as listed by `clutchid look`.")
    if len(problems) > before:
        return None
    read: dict[str, Any] = {key: value if isinstance(value, str) else float(value) for key, value in values.items()}
    entry = Channel(**read)
    problems += [f"[{name}] {problem}" for problem in _values(name, entry)]
    return entry


def _values(name: str, entry: Channel) -> list[str]:
    """Problems of the values of an entry."""
    problems = []
    if entry.unit is not None:
        unit = UNITS.get(unit_spelled(entry.unit) or "")
        if unit is None or unit.si != QUANTITIES[name]:
            known = ", ".join(known_units(QUANTITIES[name]))
            problems.append(f"unit = '{entry.unit}': is not known here; use one of {known}.")
    if abs(entry.sign) != 1.0:
        problems.append(f"sign = {entry.sign:g}: must be 1 or -1; use factor for another scale.")
    if entry.factor == 0.0:
        problems.append("factor = 0: must not be 0.")
    if entry.longest is not None and entry.longest <= 0.0:
        problems.append(f"longest = {entry.longest:g} s: must be above 0 s.")
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
