"""A file of any known format: its kind by the first bytes, its reader on demand, unpacked if packed."""

from __future__ import annotations

import gzip
import re
import shutil
import tempfile
import zlib
from codecs import BOM_UTF8
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from clutchid.errors import DataError
from clutchid.recordings.files import reading
from clutchid.recordings.source import Source, Table, Tables

#: Bytes at the start of a file that tell its kind.
ENOUGH = 4096

_MARKS = (
    (b"\x1f\x8b", "gzip"),
    (b"MDF     ", "mdf"),
    (b"UnFinMF ", "mdf"),
    (b"PAR1", "parquet"),
    (b"PARE", "parquet"),
    (b"LOGG", "blf"),
)

_UNPACK = "unpack it, and name the recording in it"
_DATABASE = "name the recording of the bus, and give this file with --dbc"
_EXPORT = "export the channels as CSV, Parquet or MDF"

#: First bytes of files that are no recordings: what they are, and what to do.
_FOREIGN = (
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", _UNPACK),
    (b"Rar!\x1a\x07", "a RAR archive", _UNPACK),
    (b"BZh", "a bzip2 archive", _UNPACK),
    (b"\xfd7zXZ\x00", "an XZ archive", _UNPACK),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive", _UNPACK),
    (b"\x04\x22\x4d\x18", "an LZ4 archive", _UNPACK),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an Excel workbook or another Office file", "save the sheet as CSV UTF-8"),
    (b"TDSm", "a TDMS file of LabVIEW", _EXPORT),
    (b"\x93NUMPY", "a NumPy array", "write its columns as CSV with a header such as time [s],position [m]"),
    (b"ARROW1", "an Arrow (Feather) file", "write it as Parquet"),
    (b"%PDF", "a PDF document", "name the recording itself"),
    (b"\x89PNG", "a picture", "name the recording itself"),
    (b"\xff\xd8\xff", "a picture", "name the recording itself"),
    (b"SQLite format 3\x00", "an SQLite database", _EXPORT),
)

#: Beginnings of texts that are no recordings, in the order in which they are tried.
_TEXTS = (
    (r"version https://git-lfs\.github\.com/spec/", "a Git LFS pointer, which stands for a file that was not fetched",
     "fetch the file with `git lfs pull`"),
    (r"(?s)\s*(<\?xml.{0,2000}?|<!--.{0,2000}?)?<(\w+:)?AUTOSAR\b", "an ARXML database", _DATABASE),
    (r"(?s)\s*(<\?xml.{0,2000}?|<!--.{0,2000}?)?<(\w+:)?NetworkDefinition\b", "a KCD database", _DATABASE),
    (r"(?s)\s*(<\?xml.{0,2000}?)?<(!DOCTYPE\s+)?html\b", "a web page", "download the recording itself"),
    (r"\s*<\?xml\b|\s*<(\w+:)?FIBEX\b", "an XML file", _EXPORT),
    (r"(?s)\s*(//[^\n]*\n\s*)*(FormatVersion\s*=\s*[\d.]+|Title\s*=.*?\{(ENUMS|SEND|SIGNALS))", "a SYM database",
     _DATABASE),
    (r'(?ms)\s*(//[^\n]*\n\s*)*VERSION\s*(""|"[^"]*"?)\s*$', "a DBC database", _DATABASE),
    (r"(?m)\A(?s:.*?)^\s*(BU_\s*:|BO_ \d+ \w+\s*:|NS_\s*:)", "a DBC database", _DATABASE),
    (r'\s*(\{\s*"|\[\s*[\[{])', "a JSON file", "write the channels as columns of a CSV or Parquet file"),
    (r"(?s)\s*(/\*.*?\*/\s*)?(ASAP2_VERSION\b|/begin\s+PROJECT\b)", "an A2L description", _EXPORT),
    (r"\s*LIN_description_file\b", "an LDF description of a LIN bus", _EXPORT),
)  # fmt: skip


def head_of(file: Path) -> bytes:
    """First bytes of a file, which tell its kind.

    Raises
    ------
    DataError
        If it cannot be read.
    """
    with reading(file), file.open("rb") as stream:
        return stream.read(ENOUGH)


def readable_kind(file: Path) -> str:
    """The format of a file that may be a recording.

    Raises
    ------
    DataError
        If it cannot be one, or cannot be read.
    """
    head = head_of(file)
    if reason := refusal(head, file):
        raise DataError(f"{file}: {reason}")
    return kind_of(head)


def kind_of(head: bytes) -> str:
    """The format that a file with these first bytes has: ``mdf``, ``parquet``, ``blf``, ``mat``, ``asc``, ``trc``, ...

    What is nothing else is taken for ``csv``.

    Examples
    --------
    >>> kind_of(b"PAR1..."), kind_of(b"time [s],position [m]"), kind_of(b"date Wed Sep 30 15:06:13.191 2017")
    ('parquet', 'csv', 'asc')
    """
    for mark, kind in _MARKS:
        if head.startswith(mark):
            return kind
    if b"\0" in head:  # not text, except UTF-16
        from clutchid.recordings.formats.mat.file import is_mat

        return "mat" if is_mat(head) else "csv"
    from clutchid.recordings.formats.can.text import is_asc, is_trc

    return "asc" if is_asc(head) else "trc" if is_trc(head) else "csv"


def refusal(head: bytes, path: Path) -> str:
    """What a file is that cannot be a recording, and what to do; empty where it may be one.

    Examples
    --------
    >>> refusal(b"version https://git-lfs.github.com/spec/v1\\noid sha256:0", Path("run.mf4"))
    'is a Git LFS pointer, which stands for a file that was not fetched; fetch the file with `git lfs pull`.'
    """
    if head.startswith(b"PK\x03\x04") or head.startswith(b"PK\x05\x06"):
        return _zip_refusal(path)
    if head[257:262] == b"ustar":
        return f"is a tar archive; {_UNPACK}."
    for mark, what, advice in _FOREIGN:
        if head.startswith(mark):
            return f"is {what}; {advice}."
    text = head.removeprefix(BOM_UTF8).decode("latin-1")
    if "\0" in text:
        return ""
    for pattern, what, advice in _TEXTS:
        if re.match(pattern, text):
            return f"is {what}; {advice}."
    return ""


def _zip_refusal(path: Path) -> str:
    """A ZIP archive, by the names of its members."""
    import zipfile

    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return "is a damaged ZIP archive; copy it again and unpack it."
    if any(name.startswith("xl/") for name in names):
        return "is an Excel workbook; save the sheet as CSV UTF-8."
    if any(name.startswith("word/") for name in names):
        return "is a Word document; name the recording itself."
    if names and all(name.endswith(".npy") for name in names):
        return "is an archive of NumPy arrays; write them as columns of a CSV or Parquet file."
    shown = f"'{names[0][:60]}'" if names else "nothing"
    return f"is a ZIP archive (of {shown}{f' and {len(names) - 1} more' if len(names) > 1 else ''}); {_UNPACK}."


#: Bytes to which a packed file may unpack on the disk, and bytes that are unpacked at a time.
_MOST_UNPACKED = 8_000_000_000
_CHUNK = 1 << 20


def opened_here(file: Path, dbc: Sequence[Path], kind: str = "") -> Source:
    """Open a file of any known format in this process; `kind` is its format where that is known already.

    Raises
    ------
    DataError
        If it cannot be read; problems inside a recording are in ``Source.problems``.
    MissingExtra
        If the format needs a library that is not installed.
    """
    with reading(file):
        source = _opened(file, dbc, kind or kind_of(head_of(file)))
    if source.rasters or source.problems:
        return source
    return replace(source, problems=(f"contains no numeric channel. {' '.join(source.warnings)}".strip(),), warnings=())


def _opened(file: Path, dbc: Sequence[Path], kind: str) -> Source:
    if kind == "gzip":
        return _unpacked(file, dbc)
    if kind == "mdf":
        return _mdf(file, dbc)
    if kind in ("blf", "asc", "trc"):
        return _can(file, dbc, kind)
    if kind == "parquet":
        from clutchid.recordings.formats.parquet import file as parquet_file

        return parquet_file.open_file(file)
    if kind == "mat":
        from clutchid.recordings.formats.mat import file as mat_file

        return mat_file.open_file(file)
    from clutchid.recordings.formats.csv import file as csv_file

    return csv_file.open_file(file)


def _can(file: Path, dbc: Sequence[Path], kind: str) -> Source:
    from clutchid.recordings.formats.can import file as can_file

    return can_file.open_file(file, dbc, kind)


def _mdf(file: Path, dbc: Sequence[Path]) -> Source:
    """An MDF file with measured channels, or with bus frames if a DBC file is given."""
    from clutchid.recordings.formats.can import mf4 as mf4_bus
    from clutchid.recordings.formats.mdf import file as mdf_file

    if dbc and mf4_bus.holds_bus_frames(file):
        return _can(file, dbc, "mdf")
    source = mdf_file.open_file(file)
    silent = not (source.rasters or source.problems)
    return _can(file, (), "mdf") if silent and mf4_bus.holds_bus_frames(file) else source


def _unpacked(file: Path, dbc: Sequence[Path]) -> Source:
    """The recording in a gzip file, unpacked to a temporary file that is deleted with its reader."""
    folder = tempfile.TemporaryDirectory(prefix="clutchid-")
    inner = Path(folder.name) / (file.name.removesuffix(".gz") or "recording")
    with _named(file, inner):
        _unpack(file, inner)
        kind = readable_kind(inner)
        if kind == "gzip":
            raise DataError(f"{file}: is packed twice; unpack it once.")
        source = opened_here(inner, dbc, kind)
    return replace(source, path=file, tables=_UnpackedTables(file, inner, folder, source.tables))


@contextmanager
def _named(file: Path, inner: Path) -> Iterator[None]:
    """What goes wrong with the unpacked file as an error that names the packed one."""
    try:
        yield
    except DataError as error:
        raise DataError(str(error).replace(str(inner), str(file))) from error


def _unpack(file: Path, to: Path) -> None:
    most = min(_MOST_UNPACKED, shutil.disk_usage(to.parent).free // 2)
    try:
        with gzip.open(file, "rb") as packed, to.open("wb") as plain:
            size = 0
            while chunk := packed.read(_CHUNK):
                size += len(chunk)
                if size > most:
                    raise DataError(f"{file}: unpacks to more than {most / 1e9:.3g} GB; unpack and shorten it.")
                plain.write(chunk)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise DataError(f"{file}: is no whole gzip file ({error}); copy it again.") from error


@dataclass(frozen=True, slots=True)
class _UnpackedTables:
    """Reads from an unpacked file, see `Tables`, and keeps its folder as long."""

    file: Path
    inner: Path
    folder: tempfile.TemporaryDirectory[str]
    tables: Tables

    def __call__(self, raster: int, columns: Sequence[int], rows: int | None = None) -> Iterator[Table]:
        """Tables of the unpacked file."""
        with _named(self.file, self.inner):
            yield from self.tables(raster, columns, rows)
