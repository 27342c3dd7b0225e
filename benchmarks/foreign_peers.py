"""The channels of a file as the peers' own readers give them, for `foreign.py`."""

from __future__ import annotations

import contextlib
import csv
import gzip
import io
import math
import re
import shutil
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

Channels = list[tuple[str, np.ndarray]]

#: Kind of a file by the suffix that its project has given it, which knows what it is.
KINDS = {
    ".mdf": "mdf", ".mf4": "mdf", ".mf3": "mdf", ".dat": "mdf", ".mat": "mat", ".h5": "mat", ".hdf5": "mat",
    ".parquet": "parquet", ".encrypted": "parquet", ".csv": "csv", ".tsv": "csv", ".txt": "csv",
    ".asc": "asc", ".blf": "blf", ".trc": "trc", ".gz": "gzip",
}  # fmt: skip


def kind_by_origin(path: Path) -> str:
    """Kind of a file by its name, never by what clutchid takes it for; the suffix of other files."""
    return KINDS.get(path.suffix.lower(), path.suffix.lstrip(".").lower() or "other")


_ON, _OFF = ("on", "true", "yes", "ein", "an", "active", "open"), ("off", "false", "no", "aus", "inactive", "closed")


def peer_channels(path: Path, kind: str, dbc: list[Path]) -> tuple[Channels, str]:
    """Channels of numbers as the peer reads them, and what it says where it cannot."""
    readers: dict[str, Callable[[Path], Channels]] = {
        "mat": _mat,
        "mdf": lambda file: _bus(file, dbc) if dbc else _mdf(file),
        "parquet": _parquet,
        "csv": _csv,
        **dict.fromkeys(("blf", "asc", "trc"), lambda file: _bus(file, dbc)),
    }
    if kind == "gzip":
        return _packed(path, dbc)
    if kind not in readers:
        return [], "no recording"
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            return readers[kind](path), ""
    except Exception as error:  # whatever a peer raises is its answer
        return [], f"{type(error).__name__}: {str(error)[:100]}"


def _packed(path: Path, dbc: list[Path]) -> tuple[Channels, str]:
    inner = path.with_name(path.name.removesuffix(".gz"))
    unpacked = (dbc[0].parent if dbc else Path("/tmp")) / inner.name
    try:
        with gzip.open(path) as packed, unpacked.open("wb") as plain:
            shutil.copyfileobj(packed, plain)
        return peer_channels(unpacked, kind_by_origin(unpacked), dbc)
    except (OSError, EOFError) as error:
        return [], str(error)
    finally:
        unpacked.unlink(missing_ok=True)


def _real(values: Any) -> bool:
    return isinstance(values, np.ndarray) and values.dtype.kind in "fiub"


def _mat(path: Path) -> Channels:
    import h5py
    from scipy.io import loadmat

    channels: Channels = []
    with contextlib.suppress(Exception):  # mat-io decodes objects, where it can
        from matio import load_from_mat

        channels = list(_variables(load_from_mat(str(path))))
    if h5py.is_hdf5(path):
        with h5py.File(path) as file:
            return [*channels, *_hdf5(file)]
    return [*channels, *_variables(loadmat(path, struct_as_record=True, squeeze_me=False))]


def _objects(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Columns of tables that mat-io decodes; stamps in seconds from the first."""
    if hasattr(value, "columns"):
        for column in value.columns:
            numbers = value[column].to_numpy()
            if numbers.dtype.kind in "mM":
                numbers = (numbers - numbers[0]) / np.timedelta64(1, "s")
            if numbers.dtype.kind in "fiub":
                yield f"{name}.{column}", numbers.astype(float)


def _variables(content: dict[str, Any]) -> Iterator[tuple[str, np.ndarray]]:
    for name, value in content.items():
        if not name.startswith("__"):
            yield from _walked(name, value)


def _walked(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    if hasattr(value, "columns"):
        yield from _objects(name, value)
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names and type(value).__name__ != "MatlabOpaque":
        for field in value.dtype.names:
            for item in value[field].ravel():
                yield from _walked(f"{name}.{field}", item)
    elif value.dtype == object and type(value).__name__ not in ("MatlabOpaque", "MatlabFunction"):
        for item in value.ravel():
            yield from _walked(name, item)
    elif _real(value):
        yield from _columns(name, value)


def _columns(name: str, value: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """A vector, or the columns and rows of a matrix."""
    sides = [side for side in value.shape if side > 1]
    if len(sides) <= 1:
        yield name, value.ravel().astype(float)
    elif len(sides) == 2 and min(sides) <= 256:
        matrix = value.reshape(sides)
        for row in (matrix if sides[0] < sides[1] else matrix.T).astype(float):
            yield name, row


def _hdf5(group: Any) -> Iterator[tuple[str, np.ndarray]]:
    import h5py

    channels: Channels = []

    def visit(name: str, item: Any) -> None:
        plain = isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub" and 0 < item.size <= 1e8
        marks = {*item.attrs, *item.parent.attrs} if plain else set()
        plain = plain and not marks & {"MATLAB_sparse", "MATLAB_object_decode"} and "function_handle" not in name
        if plain and item.attrs.get("MATLAB_class", b"") != b"char" and not item.attrs.get("MATLAB_empty", 0):
            channels.extend(_columns(name, item[()].T))

    group.visititems(visit)
    yield from channels


def _parquet(path: Path) -> Channels:
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(path)
    channels: Channels = []
    for field in file.schema_arrow:
        kind = field.type
        if not (
            pa.types.is_integer(kind)
            or pa.types.is_floating(kind)
            or pa.types.is_boolean(kind)
            or pa.types.is_decimal(kind)
            or pa.types.is_temporal(kind)
        ):
            continue  # fmt: skip
        column = file.read(columns=[field.name]).column(field.name).combine_chunks()
        second = _per_second(kind) if pa.types.is_temporal(kind) else 1.0
        if second != 1.0:
            column = column.view(pa.int32() if kind.bit_width == 32 else pa.int64())
        whole = column.to_pylist()
        origin = next((value for value in whole if value is not None), 0) if second != 1.0 else 0
        numbers = [math.nan if value is None else float(value - origin) for value in whole]
        channels.append((field.name, np.array(numbers) / second))
    return channels


def _per_second(kind: Any) -> float:
    """How many of its units a second has."""
    import pyarrow as pa

    unit = getattr(kind, "unit", "day" if pa.types.is_date32(kind) else "ms")
    return {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "day": 1 / 86400}[unit]


def _mdf(path: Path) -> Channels:
    from asammdf import MDF

    channels: Channels = []
    with MDF(path) as mdf:
        for number, group in enumerate(mdf.groups):
            for index in range(len(group.channels)):
                signal = mdf.get(group=number, index=index, ignore_invalidation_bits=True)
                values = np.asarray(signal.samples)
                if values.ndim != 1 or values.dtype.names:
                    continue
                if values.dtype.kind in "SUO":
                    values = _truth(values)
                if values.dtype.kind in "fiub":
                    channels.append((str(signal.name), values.astype(float)))
    return channels


def _truth(texts: np.ndarray) -> np.ndarray:
    """On and off as 1 and 0, where there is nothing else."""
    plain = [t.decode("utf-8", "replace") if isinstance(t, bytes) else str(t) for t in texts.tolist()]
    words = [text.strip().casefold() for text in plain]
    if not all(word in _ON + _OFF for word in words):
        return texts
    return np.array([float(word in _ON) for word in words])


def _frames(path: Path) -> Iterator[Any]:
    import can

    if kind_by_origin(path) == "asc":
        text = path.read_text(encoding="utf-8", errors="replace")
        if "internal events logged" not in text.casefold():  # without it python-can swallows the first frame
            text = re.sub(r"(?im)^(\s*base\b.*)$", r"\1\nno internal events logged", text, count=1)
        reader: Any = can.ASCReader(io.StringIO(text))
    else:
        reader = can.LogReader(str(path))
    for frame in reader:
        sound = frame.is_extended_id or frame.arbitration_id < 1 << 11
        if sound and not (frame.is_error_frame or frame.is_remote_frame):
            yield frame


def bus_database(path: Path, kind: str, folder: Path) -> tuple[list[Path], str]:
    """A DBC in `folder` whose messages are the identifiers of a log, a signal a byte; none where it is no log."""
    if kind not in ("asc", "blf", "trc"):
        return [], ""
    sizes: dict[tuple[int, bool], int] = {}
    try:
        for frame in _frames(path):
            key = (frame.arbitration_id, bool(frame.is_extended_id))
            sizes[key] = min(max(sizes.get(key, 0), len(frame.data)), 64)
    except Exception as error:  # whatever a peer raises is its answer
        return [], f"{type(error).__name__}: {error}"
    text = ['VERSION ""', "BU_: ECU"]
    for (identifier, extended), size in sizes.items():
        if size:
            text.append(f"BO_ {identifier | extended << 31} M{identifier:X}{'x' * extended}: {size} ECU")
            text += [f' SG_ B{i} : {8 * i}|8@1+ (1,0) [0|255] "" ECU' for i in range(size)]
    file = folder / "made.dbc"
    file.write_text("\n".join(text) + "\n")
    return ([file], "") if len(text) > 2 else ([], "no frame with data")


def _bus(path: Path, dbc: list[Path]) -> Channels:
    """Bytes of every message as channels, NaN where a frame is shorter, and its stamps from the first frame."""
    if not dbc:
        raise ValueError("no frame with data")
    frames = list(_frames(path))
    sizes: dict[tuple[int, bool], int] = {}
    for frame in frames:
        key = (frame.arbitration_id, bool(frame.is_extended_id))
        sizes[key] = min(max(sizes.get(key, 0), len(frame.data)), 64)
    origin = frames[0].timestamp
    channels: Channels = []
    streams: dict[Any, list[Any]] = {}
    for frame in frames:
        streams.setdefault((frame.arbitration_id, bool(frame.is_extended_id), frame.channel), []).append(frame)
    for (identifier, extended, _), own in streams.items():
        size = sizes[identifier, extended]
        rows = np.full((len(own), size), np.nan)
        for row, frame in zip(rows, own, strict=True):
            row[: len(frame.data)] = list(frame.data)[:size]
        channels.append(("time", np.round(np.array([frame.timestamp - origin for frame in own]), 9)))
        channels += [(f"B{i}", rows[:, i]) for i in range(size)]
    return channels


def _csv(path: Path) -> Channels:
    """Columns of Python's csv, with the separator that its sniffer finds, as far as they are numbers."""
    raw = path.read_bytes()
    text = raw.decode("utf-16" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    dialect = csv.Sniffer().sniff(text[:4096], ",;\t|")
    rows = [row for row in csv.reader(io.StringIO(text, newline=""), dialect) if row]
    header, body = rows[0], rows[1:]
    channels: Channels = []
    for index, name in enumerate(header):
        with contextlib.suppress(ValueError, IndexError):
            channels.append((name, np.array([float(row[index]) if row[index] else math.nan for row in body])))
    return channels
