"""The contents of a MATLAB file as a flat list: arrays of numbers and texts, each with its path.

Versions 4 to 7 are loaded by SciPy; of 7.3 files, which are HDF5, h5py reads only what is asked for. Nothing is
followed that leads out of the file, and a dataset that claims more than the file can hold is left out.
"""

from __future__ import annotations

import warnings
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from clutchid.errors import MissingExtra, missing
from clutchid.log import FloatArray
from clutchid.measurements.formats.mat.objects import object_content, objects_in
from clutchid.messages import shortened

#: Names from the variable to the item; an element of a struct array is ``(2)``, of a cell ``{2}``.
ItemPath: TypeAlias = tuple[str, ...]

#: An object of the time before MATLAB 7.6, which is a struct.
_OLD_OBJECT = "2"

#: What deflate makes of a byte at most, so a dataset that claims more is damaged.
_BEST_RATIO = 1032

_HDF5 = "MATLAB 7.3 (HDF5)"
_ELSEWHERE = "arrays whose numbers are not in the file"
_OTHERS = "objects that hold no real numbers"


class BrokenMat(ValueError):
    """The bytes are no whole MATLAB file; the text is a sentence for the user."""


@dataclass(frozen=True, eq=False, slots=True)
class ArrayChannel:
    """An array of real numbers of this shape, as in MATLAB, and the channel of it: a matrix has one a column (or row).

    `place` is the loaded array, or the name of the dataset in the file; `label` how texts call it instead, `serves` the
    struct whose time it is if its name means time.
    """

    path: ItemPath
    shape: tuple[int, ...]
    place: Any
    unit: str | None = None
    column: int = 0
    label: str = ""
    comment: str = ""
    serves: ItemPath | None = None

    @property
    def sides(self) -> tuple[int, ...]:
        """The dimensions longer than 1; a vector has one of them, also a shorter one."""
        return (0,) if 0 in self.shape else tuple(side for side in self.shape if side > 1) or (1,)

    @property
    def size(self) -> int:
        """Count of its samples: the longer side of a matrix."""
        return max(self.sides)

    @property
    def mark(self) -> str:
        """Column or row as MATLAB selects it; empty of a vector."""
        if len(self.sides) == 1:
            return ""
        return f"({self.column + 1},:)" if self.sides[0] < self.sides[1] else f"(:,{self.column + 1})"

    def samples(self, file: Mapping[str, Any], start: int, stop: int) -> FloatArray:
        """Samples `start` to `stop`; the open `file` has the datasets, whose dimensions are turned round."""
        if start == stop:
            return np.empty(0)
        index: list[int | slice] = [self.column if side > 1 else 0 for side in self.shape]
        index[int(np.argmax(self.shape))] = slice(start, stop)
        with sound(_HDF5):
            values = file[self.place][tuple(index[::-1])] if isinstance(self.place, str) else self.place[tuple(index)]
            return np.array(values, dtype=np.float64)


@dataclass(slots=True)
class Contents:
    """Arrays, texts, objects by the name of their class, and what else is no channel, by what it is in the plural.

    Variables of `decoded` stand for those of the file.
    """

    arrays: list[ArrayChannel] = field(default_factory=list)
    texts: dict[ItemPath, str] = field(default_factory=dict)
    objects: dict[str, list[ItemPath]] = field(default_factory=lambda: defaultdict(list))
    left: dict[str, list[ItemPath]] = field(default_factory=lambda: defaultdict(list))
    decoded: Mapping[ItemPath, Any] = field(default_factory=dict)

    def add(self, path: ItemPath, value: Any) -> None:
        """Add a value as SciPy, mat-io or h5py give it, and all that is in it."""
        value = object_content(self.decoded.get(path, value))
        if hasattr(value, "attrs"):
            self._add_hdf5(path, value)
        elif isinstance(value, Mapping):
            for name, item in value.items():
                self.add((*path, str(name)), item)
        elif class_name := _class_name(value):
            self.objects[class_name].append(path)
        elif isinstance(value, str):
            self.texts[path] = value.strip()
        elif not isinstance(value, np.ndarray) or type(value).__name__ == "MatlabFunction":
            if value is not None:  # a struct without fields
                self.left[_OTHERS].append(path)
        elif value.dtype.kind == "O":  # column by column, as in MATLAB
            self.add(path, {f"{{{i}}}": item for i, item in enumerate(value.ravel(order="F"), 1)})
        elif value.dtype.kind == "V":
            structs = [{name: item[name] for name in value.dtype.names or ()} for item in value.ravel(order="F")]
            self.add(path, structs[0] if len(structs) == 1 else {f"({i})": item for i, item in enumerate(structs, 1)})
        elif value.dtype.kind in "UT":
            self.texts[path] = str(value.item()).strip() if value.size == 1 else ""
        elif value.dtype.kind in "mM":
            self.arrays.append(ArrayChannel(path, value.shape, value, "s"))
        else:
            self._add_numbers(path, value.dtype, value.shape, value)

    def _add_numbers(self, path: ItemPath, dtype: np.dtype[Any], shape: tuple[int, ...], place: Any) -> None:
        if dtype.kind in "fiub":
            self.arrays.append(ArrayChannel(path, shape, place))
        else:
            self.left[_OTHERS].append(path)

    def _add_hdf5(self, path: ItemPath, item: Any) -> None:
        """Add a dataset, or what stands in a group; links out of it are not followed."""
        class_name = _attribute(item, "MATLAB_class")
        if class_name == "function_handle" or "MATLAB_sparse" in item.attrs:
            self.left[_OTHERS].append(path)
        elif _attribute(item, "MATLAB_object_decode") not in ("", _OLD_OBJECT):
            self.objects[class_name or "no class"].append(path)
        elif hasattr(item, "dtype"):
            self._add_dataset(path, item, class_name)
        else:
            for name in item:
                if type(item.get(name, getlink=True)).__name__ != "HardLink":
                    self.left[_ELSEWHERE].append((*path, name))
                elif not name.startswith("#"):
                    self.add((*path, name), item[name])

    def _add_dataset(self, path: ItemPath, data: Any, class_name: str) -> None:
        if data.attrs.get("MATLAB_empty") or not data.size:
            if class_name not in ("char", "cell", "struct"):
                self.left[_OTHERS].append(path)
            return
        stored = min(data.id.get_storage_size(), data.file.id.get_filesize()) * (_BEST_RATIO if data.chunks else 1)
        if data.is_virtual or data.external or data.size * data.dtype.itemsize > stored:
            self.left[_ELSEWHERE].append(path)
        elif import_module("h5py").check_ref_dtype(data.dtype):  # a cell, or a field of the structs in an array
            *home, name = path
            for i, reference in enumerate(np.ravel(data[()]), 1):
                at = (*path, f"{{{i}}}") if class_name or not home else (*home, f"({i})", name)
                self.add(at, data.file[reference] if reference else None)
        elif class_name == "char":  # several rows are no text that says something of a channel
            is_row = min(data.shape) == 1 and data.dtype.kind == "u"
            letters = np.ravel(data[()]).astype("<u2") if is_row else np.empty(0)
            self.texts[path] = letters.tobytes().decode("utf-16-le", "replace").strip()
        else:
            self._add_numbers(path, data.dtype, data.shape[::-1], data.name)


def contents(path: Path, variables: Mapping[str, Any]) -> Contents:
    """All that is in the `variables` of an open file; objects are decoded where mat-io is installed."""
    whole = Contents()
    with sound("MATLAB" if isinstance(variables, dict) else _HDF5):
        whole.add((), variables)
        if names := {at[0] for paths in whole.objects.values() for at in paths}:
            whole = Contents(decoded={(name,): value for name, value in objects_in(path, sorted(names)).items()})
            whole.add((), variables)
    whole.objects.pop("string", None)
    whole.arrays = _in_seconds(whole.arrays)
    return whole


def _in_seconds(arrays: Sequence[ArrayChannel]) -> list[ArrayChannel]:
    """The arrays, with dates and durations in s; dates count from the first one of the file."""
    kinds = [array.place.dtype.kind if isinstance(array.place, np.ndarray) else "" for array in arrays]
    dates = [array.place.ravel() for array, kind in zip(arrays, kinds, strict=True) if kind == "M"]
    firsts = [date for stamps in dates for date in stamps[~np.isnat(stamps)][:1]]
    zeros = {"m": np.timedelta64(0, "ns"), "M": min(firsts, default=np.datetime64(0, "ns"))}
    return [
        replace(array, place=(array.place - zeros[kind]) / np.timedelta64(1, "s")) if kind in zeros else array
        for array, kind in zip(arrays, kinds, strict=True)
    ]


def _class_name(value: Any) -> str:
    """Name of the class of an object, as mat-io or SciPy gives it; empty of anything else."""
    kind = type(value).__name__
    if hasattr(value, "classname") and kind != "MatlabObject":  # this is a struct
        return str(value.classname)
    if kind != "MatlabOpaque":
        return ""
    name = value["_Class" if "_Class" in value.dtype.names else "s2"].ravel()[0] if value.size else ""  # SciPy 1.18
    return (name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)) or "no class"


def _attribute(item: Any, name: str) -> str:
    """An attribute as text; empty where there is none."""
    value = item.attrs.get(name, "")
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


@contextmanager
def sound(form: str) -> Iterator[None]:
    """Errors of a library on damaged bytes of a file of the format `form`, as one sentence.

    Raises
    ------
    BrokenMat
        With the reason of the library.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (BrokenMat, MissingExtra):
        raise
    except MemoryError as error:
        what = "needs more memory than there is; save it with '-v7.3', which is read piece by piece."
        raise BrokenMat(what) from error
    except Exception as error:
        reason = shortened(str(error).strip("'\"") or type(error).__name__, 120)
        raise BrokenMat(f"is not a complete {form} file ({reason}); copy or save it again.") from error


@contextmanager
def opened_variables(path: Path, *, hdf5: bool) -> Iterator[Mapping[str, Any]]:
    """The variables of a file: loaded, or those of an open HDF5 file.

    Raises
    ------
    BrokenMat
        If the bytes are not a whole file, or its variables are too large to be loaded.
    MissingExtra
        If it is HDF5 and h5py is not installed.
    """
    if not hdf5:
        yield _loaded(path)
        return
    try:
        h5 = import_module("h5py")
    except ImportError as error:
        raise missing("reading MATLAB 7.3 files (a file saved with '-v7' does not need it)", "h5py", "mat") from error
    with sound(_HDF5):
        file = h5.File(path, "r")
    with file:
        yield file


def _loaded(path: Path) -> dict[str, Any]:
    """The variables of a file of version 4 to 7."""
    from scipy.io.matlab import loadmat, varmats_from_mat

    with path.open("rb") as file:
        order = {b"IM": "utf-16-le", b"MI": "utf-16-be"}.get(file.read(128)[126:])
    codec: dict[str, Any] = {"uint16_codec": order} if order else {}
    with sound("MATLAB"):
        try:
            variables = loadmat(str(path), appendmat=False, **codec)
        except TypeError as error:
            what = f"is not a complete MATLAB file ({error}), or contains an emoji, which SciPy cannot read"
            raise BrokenMat(f"{what}; copy or save it again, or with '-v7.3'.") from error
        if type(variables.get("None")).__name__ == "MatlabOpaque":  # so SciPy before 1.18 calls all objects
            del variables["None"]
            with path.open("rb") as file:
                parts: list[tuple[str, Any]] = list(varmats_from_mat(file))
            every = [loadmat(part)["None"] for name, part in parts if name == "None"]
            variables |= {value["s0"].item().decode("utf-8", "replace"): value for value in every}
    return {name: value for name, value in variables.items() if not name.startswith("__")}
