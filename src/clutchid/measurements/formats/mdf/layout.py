"""Time grids of an opened MDF file: its channel groups, the places of their channels, and what is left out."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from clutchid.measurements.columns import Heading, channel
from clutchid.measurements.formats.mdf.numbers import convertible
from clutchid.measurements.formats.mdf.opening import version_of
from clutchid.measurements.source import Raster, own_metadata
from clutchid.messages import shortened

#: Name of the property in the header's comment that holds the metadata of a log.
_KEY = "clutchid"

#: Flags of a channel group: texts of a channel in another group; frames of a bus.
_VLSD, _BUS_EVENT = 1, 2

_BUS_CHANNEL = 1 << 10
_ALL_INVALID = 1
_TIME = 1
_LONGEST = 200

#: Types of data that are numbers, in MDF 4 and in MDF 3; types of channels of MDF 4 that hold one number a sample.
_NUMBERS_4, _NUMBERS_3 = frozenset(range(6)), frozenset({0, 1, 2, 3, *range(9, 17)})
_STORED, _COUNTED = (0, 2), (3, 6)
_TEXTS_4, _TEXTS_3 = range(6, 10), range(7, 8)


@dataclass(frozen=True, slots=True)
class ChannelPlace:
    """Place of a channel: its group, its number in it; `counted` if its value is the number of the sample."""

    group: int
    index: int
    counted: bool


@dataclass(frozen=True, slots=True)
class GroupLayout:
    """A raster and the places of its channels."""

    raster: Raster
    places: tuple[ChannelPlace, ...]


def layouts(mdf: Any) -> tuple[tuple[GroupLayout, ...], tuple[str, ...]]:
    """The rasters of a file, and a sentence for each kind of thing that was left out."""
    out: Counter[str] = Counter()
    rasters = []
    for owner, groups in sorted(_families(mdf).items()):
        group = mdf.groups[owner].channel_group
        if version_of(mdf) == 4 and group.flags & _VLSD:  # the texts of a channel in another group
            continue
        if not group.cycles_nr:
            out["empty"] += 1
            continue
        layout = _layout(mdf, owner, groups, out)
        if layout:
            rasters.append(layout)
    return tuple(rasters), tuple(_warnings(out))


def metadata_of(mdf: Any) -> dict[str, str]:
    """Metadata in the header of a file; of a file that clutchid wrote exactly the metadata of its log."""
    root = _xml(_guarded(lambda: mdf.header.comment))
    own = root.find(f".//e[@name='{_KEY}']") if root is not None else None
    if own is not None and (metadata := own_metadata(own.text)) is not None:
        return metadata
    start = _guarded(lambda: mdf.header.start_time.isoformat() if getattr(mdf.header, "abs_time", 1) else "")
    program = _guarded(lambda: mdf.identification.program_identification.decode("latin-1"))
    texts = {"start": start, "program": program.strip(" \0"), "comment": _text(root)}
    texts |= {name: _guarded(lambda name=name: getattr(mdf.header, name)) for name in ("author", "project", "subject")}
    return {name: text for name, text in texts.items() if text and len(text) <= _LONGEST}


def comment_of(metadata: Mapping[str, str]) -> str:
    """The comment of a header that `metadata_of` gives back as the same metadata.

    The text is JSON in ASCII, so neither blanks nor characters that XML forbids are lost.
    """
    root = ET.Element("HDcomment", xmlns="http://www.asam.net/mdf/v4")
    ET.SubElement(root, "TX")
    ET.SubElement(ET.SubElement(root, "common_properties"), "e", name=_KEY).text = json.dumps(dict(metadata))
    return ET.tostring(root, encoding="unicode")


def _families(mdf: Any) -> dict[int, list[int]]:
    """Groups by the group whose stamps they use: MDF 4.2 may store each channel in a group of its own."""
    families: dict[int, list[int]] = {}
    for number, owner in mdf.virtual_groups_map.items():
        families.setdefault(owner, []).append(number)
    return families


def _layout(mdf: Any, owner: int, groups: list[int], out: Counter[str]) -> GroupLayout | None:
    cycles = int(mdf.groups[owner].channel_group.cycles_nr)
    channels: list[tuple[ChannelPlace, Any]] = []
    others = []
    for number in groups:
        group = mdf.groups[number]
        if int(group.channel_group.cycles_nr) != cycles or not group.channel_group.samples_byte_nr:
            out["apart"] += len(group.channels)
            continue
        for index, item in enumerate(group.channels):
            content = _content(mdf, number, index)
            if content in ("number", "counted"):
                channels.append((ChannelPlace(number, index, content == "counted"), item))
            elif content:
                out[content if content in _OTHERS else "text"] += 1
                others.append((str(item.name), _OTHERS.get(content, content)))
    master = owner, mdf.masters_db.get(owner)
    clock = next((i for i, (place, _) in enumerate(channels) if (place.group, place.index) == master), None)
    if len(channels) == (clock is not None):  # nothing beside the stamps
        frames = version_of(mdf) == 4 and mdf.groups[owner].channel_group.flags & _BUS_EVENT
        out["frames" if frames else "bare"] += 1
        return None
    if clock is not None and version_of(mdf) == 4 and channels[clock][1].sync_type not in (0, _TIME):
        clock = None
    headings = tuple(_heading(mdf, i, item, i == clock) for i, (_, item) in enumerate(channels))
    raster = Raster(headings, cycles, _name(mdf.groups[owner].channel_group), clock, tuple(others))
    return GroupLayout(raster, tuple(place for place, _ in channels))


#: Kinds of channels that are left out besides texts, in words.
_OTHERS = {
    "array": "an array", "structure": "a structure", "invalid": "no valid sample",
    "outside": "bytes beyond the end of the record",
}  # fmt: skip


def _content(mdf: Any, number: int, index: int) -> str:
    """Samples of a channel: "number" or "counted", "text", "bytes" or one of `_OTHERS`; empty for those of a bus."""
    group, version = mdf.groups[number], version_of(mdf)
    item = group.channels[index]
    if version == 4 and item.flags & _BUS_CHANNEL:
        return ""
    if parts := group.channel_dependencies[index]:
        return "structure" if isinstance(parts, list) and isinstance(parts[0], tuple) else "array"
    if version == 4 and item.flags & _ALL_INVALID:
        return "invalid"
    return _number_content(item, version, 8 * group.channel_group.samples_byte_nr)


def _number_content(item: Any, version: int, bits: int) -> str:
    """Samples of a channel in a record of `bits` bits, see `_content`."""
    if version == 4 and item.channel_type in _COUNTED:
        return "counted" if convertible(item.conversion, version) else "text"
    if version == 4:
        texts, numbers, stored = _TEXTS_4, _NUMBERS_4, item.channel_type in _STORED
        begin = 8 * item.byte_offset + item.bit_offset
    else:
        texts, numbers, stored = _TEXTS_3, _NUMBERS_3, True
        begin = item.start_offset + 8 * getattr(item, "additional_byte_offset", 0)
    if item.data_type in texts:
        return "text"
    if not (stored and item.data_type in numbers and 0 < item.bit_count <= 64):
        return "bytes"
    if not convertible(item.conversion, version):
        return "text"
    return "outside" if begin + item.bit_count > bits else "number"


def _heading(mdf: Any, index: int, item: Any, clock: bool) -> Heading:
    unit = _plain((item.conversion and item.conversion.unit) or getattr(item, "unit", ""))
    comment = _plain(item.comment)
    if version_of(mdf) == 3:
        description = item.description.decode("latin-1").partition("\0")[0]
        comment = f"{comment} {description}"
    return channel(index, str(item.name), unit or ("s" if clock else None), comment.strip())


def _name(group: Any) -> str:
    source = getattr(group, "acq_source", None)
    names = (getattr(group, "acq_name", ""), source and source.name, source and source.path, group.comment)
    return next((shortened(str(name), 80) for name in names if name and not str(name).startswith("<")), "")


def _warnings(out: Counter[str]) -> Iterator[str]:
    texts = {
        "empty": "{} without samples {} left out.",
        "frames": "{} {} raw bus frames; give their DBC with --dbc.",
        "bare": "{} without a channel that is a number {} left out.",
        "text": "{} of texts, bytes or other things that are no numbers {} left out.",
        "array": "{} of more than one number a sample (array) {} left out.",
        "structure": "{} of more than one number a sample (structure) {} left out.",
        "apart": "{} without stored samples, or more or fewer than stamps, {} left out.",
        "invalid": "{} without a valid sample {} left out.",
        "outside": "{} beyond the end of the record {} left out.",
    }
    verbs = {"frames": ("holds", "hold")}
    for what, text in texts.items():
        if count := out[what]:
            noun = "group" if what in ("empty", "frames", "bare") else "channel"
            verb = verbs.get(what, ("is", "are"))[count > 1]
            yield text.format(f"{count} {noun}{'s' if count > 1 else ''}", verb)


def _xml(text: str) -> ET.Element | None:
    """The root of an XML text; None where it is none, or declares entities, which could unfold to gigabytes."""
    if not text.lstrip().startswith("<") or "<!" in text:
        return None
    try:
        return ET.fromstring(text.strip("\0 \n").replace(' xmlns="http://www.asam.net/mdf/v4"', ""))
    except (ET.ParseError, ValueError):
        return None


def _plain(text: Any) -> str:
    """A text that may stand in XML."""
    root = _xml(str(text or ""))
    return str(text or "") if root is None else _text(root)


def _text(root: ET.Element | None) -> str:
    element = root if root is None or root.tag == "TX" else root.find(".//TX")
    return " ".join((element.text or "").split()) if element is not None else ""


def _guarded(read: Any) -> str:
    """A text that asammdf makes of bytes of the file; empty where it cannot."""
    try:
        return str(read() or "")
    except Exception:
        return ""
