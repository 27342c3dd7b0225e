"""What the groups of an opened MDF file become: rasters, where their channels stand, and what is left out."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from clutchid.io.columns import Heading, channel, shortened
from clutchid.io.formats.mdf.blocks import BUS_EVENT, VLSD
from clutchid.io.formats.mdf.numbers import Bits, bits_of, convertible
from clutchid.io.source import Raster

#: Name of the property in the header's comment that holds the metadata of a log.
KEY = "clutchid"

_BUS_CHANNEL = 1 << 10
_ALL_INVALID = 1
_TIME = 1
_LONGEST = 200


@dataclass(frozen=True, slots=True)
class Place:
    """Where a channel stands: its group, its number in it, and its bits."""

    group: int
    index: int
    bits: Bits


@dataclass(frozen=True, slots=True)
class Layout:
    """A raster and the places of its channels."""

    raster: Raster
    places: tuple[Place, ...]


def version_of(mdf: Any) -> int:
    """The generation of an MDF file, 3 (also for 2) or 4."""
    return 4 if str(mdf.version) >= "4" else 3


def layouts(mdf: Any) -> tuple[tuple[Layout, ...], tuple[str, ...]]:
    """The rasters of a file, and a sentence for each kind of thing that was left out."""
    out: Counter[str] = Counter()
    found = []
    for owner, groups in sorted(_families(mdf).items()):
        group = mdf.groups[owner].channel_group
        if version_of(mdf) == 4 and group.flags & VLSD:  # the texts of a channel in another group
            continue
        if not group.cycles_nr:
            out["empty"] += 1
            continue
        layout = _layout(mdf, owner, groups, out)
        if layout:
            found.append(layout)
    return tuple(found), tuple(_warnings(out))


def metadata_of(mdf: Any) -> dict[str, str]:
    """What the file says of itself; of a file that clutchid wrote exactly the metadata of its log."""
    root = _xml(_guarded(lambda: mdf.header.comment))
    own = root.find(f".//e[@name='{KEY}']") if root is not None else None
    if own is not None:
        try:
            values = json.loads(own.text or "")
        except json.JSONDecodeError:
            values = None
        if isinstance(values, dict):
            return {str(key): str(value) for key, value in values.items()}
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
    ET.SubElement(ET.SubElement(root, "common_properties"), "e", name=KEY).text = json.dumps(dict(metadata))
    return ET.tostring(root, encoding="unicode")


def _families(mdf: Any) -> dict[int, list[int]]:
    """Groups by the group whose stamps they use: MDF 4.2 may store each channel in a group of its own."""
    families: dict[int, list[int]] = {}
    for number, owner in mdf.virtual_groups_map.items():
        families.setdefault(owner, []).append(number)
    return families


def _layout(mdf: Any, owner: int, groups: list[int], out: Counter[str]) -> Layout | None:
    cycles = int(mdf.groups[owner].channel_group.cycles_nr)
    known = []
    for number in groups:
        if _follows(mdf, number, cycles):
            known += [(number, *entry) for entry in _channels(mdf, number, out)]
        else:
            out["apart"] += len(mdf.groups[number].channels)
    master = mdf.masters_db.get(owner)
    own = [entry for entry in known if (entry[0], entry[1]) != (owner, master)]
    if not own:
        frames = version_of(mdf) == 4 and mdf.groups[owner].channel_group.flags & BUS_EVENT
        out["frames" if frames else "bare"] += 1
        return None
    clock = next((i for i, entry in enumerate(known) if (entry[0], entry[1]) == (owner, master)), None)
    if clock is not None and not _is_time(mdf, known[clock][2]):
        clock = None
    headings = tuple(_heading(mdf, i, entry[2], i == clock) for i, entry in enumerate(known))
    raster = Raster(headings, cycles, _name(mdf.groups[owner].channel_group), clock)
    return Layout(raster, tuple(Place(number, index, bits) for number, index, _, bits in known))


def _channels(mdf: Any, number: int, out: Counter[str]) -> Iterator[tuple[int, Any, Bits]]:
    """Numbers, channels and bits of those channels of a group that are single numbers."""
    group, version = mdf.groups[number], version_of(mdf)
    for index, item in enumerate(group.channels):
        if version == 4 and item.flags & _BUS_CHANNEL:
            continue
        if group.channel_dependencies[index]:
            out["wide"] += 1
            continue
        if version == 4 and item.flags & _ALL_INVALID:
            out["invalid"] += 1
            continue
        bits = bits_of(item, version)
        if bits is None or not convertible(item.conversion, version):
            out["text"] += 1
        elif bits.end > group.channel_group.samples_byte_nr:
            out["outside"] += 1
        else:
            yield index, item, bits


def _follows(mdf: Any, number: int, cycles: int) -> bool:
    group = mdf.groups[number].channel_group
    return int(group.cycles_nr) == cycles and group.samples_byte_nr > 0


def _is_time(mdf: Any, master: Any) -> bool:
    return version_of(mdf) == 3 or master.sync_type in (0, _TIME)


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
        "wide": "{} of more than one number a sample (array, structure) {} left out.",
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
    if not text.lstrip().startswith("<"):
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
