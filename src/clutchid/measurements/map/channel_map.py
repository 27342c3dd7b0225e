"""`ChannelMap`: assignment of the channels of any file to quantities, as a TOML file that users can edit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any

from clutchid.errors import DataError, ParameterError
from clutchid.files import write_text
from clutchid.files.records import Rule, collected, read_record, read_toml
from clutchid.log import HOLE
from clutchid.log.units import known_units
from clutchid.measurements.columns import QUANTITIES, Heading, is_unit_of, unit_spelled
from clutchid.names import unknown_name

#: Longest delay of a channel in s: filters and buses of vehicles have tens of milliseconds. A generous guess.
_LONGEST_DELAY = 0.5

#: Entries above the first table of a map; requirements on them, and on the entries of a channel.
_TOP: Mapping[str, Any] = MappingProxyType({"dbc": list[str], "raster": float, "rate": float})
_TOP_RULES = MappingProxyType(
    {
        "dbc": Rule("a list of file names is needed"),
        "raster": Rule("an interval above 0 in s is needed, for example 0.001", lambda s: 0.0 < s < math.inf),
        "rate": Rule("samples per second above 0 are needed, for example 1000.0", lambda rate: 0.0 < rate < math.inf),
    }
)
_RULES = MappingProxyType(
    {
        "channel": Rule("a string is needed, channel = 'NAME' as listed by `clutchid look`"),
        "group": Rule("a string is needed"),
        "sign": Rule("must be 1 or -1; use factor for another scale", lambda sign: abs(sign) == 1.0),
        "factor": Rule("must be finite and not 0", lambda factor: factor != 0.0 and math.isfinite(factor)),
        "offset": Rule("a finite number is needed", math.isfinite),
        "delay": Rule(
            f"a delay of at most {_LONGEST_DELAY:g} s is needed, in s: 0.008 for 8 ms",
            lambda delay: abs(delay) <= _LONGEST_DELAY,
        ),
        "longest": Rule("must be above 0 s", lambda time: 0.0 < time < math.inf),
    }
)


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a file: the quantity is ``sign * factor * sample + offset`` in `unit`.

    Parameters
    ----------
    channel, group
        Name in the file, and its group there if the name is not unique.
    unit
        Overrides that of the file.
    sign, factor : 1
        -1 or 1, and a scale.
    offset : unit
        Added after the scale.
    delay : s
        By which the quantity is older than its stamp.
    longest : s
        Time for which a sample remains valid, as of a duty cycle that is only sent when it changes; by default five
        usual intervals of the channel.
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
    """The channel of each quantity, and how its file is read.

    Parameters
    ----------
    channels
        By quantity, such as position.
    dbc
        DBC files that decode a bus log.
    raster : s
        Interval of the common time grid; without it, that of the channel with the highest rate.
    rate : Hz
        Of a file without time: the time is sample / rate.
    comment
        On the file as a whole; it is written but not read.
    """

    channels: Mapping[str, Channel]
    dbc: tuple[Path, ...] = ()
    raster: float | None = None
    rate: float | None = None
    comment: str = ""


#: Index of a time that is counted, sample / rate, not read.
COUNTED = -1


@dataclass(frozen=True, slots=True)
class PickedChannels:
    """Channels on one time grid: heading and map entry by quantity, including `time` unless that is a problem.

    `delay` in s is the common delay of the channels after their time stamps; with a `rate` in Hz the time is sample /
    rate. `notes` are assumptions that the user has to know. Of `sparse` channels a row
    that holds none is no sample.
    """

    raster: int
    columns: Mapping[str, tuple[Heading, Channel]]
    delay: float = 0.0
    rate: float | None = None
    notes: tuple[str, ...] = ()
    sparse: bool = False

    @property
    def indices(self) -> list[int]:
        """The channels that are read, by their index in the time grid."""
        return [heading.index for heading, _ in self.columns.values() if heading.index != COUNTED]

    @property
    def on_change(self) -> bool:
        """Whether all channels are recorded only where they change, so that they have no interval and no holes."""
        return self.sparse and all(
            entry.longest == math.inf for name, (_, entry) in self.columns.items() if name != "time"
        )

    def longest(self, usual: float) -> dict[str, float]:
        """Time in s for which a sample remains valid, by quantity, at a `usual` interval of the channels in s."""
        entries = {name: entry for name, (_, entry) in self.columns.items() if name != "time"}
        return {name: HOLE * usual if channel.longest is None else channel.longest for name, channel in entries.items()}


def read_map(path: str | PathLike[str]) -> ChannelMap:
    """Read a channel map from a TOML file; paths of DBC files in it are relative to it.

    Raises
    ------
    DataError
        If there is no such file.
    ParameterError
        If it is not a channel map; the text lists all problems.
    """
    content = read_toml(path, "channel map")
    if isinstance(content.get("dbc"), str):
        content["dbc"] = [content["dbc"]]
    problems = list[str]()
    channels = {
        name: entry
        for name, values in content.items()
        if name not in _TOP and (entry := _channel(name, values, problems)) is not None
    }
    top = {
        key: collected(problems, read_record, kind, content[key], key, _TOP_RULES)
        for key, kind in _TOP.items()
        if key in content
    }
    if not problems and not channels:
        problems.append("contains no channel; write for example [position] with channel = 'NAME'.")
    dbc = tuple(Path(path).parent / name for name in top.get("dbc") or ())
    channel_map = ChannelMap(channels, dbc, top.get("raster"), top.get("rate"))
    problems += contradictions(channel_map)
    if problems:
        raise ParameterError(str(DataError.of(str(path), problems)))
    return channel_map


def contradictions(content: ChannelMap) -> list[str]:
    """Problems of a map whose entries exclude each other."""
    if content.rate is None or "time" not in content.channels:
        return []
    return [f"rate = {content.rate:g} Hz and [time] both define the time; keep one of them."]


def write_map(content: ChannelMap, path: str | PathLike[str]) -> None:
    """Write a channel map for `read_map`; default values are omitted.

    Raises
    ------
    ExportError
        If the file cannot be written; an existing file is then unchanged.
    """
    write_text(map_text(content, Path(path).parent), path)


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
    top |= {key: value for key in ("raster", "rate") if (value := getattr(content, key)) is not None}
    parts = [
        "# Channel map of clutchid: quantity = sign * factor * sample + offset in the unit, taken at stamp - delay.",
        tomli_w.dumps(top).rstrip(),
    ]
    for name, entry in content.channels.items():
        values = {
            item.name: getattr(entry, item.name)
            for item in fields(entry)
            if getattr(entry, item.name) not in (None, item.default)
        }
        parts.append(tomli_w.dumps({name: values}).rstrip())
    parts.append("\n".join(f"# {line}" for line in content.comment.splitlines()))
    return "\n\n".join(part for part in parts if part) + "\n"


def _channel(name: str, values: Any, problems: list[str]) -> Channel | None:
    """The entry of one quantity; its problems are appended to `problems`."""
    if name not in QUANTITIES:
        problems.append(unknown_name(name, (*QUANTITIES, *_TOP), "quantity"))
        return None
    if not isinstance(values, dict):
        problems.append(f"[{name}]: write a table, for example [{name}] with channel = 'NAME' below it.")
        return None
    units = ", ".join(known_units(QUANTITIES[name]))
    unit = Rule(f"is not known here; use one of {units}", lambda text: is_unit_of(name, unit_spelled(text)))
    return collected(problems, read_record, Channel, values, f"[{name}]", {**_RULES, "unit": unit})


def _relative(file: Path, folder: Path) -> str:
    try:
        return file.resolve().relative_to(folder.resolve()).as_posix()
    except ValueError:
        return str(file.resolve())
