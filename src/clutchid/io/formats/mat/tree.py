"""What is in a MATLAB file, whichever version wrote it: structs, cells and arrays, with numbers still in the file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from clutchid.log import FloatArray

#: Fields and cells up to which a file is looked through.
MOST_NODES = 100_000

#: Levels of structs in structs up to which a file is looked through.
DEEPEST = 32

#: Characters of a text that are read.
LONGEST_TEXT = 1 << 20

#: What deflate makes of a byte at most, so a file that claims more is damaged.
BEST_RATIO = 1032


class BrokenMat(ValueError):
    """The bytes are no whole MATLAB file; the text is a sentence for the user."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """An array of real numbers of this shape, as MATLAB tells it; `place` is where its reader finds it."""

    shape: tuple[int, ...]
    place: object = None

    @property
    def size(self) -> int:
        """Count of its numbers."""
        return math.prod(self.shape)

    @property
    def sides(self) -> tuple[int, ...]:
        """The dimensions that are longer than 1."""
        return tuple(length for length in self.shape if length > 1)

    @property
    def is_vector(self) -> bool:
        """Whether at most one dimension is longer than 1."""
        return self.size == 0 or len(self.sides) <= 1

    @property
    def is_wide(self) -> bool:
        """Whether it is a matrix whose rows are longer than its columns, so that each row is a channel."""
        return not self.is_vector and self.sides[0] < self.sides[1]

    @property
    def samples(self) -> int:
        """Samples of a channel: the length of a vector, of the columns of a tall matrix, of the rows of a wide one."""
        return self.size if self.is_vector else max(self.shape)

    @property
    def channels(self) -> int:
        """Channels side by side: 1 of a vector, else the shorter side of the matrix."""
        return 1 if self.is_vector else min(self.sides)


@dataclass(frozen=True, slots=True)
class Text:
    """A row of characters."""

    text: str


@dataclass(frozen=True, slots=True)
class Struct:
    """One struct, or the file itself: nodes by name."""

    fields: Mapping[str, Node]


@dataclass(frozen=True, slots=True)
class Items:
    """A struct array, or a cell array (`cell`): its nodes in MATLAB's order."""

    items: tuple[Node, ...]
    cell: bool = False


@dataclass(frozen=True, slots=True)
class Left:
    """Something that is no channel: `what` it is, in the plural; of an object the name of its class."""

    what: str
    class_name: str = ""


Node = Numbers | Text | Struct | Items | Left

#: Reads samples `start` to `stop` of channel `channel` of an array.
ReadSamples = Callable[[Numbers, int, int, int], FloatArray]

COMPLEX = Left("complex numbers")
SPARSE = Left("sparse matrices")
FUNCTION = Left("functions")
NO_NUMBERS = Left("arrays of an unknown kind")


def class_object(name: str) -> Left:
    """An object of a MATLAB class, which only MATLAB can read."""
    return {"function_handle": FUNCTION, "string": Left("texts")}.get(name) or Left("objects", name or "no class")


def counted(nodes: int) -> int:
    """`nodes`, once it is certain that they are not too many to look through.

    Raises
    ------
    BrokenMat
        If they are.
    """
    if nodes > MOST_NODES:
        raise BrokenMat(f"has more than {MOST_NODES:,} fields and cells; save the channels as plain vectors.")
    return nodes
