"""MATLAB 7.3 files, which are HDF5: read through h5py, block by block.

Nothing is followed that leads out of the file, and a dataset that claims more than the file can hold is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from clutchid.errors import missing
from clutchid.log import FloatArray
from clutchid.measurements.formats.mat import loaded

if TYPE_CHECKING:
    import h5py

#: An object of the time before MATLAB 7.6, which is a struct.
_OLD_OBJECT = "2"

#: Bytes of one chunk of a dataset, which is inflated anew for every block that is read.
_LARGEST_CHUNK = 1 << 28

_FORMAT = "MATLAB 7.3 (HDF5)"
_EMPTY = loaded.NumberArray((0, 0))
_ELSEWHERE = loaded.NoChannel("arrays whose numbers are not in the file")
_ONE_PIECE = loaded.NoChannel(f"arrays in compressed pieces of more than {_LARGEST_CHUNK >> 20} MB")


@dataclass(slots=True)
class _OpenFile:
    """The library, the open file while it is looked through, its size in bytes, and the groups so far."""

    h5: Any
    file: h5py.File
    size: int
    groups: set[int] = field(default_factory=set)


def contents(path: Path) -> loaded.Struct:
    """The variables of the file, by name.

    Raises
    ------
    BrokenMat
        If it is no sound HDF5 file.
    MissingExtra
        If h5py is not installed.
    """
    with _file(path) as walk, loaded.sound(_FORMAT):
        names = [name for name in walk.file if not name.startswith("#")]
        return loaded.Struct({name: _member(walk, walk.file, name) for name in names})


@contextmanager
def opened(path: Path) -> Iterator[loaded.ReadSamples]:
    """The file, open for reading samples; no more than these are in memory.

    Raises
    ------
    BrokenMat
        If it is no sound HDF5 file.
    MissingExtra
        If h5py is not installed.
    """
    with _file(path) as walk:

        def read(numbers: loaded.NumberArray, channel: int, start: int, stop: int) -> FloatArray:
            if start == stop:
                return np.empty(0)
            if isinstance(numbers.place, np.ndarray):
                return loaded.samples(numbers.place, numbers, channel, start, stop)
            with loaded.sound(_FORMAT):
                long, short = slice(start, stop), channel
                order = (short, long) if numbers.is_wide else (long, short)
                sides = iter(order if not numbers.is_vector else (long,))
                index = tuple(next(sides) if side > 1 else 0 for side in numbers.shape)
                if numbers.size == 1:
                    index = (*index[:-1], slice(0, 1))
                values = walk.file[str(numbers.place)][index[::-1]]
                return np.asarray(values, dtype=np.float64)

        yield read


@contextmanager
def _file(path: Path) -> Iterator[_OpenFile]:
    try:
        h5 = import_module("h5py")
    except ImportError as error:
        raise missing("reading MATLAB 7.3 files (those saved with '-v7' do without)", "h5py", "mat") from error
    with loaded.sound(_FORMAT):
        file = h5.File(path, "r")
    try:
        yield _OpenFile(h5, file, path.stat().st_size)
    finally:
        with loaded.sound(_FORMAT):
            file.close()


def _member(walk: _OpenFile, group: h5py.Group, name: str) -> loaded.Node:
    """The node of a member of a group; links out of the group are not followed."""
    if not isinstance(group.get(name, getlink=True), walk.h5.HardLink):
        return _ELSEWHERE
    return _node(walk, group[name])


def _node(walk: _OpenFile, item: Any) -> loaded.Node:
    if not isinstance(item, walk.h5.Group | walk.h5.Dataset):
        return loaded.NO_NUMBERS
    class_name = _attribute(item, "MATLAB_class")
    if isinstance(item, walk.h5.Group):
        return _group(walk, item, class_name)
    if "MATLAB_object_decode" in item.attrs:
        return loaded.class_object(class_name)
    if _attribute(item, "MATLAB_empty") not in ("", "0") or not item.shape or not math.prod(item.shape):
        if class_name == "char":
            return loaded.CharArray("")
        return loaded.NodeArray(()) if class_name in ("cell", "struct") else _EMPTY
    return _dataset(walk, item, class_name)


def _attribute(item: Any, name: str) -> str:
    """An attribute as text; empty where there is none."""
    value = item.attrs.get(name, "")
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _group(walk: _OpenFile, group: h5py.Group, class_name: str) -> loaded.Node:
    """A struct or a struct array, whose fields are references to the values of each."""
    address = hash(group.id)
    if address in walk.groups:
        return loaded.NO_NUMBERS
    walk.groups.add(address)
    if "MATLAB_sparse" in group.attrs:
        return loaded.SPARSE
    if class_name == "function_handle" or _attribute(group, "MATLAB_object_decode") not in ("", _OLD_OBJECT):
        return loaded.class_object(class_name)
    columns = {name: _references(walk, group, name) for name in group}
    arrays = [column for column in columns.values() if column is not None]
    if not arrays or len(arrays) < len(columns) or len({len(column) for column in arrays}) > 1:
        return loaded.Struct({name: _member(walk, group, name) for name in columns})
    rows = zip(*arrays, strict=True)
    return loaded.NodeArray(
        tuple(
            loaded.Struct({name: _pointed(walk, reference) for name, reference in zip(columns, row, strict=True)})
            for row in rows
        )
    )


def _references(walk: _OpenFile, group: h5py.Group, name: str) -> list[Any] | None:
    """The references of a field of a struct array; None where it is the field of a single struct."""
    if not isinstance(group.get(name, getlink=True), walk.h5.HardLink):
        return None
    data = group[name]
    if not isinstance(data, walk.h5.Dataset) or data.dtype != walk.h5.ref_dtype or "MATLAB_class" in data.attrs:
        return None
    return _all_of(walk, data)


def _all_of(walk: _OpenFile, references: h5py.Dataset) -> list[Any]:
    if references.size is None or not _is_there(walk, references):
        raise loaded.BrokenMat("is damaged: a list of references is longer than the file; copy or save it again.")
    return list(np.asarray(references[()]).ravel())


def _pointed(walk: _OpenFile, reference: Any) -> loaded.Node:
    """Node that a reference points to."""
    return _node(walk, walk.file[reference]) if reference else _EMPTY


def _dataset(walk: _OpenFile, data: h5py.Dataset, class_name: str) -> loaded.Node:
    if data.is_virtual or data.external or not _is_there(walk, data):
        return _ELSEWHERE
    if math.prod(data.chunks or ()) * data.dtype.itemsize > _LARGEST_CHUNK:
        return _ONE_PIECE
    if data.dtype == walk.h5.ref_dtype:
        return loaded.NodeArray(tuple(_pointed(walk, reference) for reference in _all_of(walk, data)), cell=True)
    if class_name == "char":
        return loaded.CharArray(_characters(data))
    if data.dtype.names == ("real", "imag"):
        return loaded.COMPLEX
    return loaded.NumberArray(data.shape[::-1], data.name) if data.dtype.kind in "fiub" else loaded.NO_NUMBERS


def _characters(data: h5py.Dataset) -> str:
    """A row of UTF-16 characters; several rows are no text that says something of a channel."""
    if len([side for side in data.shape if side > 1]) > 1 or data.dtype.kind != "u":
        return ""
    return np.asarray(data[()]).ravel().astype("<u2").tobytes().decode("utf-16-le", "replace")


def _is_there(walk: _OpenFile, data: h5py.Dataset) -> bool:
    """Whether the file has bytes enough for the dataset, however well they are compressed."""
    stored = min(data.id.get_storage_size(), walk.size)
    return bool(math.prod(data.shape) * data.dtype.itemsize <= stored * (loaded.BEST_RATIO if data.chunks else 1))
