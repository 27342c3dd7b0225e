"""MATLAB files as trees of structs, cells and arrays; versions 4 to 7, loaded by SciPy."""

from __future__ import annotations

import math
import mmap
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.errors import MissingExtra
from clutchid.log import FloatArray
from clutchid.messages import shortened
from clutchid.names import printable
from clutchid.systems import forget

#: What deflate makes of a byte at most, so a file that claims more is damaged.
BEST_RATIO = 1032


class BrokenMat(ValueError):
    """The bytes are no whole MATLAB file; the text is a sentence for the user."""


@dataclass(frozen=True, eq=False, slots=True)
class NumberArray:
    """An array of real numbers of this shape, as in MATLAB, and its unit if the array itself has one.

    `place` is the loaded array, or where its reader finds it in the file. Of times that count from a date, `origin` is
    that date in ms since 1970.
    """

    shape: tuple[int, ...]
    place: object = None
    unit: str | None = None
    origin: float | None = None

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
class CharArray:
    """A row of characters."""

    text: str


@dataclass(frozen=True, slots=True)
class Struct:
    """One struct, or the file itself: nodes by name."""

    fields: Mapping[str, Node]


@dataclass(frozen=True, slots=True)
class NodeArray:
    """A struct array, or a cell array (`cell`): its nodes in MATLAB's order."""

    items: tuple[Node, ...]
    cell: bool = False


@dataclass(frozen=True, slots=True)
class NoChannel:
    """Something that is no channel: `what` it is, in the plural; of an object the name of its class."""

    what: str
    class_name: str = ""


Node = NumberArray | CharArray | Struct | NodeArray | NoChannel

#: Reads samples `start` to `stop` of channel `channel` of an array.
ReadSamples = Callable[[NumberArray, int, int, int], FloatArray]

COMPLEX = NoChannel("complex numbers")
SPARSE = NoChannel("sparse matrices")
FUNCTION = NoChannel("functions")
NO_NUMBERS = NoChannel("arrays of an unknown kind")


def class_object(name: str) -> NoChannel:
    """An object of a MATLAB class, which only MATLAB can read."""
    return {"function_handle": FUNCTION, "string": NoChannel("texts")}.get(name) or NoChannel(
        "objects", name or "no class"
    )


@contextmanager
def sound(form: str) -> Iterator[None]:
    """Errors of a library on damaged bytes of a file of the format `form`, as one sentence.

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


def node(value: Any, decoded: Callable[[Any], Node | None] = lambda _: None) -> Node:
    """Node of an array: numbers, a text, a struct, a list of structs or cells, or nothing that is a channel.

    `decoded` gives the node of an object that it knows, None of anything else.
    """
    if other := decoded(value) or _no_array(value):
        return other
    kind = value.dtype.kind
    if kind in "OV":  # column by column, as in MATLAB
        items, fields = list(value.ravel(order="F")), value.dtype.names or ()
        if kind == "O":
            return NodeArray(tuple(node(item, decoded) for item in items), cell=True)
        structs = [Struct({name: node(item[name], decoded) for name in fields}) for item in items]
        return structs[0] if len(structs) == 1 else NodeArray(tuple(structs))
    if kind in "fiub":
        return NumberArray(value.shape, value)
    if kind == "U":
        return CharArray(str(value.item()) if value.size == 1 else "")
    return COMPLEX if kind == "c" else NO_NUMBERS


def _no_array(value: Any) -> Node | None:
    from scipy.io.matlab import MatlabFunction, MatlabOpaque
    from scipy.sparse import issparse

    if value is None:  # a struct without fields
        return Struct({})
    if issparse(value):
        return SPARSE
    if isinstance(value, MatlabFunction):
        return FUNCTION
    if isinstance(value, MatlabOpaque):
        return class_object(_class_name(value))
    return None if isinstance(value, np.ndarray) else NO_NUMBERS


def samples(array: NDArray[Any], numbers: NumberArray, channel: int, start: int, stop: int) -> FloatArray:
    """Samples `start` to `stop` of a channel of an array."""
    if numbers.is_vector:
        part = array.ravel()[start:stop]
    else:
        sides = array.squeeze()
        part = sides[channel, start:stop] if numbers.is_wide else sides[start:stop, channel]
    return np.array(part, dtype=np.float64)


def _class_name(value: NDArray[Any]) -> str:
    """Name of the class of an object that SciPy does not decode; the field has this name from SciPy 1.18 on."""
    field = "_Class" if "_Class" in (value.dtype.names or ()) else "s2"
    name = value[field].ravel()[0] if value.size else b""
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)


#: Bytes of a variable, and of a file, up to which they are loaded, and bytes of a file that are kept in memory.
LARGEST = 1 << 30
KEPT = 1 << 28

#: Bytes of a variable of a large file that is kept on the disk.
_LARGE = 1 << 20

_ARRAYS = ("double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
_NAMELESS = "None"
_OWN = ("__header__", "__version__", "__globals__", "__function_workspace__")


@dataclass(frozen=True, eq=False, slots=True)
class _OnDisk:
    """The array of a variable in a temporary file, column by column."""

    pages: mmap.mmap
    dtype: np.dtype[Any]

    def samples(self, numbers: NumberArray, channel: int, start: int, stop: int) -> FloatArray:
        """See `samples`; the file leaves the memory again."""
        array: NDArray[Any] = np.ndarray(numbers.shape, self.dtype, self.pages, order="F")
        part = samples(array, numbers, channel, start, stop)
        forget(self.pages)
        return part


def contents(path: Path) -> Struct:
    """The variables of the file, by name; those of a large file are loaded one by one and kept on the disk.

    Raises
    ------
    BrokenMat
        If the bytes are not a whole file, or a variable is too large.
    OSError
        If it cannot be read.
    """
    sizes = _sizes(path)
    for name, size in sizes.items():
        _check_size(name, size, path.stat().st_size)
    large = sum(sizes.values()) > KEPT
    later = {name for name, size in sizes.items() if large and size > _LARGE}
    now = [name for name in sizes if name not in later] if sizes else None
    nodes = {name: node(value) for name, value in load(path, now).items()}
    nodes |= {name: _on_disk(node(load(path, [name])[name])) for name in later}
    return Struct({name: nodes[name] for name in dict.fromkeys((*sizes, *nodes)) if name in nodes})


@contextmanager
def opened(_path: Path) -> Iterator[ReadSamples]:
    """Function that reads samples of the loaded arrays."""

    def read(numbers: NumberArray, channel: int, start: int, stop: int) -> FloatArray:
        if isinstance(numbers.place, _OnDisk):
            return numbers.place.samples(numbers, channel, start, stop)
        return samples(np.asarray(numbers.place), numbers, channel, start, stop)

    yield read


def _check_size(name: str, size: int, stored: int) -> None:
    named = shortened(printable(name))
    if size > 8 * BEST_RATIO * stored:
        raise BrokenMat(f"is damaged: '{named}' claims {size:,} bytes of a file of {stored:,}; copy or save it again.")
    if size > LARGEST:
        raise BrokenMat(f"has {size / 1e9:.1f} GB in '{named}'; save it with '-v7.3', which is read piece by piece.")


def _on_disk(whole: Node) -> Node:
    """The node with its array in a temporary file, of which only what is read comes into memory."""
    if not isinstance(whole, NumberArray):
        return whole
    array = np.asarray(whole.place)
    with tempfile.TemporaryFile() as file:
        array.T.tofile(file)
        return NumberArray(whole.shape, _OnDisk(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), array.dtype))


def _sizes(path: Path) -> dict[str, int]:
    """Most bytes of each variable in memory, 0 if it is no array of numbers; empty where SciPy cannot say."""
    from scipy.io import whosmat

    with _quiet():
        try:
            listed = whosmat(str(path), appendmat=False)
        except TypeError:  # the shape of an object
            return {}
        sizes = {name: 8 * math.prod(shape or ()) if kind in _ARRAYS else 0 for name, shape, kind in listed}
    return {name: size for name, size in sizes.items() if name not in _OWN}


def load(path: Path, names: list[str] | None) -> dict[str, Any]:
    """These variables (None: all) of the file; empty text is what SciPy cannot read, letters of four bytes."""
    if names == []:
        return {}
    try:
        return _loaded(path, names)
    except BrokenMat as error:
        if not isinstance(error.__cause__, TypeError) or not names:
            raise
        return {names[0]: ""} if len(names) == 1 else {name: load(path, [name])[name] for name in names}


def _loaded(path: Path, names: list[str] | None) -> dict[str, Any]:
    from scipy.io.matlab import MatlabOpaque, loadmat

    with path.open("rb") as file:
        order = {b"IM": "utf-16-le", b"MI": "utf-16-be"}.get(file.read(128)[126:])
    codec: dict[str, Any] = {"uint16_codec": order} if order else {}
    with _quiet():
        variables = loadmat(str(path), appendmat=False, variable_names=names, **codec)
        if isinstance(variables.get(_NAMELESS), MatlabOpaque) and "s0" in variables[_NAMELESS].dtype.names:
            variables |= _objects(path)
            del variables[_NAMELESS]
    return {name: value for name, value in variables.items() if name not in _OWN}


def _objects(path: Path) -> dict[str, Any]:
    """The objects of the file, to all of which SciPy before 1.18 gives one name, by their own."""
    from scipy.io.matlab import loadmat, varmats_from_mat

    with path.open("rb") as file:
        parts: Iterable[tuple[str, Any]] = varmats_from_mat(file)
    objects = [loadmat(part)[_NAMELESS] for name, part in parts if name == _NAMELESS]
    return {bytes(value["s0"].item()).decode("utf-8", "replace"): value for value in objects}


@contextmanager
def _quiet() -> Iterator[None]:
    """Without SciPy's warnings, and its errors as one sentence."""
    with sound("MATLAB"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
