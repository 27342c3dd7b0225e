"""Kind of a file by its first bytes: a format that is read, or that is refused with advice."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from clutchid.errors import DataError
from clutchid.files import reading
from clutchid.measurements.suffixes import FORMATS, Format, split_name
from clutchid.messages import listed

#: Bytes at the start of a file that determine its kind.
ENOUGH = 1 << 14


_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")

_GZIP = b"\x1f\x8b"

#: Two numbers beside each other, as a table has them: with a decimal point or comma, between any separators.
_NUMBER = rb"[+-]?\d+([.,]\d*)?([eE][+-]?\d+)?"
_NUMBERS = re.compile(rb'(?m)(^|[;,\t| "])' + _NUMBER + rb'"? *[;,\t| ] *"?' + _NUMBER + rb'([;,\t| "\r]|$)')

_UNPACK = "unpack it, and name the recording in it"
_JSON = "a JSON file"
_DATABASE = "name the recording of the bus, and give its DBC with --dbc"
_EXPORT = "export the channels as CSV, Parquet or MDF"
_FRAMES = "convert it to BLF or ASC with the tool that wrote it, or record with `candump -L`"

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
    (b"|CF,", "an imc FAMOS file", _EXPORT),
    *(
        (bytes([0x80, protocol]), "a pickle of Python", "write its columns as Parquet or CSV")
        for protocol in range(2, 6)
    ),
    (b"\x93NUMPY", "a NumPy array", "write its columns as CSV with a header such as time [s],position [m]"),
    (b"ARROW1", "an Arrow (Feather) file", "write it as Parquet"),
    *(
        (mark, "a capture of Wireshark or tcpdump", "write the frames as text with `candump -L`, or as BLF")
        for mark in (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\x0a\x0d\x0d\x0a")
    ),
    (b"\x89MCAP0\r\n", "an MCAP file of ROS", _EXPORT),
    (b"#ROSBAG", "a ROS bag", _EXPORT),
    (b"SQLite format 3\x00", "an SQLite database", _EXPORT),
)

#: Beginnings of texts that are no recordings, in the order in which they are tried.
_TEXTS = (
    (r"version https://git-lfs\.github\.com/spec/", "a Git LFS pointer, which stands for a file that was not fetched",
     "fetch the file with `git lfs pull`"),
    (r"(?s)\s*(<\?xml.{0,2000}?|<!--.{0,2000}?)?<(\w+:)?(AUTOSAR|NetworkDefinition)\b", "an ARXML or KCD database",
     _DATABASE),
    (r"(?s)\s*(<\?xml.{0,2000}?)?<(!DOCTYPE\s+)?html\b", "a web page", "download the recording itself"),
    (r"\s*<\?xml\b|\s*<(\w+:)?FIBEX\b", "an XML file", _EXPORT),
    (r"(?s)\s*(//[^\n]*\n\s*)*(FormatVersion\s*=|Title\s*=).*?(\{(ENUMS|SEND\w*|RECEIVE|SIGNALS)\}|Title\s*=)",
     "a SYM database", _DATABASE),
    (r'(?ms)\s*(//[^\n]*\n\s*)*VERSION\s*(""|"[^"]*"?)\s*$', "a DBC database", _DATABASE),
    (r"(?m)\A(?s:.*?)^\s*(BU_\s*:|BO_ \d+ \w+\s*:|NS_\s*:)", "a DBC database", _DATABASE),
    (r'\s*(\{\s*"|\[\s*[\[{])', _JSON, "write the channels as columns of a CSV or Parquet file"),
    (r"(?s)\s*(/\*.*?\*/\s*)?(ASAP2_VERSION\b|/begin\s+PROJECT\b)", "an A2L description", _EXPORT),
    (r"\s*LIN_description_file\b", "an LDF description of a LIN bus", _EXPORT),
    (r"\d+\.\d+ \d?(CXX|[RT](11|29)) ", "a CRTD log of frames", _FRAMES),
    (r"(//.*\n)*//\s*Microchip Technology", "a log of Microchip's CAN analyzer", _FRAMES),
    (r"\*{3}BUSMASTER", "a log of BUSMASTER", _FRAMES),
    (r"(?i)\s*Chn\s+Identifier\s+Flg\s+DLC\b|\s*Kvaser Memorator Log\b", "a log of Kvaser", _FRAMES),
    (r"DIAEXTENDED\b", "a header of DIAdem, whose samples lie in other files", _EXPORT),
)  # fmt: skip

#: Names of columns that a table of frames has, without blanks: a time, an identifier, a payload, and what only frames
#: have besides; a type may be of anything, unless there are no other columns.
_TIME = {"time", "timestamp", "timestampepoch", "abstime", "reltime"}
_IDENTIFIER = {"id", "canid", "arbid", "arbitrationid", "identifier", "msgid", "messageid", "addr", "address", "pgn"}
_PAYLOAD = {"data", "databytes", "payload", "data0", "data1", "b0", "b1", "d0", "d1", "byte0", "byte1"}
_OF_FRAMES = {"dlc", "len", "length", "bus", "buschannel", "channel", "extended", "ide", "xtd", "flags", "dir", "rtr"}
_OF_ANYTHING = _TIME | _IDENTIFIER | _PAYLOAD | {"type", "format"}


def _is_frame_table(text: str) -> bool:
    """Whether one of the first lines of a text names the columns of raw frames."""
    for line in text.splitlines()[:60]:
        names = {re.sub(r"[\s_.\-\"]|[\[(].*", "", cell).casefold() for cell in re.split("[,;\t]", line)}
        if names & _TIME and names & _IDENTIFIER and names & _PAYLOAD and (names & _OF_FRAMES or names <= _OF_ANYTHING):
            return True
    return False


def is_recording(path: Path) -> bool:
    """Whether a file of a folder is called like a recording.

    A text (``.txt``) also needs a line of numbers, and a log (``.log``) frames.

    A text that cannot be read may be one, so that its reader says why.
    """
    suffix = split_name(path.name)[1].lower()
    if suffix not in (".txt", ".log"):
        return bool(suffix)
    try:
        head = head_of(path)
    except DataError:
        return True
    if suffix == ".log":
        return _FRAMES in refusal(head, path) or any(row.frames for row in FORMATS if row.kind == kind_of(head))
    return b"\0" in head or _NUMBERS.search(head) is not None  # UTF-16 has zeros


def head_of(file: Path) -> bytes:
    """First bytes of a file, which determine its kind.

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
    >>> kind_of(b"PAR1..."), kind_of(b"time [s],position [m]"), kind_of(b"date Wed Sep 30 15:06:13.191 2017\\nbase hex")
    ('parquet', 'csv', 'asc')
    """
    if head.startswith(_GZIP):
        return "gzip"
    for row in FORMATS:
        if head.startswith(row.marks) and not _is_text(head):
            return row.kind
    binary = b"\0" in head  # UTF-16 has zeros as well, and is a table
    signed = [row for row in FORMATS if row.sign and (row.kind == "mat") == binary]
    return next((row.kind for row in signed if function_named(row.sign)(head)), "csv")


def format_of(kind: str) -> Format:
    """The row of a format of `kind_of`."""
    return next(row for row in FORMATS if row.kind == kind)


def function_named(name: str) -> Callable[..., Any]:
    """The function of a module of `formats`, such as ``csv.file.open_file``, imported on demand."""
    module, _, function = name.rpartition(".")
    named: Callable[..., Any] = getattr(import_module(f"clutchid.measurements.formats.{module}"), function)
    return named


def _is_text(head: bytes) -> bool:
    """Whether a file begins with a line of text, so that its first letters are no mark of a binary format."""
    return b"\n" in head and _CONTROL.search(head) is None


def refusal(head: bytes, path: Path) -> str:
    """Kind of a file that cannot be a recording, and what to do; empty where it may be one.

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
        if head.startswith(mark) and not (mark.isalnum() and _is_text(head)):
            return f"is {what}; {advice}."
    text = head.removeprefix(BOM_UTF8).decode("latin-1")
    if "\0" in text:
        return ""
    for pattern, what, advice in _TEXTS:
        if re.match(pattern, text) and not (what == _JSON and kind_of(head) == "jsonl"):
            return f"is {what}; {advice}."
    return f"is a table of frames; {_FRAMES}." if _is_frame_table(text) else ""


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
    shown = listed([f"'{name[:60]}'" for name in names], 1)
    return f"is a ZIP archive (of {shown or 'nothing'}); {_UNPACK}."
