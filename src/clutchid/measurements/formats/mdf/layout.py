"""Time grids of an opened MDF file: its channel groups, the places of their channels, and what is left out."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from clutchid.measurements.columns import Heading, channel, without_numbers
from clutchid.measurements.formats.mdf.numbers import convertible, has_formula
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

#: Types of data that are numbers, in MDF 4 and in MDF 3; types of channels of MDF 4 that hold one number a sample.
_NUMBERS_4, _NUMBERS_3 = frozenset(range(6)), frozenset({0, 1, 2, 3, *range(9, 17)})
_STORED, _COUNTED = (0, 2), (3, 6)
_NUMBER, _COUNT = "number", "count"
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
    others: list[tuple[str, str]] = []
    rasters = []
    for owner, groups in sorted(_families(mdf).items()):
        group = mdf.groups[owner].channel_group
        flags = group.flags if version_of(mdf) == 4 else 0
        if flags & _VLSD:  # the texts of a channel in another group
            continue
        layout = _layout(mdf, owner, groups) if group.cycles_nr else None
        if layout is None:
            out["without samples"] += 1
            continue
        others += layout.raster.others
        if len(layout.places) > (layout.raster.clock is not None):
            rasters.append(layout)
        else:  # nothing beside the stamps
            frames = "of raw bus frames; give their DBC with --dbc"
            out[frames if flags & _BUS_EVENT else "without a channel that is a number"] += 1
    warnings = [f"left out {count} group{'s' * (count > 1)} {what}." for what, count in out.items()]
    return tuple(rasters), (*warnings, *without_numbers(others))


def metadata_of(mdf: Any) -> dict[str, str]:
    """The start of the measurement; of a file that clutchid wrote exactly the metadata of its log."""
    with suppress(Exception):  # asammdf decodes a header only when it is asked for
        root = _xml(str(mdf.header.comment or ""))
        own = root.find(f".//e[@name='{_KEY}']") if root is not None else None
        if own is not None and (metadata := own_metadata(own.text)) is not None:
            return metadata
    with suppress(Exception):
        return {"start": mdf.header.start_time.isoformat()} if getattr(mdf.header, "abs_time", 1) else {}
    return {}


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


def _layout(mdf: Any, owner: int, groups: list[int]) -> GroupLayout:
    cycles, version = int(mdf.groups[owner].channel_group.cycles_nr), version_of(mdf)
    channels: list[tuple[ChannelPlace, Any]] = []
    others = []
    for number in groups:
        group = mdf.groups[number]
        apart = int(group.channel_group.cycles_nr) != cycles or not group.channel_group.samples_byte_nr
        for index, item in enumerate(group.channels):
            content = "no samples, or not one per time stamp" if apart else _content(group, index, version)
            if content in (_NUMBER, _COUNT):
                channels.append((ChannelPlace(number, index, content == _COUNT), item))
            elif content:
                others.append((str(item.name), content))
    master = owner, mdf.masters_db.get(owner)
    clock = next((i for i, (place, _) in enumerate(channels) if (place.group, place.index) == master), None)
    if clock is not None and version == 4 and channels[clock][1].sync_type not in (0, _TIME):
        clock = None
    headings = tuple(_heading(mdf, i, item, i == clock) for i, (_, item) in enumerate(channels))
    raster = Raster(headings, cycles, _name(mdf.groups[owner].channel_group), clock, tuple(others))
    return GroupLayout(raster, tuple(place for place, _ in channels))


def _content(group: Any, index: int, version: int) -> str:
    """Content of a channel: `_NUMBER`, `_COUNT`, or other things in words; empty for those of a bus."""
    item = group.channels[index]
    flags = item.flags if version == 4 else 0
    if flags & _BUS_CHANNEL:
        return ""
    if group.channel_dependencies[index]:
        return "several values per sample"
    if flags & _ALL_INVALID:
        return "no valid sample"
    if version == 4:
        texts, numbers, kind = _TEXTS_4, _NUMBERS_4, item.channel_type
        begin = 8 * item.byte_offset + item.bit_offset
    else:
        texts, numbers, kind = _TEXTS_3, _NUMBERS_3, 0
        begin = item.start_offset + 8 * getattr(item, "additional_byte_offset", 0)
    counted = kind in _COUNTED
    is_number = counted or (kind in _STORED and item.data_type in numbers and 0 < item.bit_count <= 64)
    if not (is_number and convertible(item.conversion, version)):
        with_formula = is_number and has_formula(item.conversion, version)
        others = "text" if is_number or item.data_type in texts else "bytes"
        return "raw values and a formula" if with_formula else others
    if counted:
        return _COUNT
    return _NUMBER if begin + item.bit_count <= 8 * group.channel_group.samples_byte_nr else "bytes beyond its record"


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


def _xml(text: str) -> ET.Element | None:
    """The root of an XML text; None if it is not XML or declares entities, which could expand to gigabytes."""
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
