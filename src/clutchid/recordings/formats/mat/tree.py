"""What is in a MATLAB file, whichever version wrote it: structs, cells and arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from clutchid.errors import MissingExtra
from clutchid.log import FloatArray
from clutchid.recordings.columns import shortened

#: What deflate makes of a byte at most, so a file that claims more is damaged.
BEST_RATIO = 1032


class BrokenMat(ValueError):
    """The bytes are no whole MATLAB file; the text is a sentence for the user."""


@dataclass(frozen=True, eq=False, slots=True)
class Numbers:
    """An array of real numbers of this shape, as in MATLAB, and its unit if the array itself has one.

    `place` is the loaded array, or where its reader finds it in the file.
    """

    shape: tuple[int, ...]
    place: object = None
    unit: str | None = None

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


@contextmanager
def sound(form: str) -> Iterator[None]:
    """Whatever a library raises for damaged bytes of a file of the format `form`, as one sentence.

    Raises
    ------
    BrokenMat
        With the reason of the library.
    """
    try:
        yield
    except (BrokenMat, MissingExtra, MemoryError):
        raise
    except Exception as error:
        reason = shortened(str(error).strip("'\"") or type(error).__name__, 120)
        raise BrokenMat(f"is no whole {form} file ({reason}); copy or save it again.") from error
