"""MATLAB 4 to 7 files, loaded by SciPy."""

from __future__ import annotations

import math
import mmap
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.names import printable
from clutchid.recordings.columns import shortened
from clutchid.recordings.formats.mat.arrays import node, samples
from clutchid.recordings.formats.mat.tree import BEST_RATIO, BrokenMat, Node, Numbers, ReadSamples, Struct, sound

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

    def samples(self, numbers: Numbers, channel: int, start: int, stop: int) -> FloatArray:
        """See `samples`; the file leaves the memory again."""
        array: NDArray[Any] = np.ndarray(numbers.shape, self.dtype, self.pages, order="F")
        found = samples(array, numbers, channel, start, stop)
        if hasattr(mmap, "MADV_DONTNEED"):
            self.pages.madvise(mmap.MADV_DONTNEED)
        return found


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
    found = {name: node(value) for name, value in _load(path, now).items()}
    found |= {name: _on_disk(node(_load(path, [name])[name])) for name in later}
    return Struct({name: found[name] for name in dict.fromkeys((*sizes, *found)) if name in found})


@contextmanager
def opened(_path: Path) -> Iterator[ReadSamples]:
    """Function that reads samples of the loaded arrays."""

    def read(numbers: Numbers, channel: int, start: int, stop: int) -> FloatArray:
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
    if not isinstance(whole, Numbers):
        return whole
    array = np.asarray(whole.place)
    with tempfile.TemporaryFile() as file:
        array.T.tofile(file)
        return Numbers(whole.shape, _OnDisk(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), array.dtype))


def _sizes(path: Path) -> dict[str, int]:
    """Bytes of each variable in memory at most, 0 of what is no array of numbers; empty where SciPy cannot say."""
    from scipy.io import whosmat

    with _quiet():
        try:
            listed = whosmat(str(path), appendmat=False)
        except TypeError:  # the shape of an object
            return {}
        sizes = {name: 8 * math.prod(shape or ()) if kind in _ARRAYS else 0 for name, shape, kind in listed}
    return {name: size for name, size in sizes.items() if name not in _OWN}


def _load(path: Path, names: list[str] | None) -> dict[str, Any]:
    """These variables (None: all) of the file; empty text is what SciPy cannot read, letters of four bytes."""
    if names == []:
        return {}
    try:
        return _loaded(path, names)
    except BrokenMat as error:
        if not isinstance(error.__cause__, TypeError) or not names:
            raise
        return {names[0]: ""} if len(names) == 1 else {name: _load(path, [name])[name] for name in names}


def _loaded(path: Path, names: list[str] | None) -> dict[str, Any]:
    from scipy.io.matlab import MatlabOpaque, loadmat

    with path.open("rb") as file:
        order = {b"IM": "utf-16-le", b"MI": "utf-16-be"}.get(file.read(128)[126:])
    codec: dict[str, Any] = {"uint16_codec": order} if order else {}
    with _quiet():
        found = loadmat(str(path), appendmat=False, variable_names=names, **codec)
        if isinstance(found.get(_NAMELESS), MatlabOpaque) and "s0" in found[_NAMELESS].dtype.names:
            found |= _objects(path)
            del found[_NAMELESS]
    return {name: value for name, value in found.items() if name not in _OWN}


def _objects(path: Path) -> dict[str, Any]:
    """The objects of the file, to all of which SciPy before 1.18 gives one name, by their own."""
    from scipy.io.matlab import loadmat, varmats_from_mat

    with path.open("rb") as file:
        parts: Iterable[tuple[str, Any]] = varmats_from_mat(file)
    found = [loadmat(part)[_NAMELESS] for name, part in parts if name == _NAMELESS]
    return {bytes(value["s0"].item()).decode("utf-8", "replace"): value for value in found}


@contextmanager
def _quiet() -> Iterator[None]:
    """Without SciPy's warnings, and its errors as one sentence."""
    with sound("MATLAB"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
