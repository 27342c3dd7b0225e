"""MATLAB files: versions 4 to 7 and 7.3 are read, version 5 is written.

A file that we write has the variables `time`, `position`, ... in SI, the struct `units`, and the metadata as JSON in
`clutchid_recording`, which is not the name of a fit's struct, so that `load` of both keeps both. A blank in a name
becomes an underscore, as names in MATLAB have no blanks.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from clutchid.errors import DataError, ExportError
from clutchid.log import FloatArray, Log, name_and_unit
from clutchid.measurements.formats.mat.contents import (
    ArrayChannel,
    BrokenMat,
    Contents,
    ItemPath,
    contents,
    opened_variables,
)
from clutchid.measurements.formats.mat.signals import matlab_path, rasters_of, signals_of
from clutchid.measurements.source import BLOCK, Places, Source, Table, own_metadata, refused
from clutchid.messages import listed, shortened
from clutchid.names import printable

#: Bytes of the start of a file that determine its format.
HEAD = 1024

_HDF5 = b"\x89HDF\r\n\x1a\n"

#: Variable of the metadata, and that of earlier versions, which is read.
_KEY, _EARLIER = "clutchid_recording", "clutchid"
_SHOWN = 3

#: Samples that a variable of a MATLAB 5 file may have.
_LONGEST = (2**31 - 1) // 8

#: What makes numbers of the objects of Simulink in MATLAB; `x` is the object.
_IN_MATLAB = {
    "Simulink.SimulationData.Dataset": "s = struct('time', x{1}.Values.Time, 'data', x{1}.Values.Data)",
    "Simulink.SimulationData.Signal": "s = struct('time', x.Values.Time, 'data', x.Values.Data)",
    "Simulink.SimulationOutput": "s = struct('time', x.tout, 'data', x.logsout{1}.Values.Data)",
}

_V73 = "MATLAB 7.3"

#: Matrices of a result of Modelica tools, whose channels have their names in another matrix.
_MODELICA = {"Aclass", "name", "dataInfo"}


def is_mat(head: bytes) -> bool:
    """Whether a file that begins with these `HEAD` bytes is one of MATLAB, or another HDF5 file.

    Examples
    --------
    >>> is_mat(b"MATLAB 5.0 MAT-file".ljust(124) + b"\\x00\\x01IM"), is_mat(b"time [s],position [m]")
    (True, False)
    """
    return _version(head) is not None


def open_file(path: Path) -> Source:
    """The vectors of a MATLAB file, in rasters of those that share a time vector.

    The clock of a vector is the one called `t`, `time`, `zeit`, `tout` or alike whose samples run on, of its length, in
    the nearest struct around it (the file itself is one); else one such as `pos_time` whose other words it has. What
    has no time anywhere has no clock. Matrices are channels ``name(:,1)``, ``name(:,2)``, ...; if no time vector is as
    long, and the first of them grows strictly, then it is their clock.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    source
        Channels are called by their paths, ``rec.pos``, ``sig(2).y``; the signals of Simulink by their labels.

    Raises
    ------
    MissingExtra
        If it is a MATLAB 7.3 file and h5py is not installed.
    OSError
        If it cannot be read; what is wrong inside it is in ``Source.problems``.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    version = _version(head)
    if version is None:
        return refused(path, "MATLAB", "is not a MATLAB file: its header is damaged; copy or save it again.")
    try:
        return _source(path, version)
    except BrokenMat as error:
        return refused(path, version, str(error))


def save(log: Log, path: Path) -> None:
    """Write `log` in SI with its units and metadata as a MATLAB 5 file, which `load` in MATLAB reads.

    Raises
    ------
    ExportError
        If it has more samples than such a file can hold.
    OSError
        If the file cannot be written.
    """
    from scipy.io import savemat

    if len(log) > _LONGEST:
        most = f"a MATLAB 5 file holds {_LONGEST:,} samples at most"
        raise ExportError(f"{path}: the log has {len(log):,} samples, {most}; write .parquet.")
    units = {"time": "s", **dict(map(name_and_unit, log.columns))}
    values = {"time": log.time, **{name_and_unit(column)[0]: values for column, values in log.columns.items()}}
    variables = {_variable(name): array.reshape(-1, 1) for name, array in values.items()}
    texts = {"units": {_variable(name): unit for name, unit in units.items()}, _KEY: json.dumps(dict(log.metadata))}
    savemat(str(path), {**variables, **texts}, appendmat=False, long_field_names=True)


def _variable(name: str) -> str:
    return name.replace(" ", "_")


def _version(head: bytes) -> str | None:
    if any(head[at : at + len(_HDF5)] == _HDF5 for at in (0, 512)):
        return _V73
    if head[126:128] in (b"IM", b"MI") and head[124:126] in (b"\x00\x01", b"\x01\x00"):
        return "MATLAB 5"
    return "MATLAB 4" if _is_v4(head) else None


def _is_v4(head: bytes) -> bool:
    """Whether a file that begins so is one of MATLAB 4, which has no signature: five integers, then a name."""
    if len(head) <= 20 or not head[20:21].isalpha():
        return False
    for order, thousands in (("<", 0), (">", 1)):
        code, rows, columns, is_complex, name_size = struct.unpack_from(order + "5i", head)
        digits = (code // 1000, code // 100 % 10, code // 10 % 10 < 6, code % 10 < 3)
        if digits == (thousands, 0, True, True) and min(rows, columns) >= 0:
            return is_complex in (0, 1) and 1 < name_size <= 256
    return False


def _source(path: Path, version: str) -> Source:
    with opened_variables(path, hdf5=version == _V73) as variables:
        whole = contents(path, variables)
        if {at[0] for at in (*whole.texts, *(array.path for array in whole.arrays))} >= _MODELICA:
            return refused(path, version, "is a result of a Modelica tool; export its variables as CSV.")
        key = next((key for key in (_KEY, _EARLIER) if (key,) in whole.texts), "")
        own = own_metadata(whole.texts.get((key,)))
        if own is not None:
            del whole.texts[key,]

        def peek(signal: ArrayChannel) -> FloatArray:
            return signal.samples(variables, 0, min(signal.size, BLOCK))

        grids = rasters_of(signals_of(whole, least=2 if own is None else 0), peek)
    rasters, warnings = tuple(raster for raster, _ in grids), _left_out(whole)
    if not rasters:
        nothing = "holds no vector of two or more numbers; save the time and the channels as vectors of one length."
        problem, *others = warnings if whole.objects else (nothing, *warnings)
        return refused(path, version, problem, *others)

    def tables(raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        size, signals = rasters[raster].size, grids[raster][1]
        again: AbstractContextManager[Mapping[str, Any]] = (
            opened_variables(path, hdf5=True) if version == _V73 else nullcontext(variables)
        )
        try:
            with again as file:
                for start in range(0, max(size, 1), rows or max(size, 1)):
                    stop = min(start + (rows or size), size)
                    numbers = {i: signals[i].samples(file, start, stop) for i in columns}
                    yield Table(rasters[raster].headings, numbers, stop - start, Places("sample", start + 1))
        except BrokenMat as error:
            raise DataError(f"{path}: {error}") from error

    return Source(path, version, rasters, tables, (), warnings, own or {})


def _left_out(whole: Contents) -> tuple[str, ...]:
    """Sentences about items that are no channels, the first about objects if there are any."""
    left = tuple(f"left out {what} ({len(paths):,}): {_some(paths)}." for what, paths in whole.left.items())
    return (_objects(whole.objects), *left) if whole.objects else left


def _objects(objects: Mapping[str, Sequence[ItemPath]]) -> str:
    """Sentence about the objects of classes, and how MATLAB makes numbers of them."""
    shown = [f"{_some(paths)} ({shortened(printable(kind))})" for kind, paths in objects.items()]
    kind = next((kind for kind in _IN_MATLAB if kind in objects), "")
    x = f"with x = {printable(matlab_path(objects[kind][0]))}, " if kind else ""
    how = _IN_MATLAB.get(kind, "copy the numbers in them to a struct s")
    return (
        f"left out objects, which only MATLAB can read: {listed(shown, _SHOWN)}; "
        f"in MATLAB, {x}{how}; save('numbers.mat', 's', '-v7.3')."
    )


def _some(paths: Sequence[ItemPath]) -> str:
    """The first of the paths, and the count of the rest."""
    return listed((f"'{shortened(printable(matlab_path(path)))}'" for path in paths), _SHOWN)
