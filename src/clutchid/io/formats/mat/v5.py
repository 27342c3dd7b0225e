"""MATLAB 5 to 7 files: each variable a tree of tags with data behind them."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from clutchid.io.formats.mat.bytes import MATRIX, Cut, Element, byte_order, bytes_of, elements
from clutchid.io.formats.mat.tree import (
    COMPLEX,
    DEEPEST,
    FUNCTION,
    LONGEST_TEXT,
    NO_NUMBERS,
    SPARSE,
    BrokenMat,
    Items,
    Node,
    Numbers,
    ReadSamples,
    Struct,
    Text,
    class_object,
    counted,
)
from clutchid.log import FloatArray

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CODECS = {1: "utf-8", 2: "utf-8", 16: "utf-8", 4: "utf-16", 17: "utf-16", 18: "utf-32"}
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_NUMERIC = range(6, 16)
_IS_COMPLEX = 0x0800
_MOST_WORDS = 64


@dataclass(frozen=True, slots=True)
class Place:
    """Where an array stands: the offset in the bytes of its variable, and the type of its numbers."""

    element: Element
    offset: int
    dtype: str


@dataclass(frozen=True, slots=True)
class _Tag:
    kind: int
    start: int
    size: int
    end: int


@dataclass(slots=True)
class _Walk:
    """The bytes of a variable while they are looked through, and how many nodes the file had so far."""

    element: Element
    cut: Cut
    order: str
    nodes: int


def contents(path: Path) -> Struct:
    """The variables of the file, by name.

    Raises
    ------
    BrokenMat
        If the bytes are not a whole file, or would take more than `LARGEST` bytes inflated.
    OSError
        If it cannot be read.
    """
    fields: dict[str, Node] = {}
    nodes = 0
    with path.open("rb") as file:
        order = byte_order(file)
        for element in elements(file, order):
            name, node, nodes = _variable(file, element, order, nodes)
            if name:  # without a name stand the insides of MATLAB's objects
                fields[name] = node
    return Struct(fields)


def _variable(file: BinaryIO, element: Element, order: str, nodes: int) -> tuple[str, Node, int]:
    """Name and node of a variable, and the count of nodes up to it; its bytes are forgotten again."""
    walk = _Walk(element, bytes_of(file, element), order, nodes)
    name, node = _matrix(walk, 0, element.inflated or element.size, 0)
    return name, node, walk.nodes


@contextmanager
def opened(path: Path) -> Iterator[ReadSamples]:
    """The file, open for reading samples; compressed variables are kept inflated as long.

    Raises
    ------
    BrokenMat
        If the bytes are not a whole file.
    OSError
        If it cannot be read.
    """
    with path.open("rb") as file:
        order = byte_order(file)
        cuts: dict[Element, Cut] = {}

        def read(numbers: Numbers, channel: int, start: int, stop: int) -> FloatArray:
            place = numbers.place
            if not isinstance(place, Place):  # an empty array
                return np.empty(0)
            if place.element not in cuts:
                cuts[place.element] = bytes_of(file, place.element)
            return samples(
                cuts[place.element], np.dtype(order + place.dtype), place.offset, numbers, (channel, start, stop)
            )

        yield read


def samples(
    cut: Cut, dtype: np.dtype[np.generic], offset: int, numbers: Numbers, part: tuple[int, int, int]
) -> FloatArray:
    """Samples of a channel of an array that is stored column by column from `offset` on.

    `part` is the channel, the first sample and the one behind the last.

    Raises
    ------
    BrokenMat
        If the file ends before.
    """
    channel, start, stop = part
    wide = numbers.is_wide
    stride = numbers.channels if wide else 1
    first = start * stride if wide else channel * numbers.samples + start
    size = (stop - start) * stride * dtype.itemsize
    data = cut(offset + first * dtype.itemsize, size)
    if len(data) < size:
        raise BrokenMat("is cut off; copy it again.")
    values = np.frombuffer(data, dtype)
    return (values[channel::stride] if wide else values).astype(np.float64)


def _tag(walk: _Walk, at: int, end: int) -> _Tag:
    """The tag at `at`: of what kind the data behind it are, and where they stand."""
    head = walk.cut(at, 8) if at + 8 <= end else b""
    if len(head) < 8:
        raise _damaged(walk)
    kind, size = struct.unpack(walk.order + "II", head)
    if kind >> 16:  # up to 4 bytes stand in the tag itself
        kind, size, start, after = kind & 0xFFFF, kind >> 16, at + 4, at + 8
    else:
        start, after = at + 8, at + 8 + -(-size // 8) * 8
    if start + size > end or (start == at + 4 and size > 4):
        raise _damaged(walk)
    return _Tag(kind, start, size, min(after, end))


def _damaged(walk: _Walk) -> BrokenMat:
    return BrokenMat(
        f"is damaged: the variable at byte {walk.element.start:,} cannot be understood; copy or save it again."
    )


def _words(walk: _Walk, tag: _Tag) -> tuple[int, ...]:
    """The 4-byte integers behind a tag."""
    data = walk.cut(tag.start, min(tag.size, _MOST_WORDS * 4))
    return struct.unpack_from(f"{walk.order}{len(data) // 4}i", data)


def _name(walk: _Walk, tag: _Tag) -> str:
    return bytes(walk.cut(tag.start, min(tag.size, 256))).partition(b"\0")[0].decode("utf-8", "replace")


def _matrix(walk: _Walk, at: int, end: int, depth: int) -> tuple[str, Node]:
    """The name and the node of the array whose tag stands at `at`."""
    tag = _tag(walk, at, end)
    walk.nodes = counted(walk.nodes + 1)
    if tag.kind != MATRIX or depth > DEEPEST:
        raise _damaged(walk)
    if tag.size == 0:
        return "", Numbers((0, 0))
    end = tag.start + tag.size
    flags = _tag(walk, tag.start, end)
    word = (*_words(walk, flags), 0)[0]
    kind = word & 0xFF
    if kind == _OPAQUE:  # an object, which has no dimensions
        name = _tag(walk, flags.end, end)
        system = _tag(walk, name.end, end)
        return _name(walk, name), class_object(_name(walk, _tag(walk, system.end, end)))
    sides = _tag(walk, flags.end, end)
    shape = _words(walk, sides)
    name = _tag(walk, sides.end, end)
    if len(shape) < 2 or min(shape) < 0:
        raise _damaged(walk)
    return _name(walk, name), _node(walk, word, shape, (name.end, end, depth))


def _node(walk: _Walk, word: int, shape: tuple[int, ...], span: tuple[int, int, int]) -> Node:
    """What follows the name of an array; `span` is where that stands, and how deep in structs."""
    at, end, _ = span
    kind, count = word & 0xFF, math.prod(shape)
    if kind in _NUMERIC:
        return COMPLEX if word & _IS_COMPLEX else _numbers(walk, shape, _tag(walk, at, end))
    if kind == _CHAR:
        return _text(walk, shape, _tag(walk, at, end))
    if kind == _CELL:
        return Items(tuple(_children(walk, count, at, span)), cell=True)
    if kind in (_STRUCT, _OBJECT):  # an object of the time before MATLAB 7.6: the name of its class, then a struct
        return _struct(walk, count, at if kind == _STRUCT else _tag(walk, at, end).end, span)
    return {_SPARSE: SPARSE, _FUNCTION: FUNCTION}.get(kind, NO_NUMBERS)


def _numbers(walk: _Walk, shape: tuple[int, ...], tag: _Tag) -> Numbers:
    dtype = _TYPES.get(tag.kind, "")
    if tag.size == math.prod(shape) == 0:
        return Numbers(shape)
    if not dtype or math.prod(shape) * np.dtype(dtype).itemsize != tag.size:
        raise _damaged(walk)
    return Numbers(shape, Place(walk.element, tag.start, dtype))


def _text(walk: _Walk, shape: tuple[int, ...], tag: _Tag) -> Node:
    if len(shape) > 2 or shape[0] > 1 or not 0 < tag.size <= LONGEST_TEXT:
        return Text("")
    if tag.kind not in _CODECS:
        raise _damaged(walk)
    codec = _CODECS[tag.kind]
    ends = {"<": "-le", ">": "-be"}[walk.order] if codec != "utf-8" else ""
    return Text(bytes(walk.cut(tag.start, tag.size)).decode(codec + ends, "replace"))


def _struct(walk: _Walk, count: int, at: int, span: tuple[int, int, int]) -> Node:
    """A struct or a struct array: the length of the names of its fields, the names, and then field by field."""
    _, end, _ = span
    each = _tag(walk, at, end)
    (length, *_) = (*_words(walk, each), 0)
    tag = _tag(walk, each.end, end)
    if length <= 0 or tag.size % length or tag.size // length > (end - tag.start) // 8 + 1:
        raise _damaged(walk)
    text = bytes(walk.cut(tag.start, tag.size))
    names = [text[i : i + length].partition(b"\0")[0].decode("utf-8", "replace") for i in range(0, tag.size, length)]
    if count > 1 and not names:
        raise _damaged(walk)
    nodes = iter(_children(walk, count * len(names), tag.end, span))
    structs = tuple(Struct({name: next(nodes) for name in names}) for _ in range(count))
    return structs[0] if count == 1 else Items(structs)


def _children(walk: _Walk, count: int, at: int, span: tuple[int, int, int]) -> list[Node]:
    """`count` arrays that stand one after the other, as fields and cells do."""
    _, end, depth = span
    if count * 8 > end - at:
        raise _damaged(walk)
    counted(walk.nodes + count)
    nodes = []
    for _ in range(count):
        nodes.append(_matrix(walk, at, end, depth + 1)[1])
        at = _tag(walk, at, end).end
    return nodes
