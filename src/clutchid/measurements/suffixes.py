"""Formats of recordings, and what the name of a file says: its suffix, and the name of the recording in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple


class Format(NamedTuple):
    """A format that is read: its suffixes, its signs, and what opens it.

    Signs are the bytes at the start of a file, where these are fixed, or else a function of its first bytes. `opener`
    makes a `Source` of a file, `frames` a `FrameLog`, which a DBC decodes. Functions are named below the package
    `formats`, whose modules are imported where they are needed.
    """

    kind: str
    suffixes: tuple[str, ...]
    marks: tuple[bytes, ...] = ()
    sign: str = ""
    opener: str = ""
    frames: str = ""


#: Every format that is read. Files are told apart by content; the suffixes are what folders are searched for.
FORMATS = (
    Format("parquet", (".parquet", ".pq"), (b"PAR1", b"PARE"), opener="parquet.file.open_file"),
    Format("csv", (".csv", ".tsv", ".tab", ".txt"), opener="csv.file.open_file"),
    Format(
        "mdf", (".mf4", ".mf3", ".mdf", ".dat"), (b"MDF     ", b"UnFinMF "),
        opener="mdf.file.open_file", frames="can.mf4.mdf_frames",
    ),
    Format("mat", (".mat", ".h5", ".hdf5"), sign="mat.file.is_mat", opener="mat.file.open_file"),
    Format("blf", (".blf",), (b"LOGG",), frames="can.blf.blf_log"),
    Format("asc", (".asc",), sign="can.texts.is_asc", frames="can.texts.asc_log"),
    Format("trc", (".trc",), sign="can.texts.is_trc", frames="can.texts.trc_log"),
    Format("candump", (".log",), sign="can.texts.is_candump", frames="can.texts.candump_log"),
    Format("jsonl", (".jsonl", ".ndjson"), sign="json_lines.is_json_lines", opener="json_lines.open_file"),
)  # fmt: skip

#: Suffixes after that of the format: a packed file, or Parquet that says how it is packed inside.
PACKED = (".gz", ".gzip")

#: Suffixes of recordings, without those of `PACKED`.
SUFFIXES = tuple(suffix for row in FORMATS for suffix in row.suffixes)

#: The suffixes as messages name them.
SUFFIXES_SHOWN = f"{', '.join(SUFFIXES)}, and packed (.csv{PACKED[0]})"


def split_name(name: str) -> tuple[str, str]:
    """Name of the recording in a file and the file's suffix, which is empty where it is none of a recording.

    Examples
    --------
    >>> split_name("2026.11.23 run.MF4.gz"), split_name("2026.11.23"), split_name("map.toml")
    (('2026.11.23 run', '.MF4.gz'), ('2026.11.23', ''), ('map.toml', ''))
    """
    inner = name[: -len(Path(name).suffix)] if name.lower().endswith(PACKED) else name
    suffix = Path(inner).suffix
    return (inner.removesuffix(suffix), name[len(inner) - len(suffix) :]) if suffix.lower() in SUFFIXES else (name, "")


def binary_kind(name: str) -> str:
    """The format that the suffix of a file names, in capitals, if it is no text.

    Examples
    --------
    >>> binary_kind("run.mf4"), binary_kind("run.csv")
    ('MDF', '')
    """
    suffix = Path(name).suffix.lower()
    kinds = (row.kind.upper() for row in FORMATS if suffix in row.suffixes and (row.marks or row.kind == "mat"))
    return next(kinds, "")


def recording_name(name: str) -> str:
    """Name of the recording in a file: without the suffix of its format and packing, else without its last suffix.

    Examples
    --------
    >>> recording_name("run.csv.gz"), recording_name("run.bin"), recording_name("run")
    ('run', 'run', 'run')
    """
    stem, suffix = split_name(name)
    return stem if suffix else Path(name).stem


def by_suffix(paths: Iterable[Path]) -> str:
    """How many files have which suffix, in words, the most frequent first.

    Examples
    --------
    >>> by_suffix(map(Path, ("a.toml", "b.TOML", "notes", "backup.tar.gz")))
    '2 .toml, 1 .tar.gz, 1 without a suffix'
    """
    names = [Path(path.name.lower()) for path in paths]
    counts = Counter(
        ("".join(name.suffixes[-2:]) if name.suffix in PACKED else name.suffix) or "without a suffix" for name in names
    )
    return ", ".join(
        f"{count:,} {suffix}" for suffix, count in sorted(counts.items(), key=lambda item: (-item[1], item))
    )
