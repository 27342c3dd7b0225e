"""Broken files: every reader must answer with a recording or one clear sentence, in time and within 1 GB.

Binary files and gzip are opened in the guarded reader process; what ended it is counted, and must be one sentence.

    python benchmarks/fuzz.py [FORMAT ...] [--cases 10000] [--seed 0]

Formats are csv, gz, parquet, mf4, mat, mat73, blf, asc, trc and dbc. A good file of each is truncated, gets flipped
bits, bytes that are missing, repeated or put in, and numbers that claim to be huge; each case is then looked at and
read in a process of its own that may be stopped. With dbc the database is broken, its numbers and words too, and every
other time the BLF file that it decodes. Printed are the cases with a traceback, those that hung, and the largest
memory.
"""

from __future__ import annotations

import argparse
import gzip
import multiprocessing
import os
import re
import resource
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from clutchid.errors import ClutchidError
from clutchid.log import COLUMNS, Log
from clutchid.measurements import read, write
from clutchid.measurements.look import look
from clutchid.measurements.map.channel_map import Channel, ChannelMap

#: A case that takes longer has hung, in s; and what clutchid's own process may take, in bytes.
PATIENCE, MEMORY = 30.0, 1 << 30

#: Seconds that the reader process has for an answer here; as set by the user it is a minute.
READER_SECONDS = "5"

#: What the sentences say that tell of an end of the reader process.
ENDS = {
    "died": "the reader process ended on it",
    "gave up": "was not read within",
    "memory": "needs more than",
}

FORMATS = ["csv", "gz", "parquet", "mf4", "mat", "mat73", "blf", "asc", "trc", "dbc"]

DBC = """VERSION ""
BU_: ECU
BO_ 256 Clutch: 8 ECU
 SG_ ClutchPos : 0|16@1+ (0.01,0) [0|100] "mm" ECU
 SG_ DutySupply : 16|8@1+ (0.5,0) [0|100] "%" ECU
 SG_ DutyExhaust : 24|8@1+ (0.5,0) [0|100] "%" ECU
 SG_ ClutchPressure : 39|16@0+ (1,0) [0|2000] "kPa" ECU
BO_ 2566844926 Other: 8 ECU
 SG_ Selector M : 0|4@1+ (1,0) [0|15] "" ECU
 SG_ Gear m0 : 4|4@1- (1,-3) [-4|12] "" ECU
 SG_ Torque m1 : 8|16@1- (1,0) [0|0] "N·m" ECU
SIG_VALTYPE_ 2566844926 Torque : 0;
CM_ SG_ 256 ClutchPos "piston; <position>";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ "ProtocolType" STRING ;
BA_DEF_DEF_ "ProtocolType" "CAN";
BA_ "GenMsgCycleTime" BO_ 256 1;
VAL_ 2566844926 Gear 1 "first" 2 "second" ;
SG_MUL_VAL_ 2566844926 Torque Selector 1-2;
"""

#: What is put in place of a number or a word of a database.
WORDS = (
    "0", "-1", "64", "65535", "4294967296", "1e308", "nan", "1e999", "9" * 40, "", '"', "@", "m0", "M", ";", "SG_",
    "BO_", "é", "\0", "\x1b[31m", "\u202e", "<b>", "(" * 30, "x" * 5000,
)  # fmt: skip


def example(samples: int = 200) -> Log:
    """A small recording with a missing sample and metadata."""
    time = np.arange(samples) / 1000
    position = 1e-3 * np.sin(40 * time) ** 2
    position[7] = np.nan
    duty = (time % 0.02 < 0.005) * 1.0
    columns = {"position": position, "duty_supply": duty, "duty_exhaust": 0 * duty, "pressure_a": 2e5 + 1e5 * time}
    return Log(time, columns, "run", {"truck": "7 <&> ü"})


def good_file(kind: str, folder: Path) -> tuple[Path, ChannelMap | None]:
    """A file of a format that can be read, and the channel map that it needs.

    Raises
    ------
    ValueError
        If the format is not known.
    """
    if kind in ("csv", "parquet", "mf4", "mat"):
        path = folder / f"good.{kind}"
        write(example(), path)
        return path, None
    if kind == "gz":
        plain = folder / "good.csv"
        write(example(), plain)
        path = folder / "good.csv.gz"
        path.write_bytes(gzip.compress(plain.read_bytes(), mtime=0))
        return path, None
    if kind == "mat73":  # MATLAB has no units
        units = {"time": "s", **COLUMNS}
        named = {name: Channel(name, unit=units[name]) for name in ("time", *example().columns)}
        return _mat73(folder / "good73.mat"), ChannelMap(named)
    if kind in ("blf", "asc", "trc", "dbc"):
        dbc = folder / "clutch.dbc"
        dbc.write_text(DBC)
        signals = dict(
            zip(example().columns, ("ClutchPos", "DutySupply", "DutyExhaust", "ClutchPressure"), strict=True)
        )
        recorded = "blf" if kind == "dbc" else kind
        return _frames(folder / f"good.{recorded}"), ChannelMap({n: Channel(s) for n, s in signals.items()}, (dbc,))
    raise ValueError(kind)


def _mat73(path: Path) -> Path:
    """A MATLAB v7.3 file as MATLAB writes it: HDF5 behind 512 bytes of text."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        log = example()
        for name, values in (("time", log.time), *log.columns.items()):
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_(b"double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def _frames(path: Path) -> Path:
    import can

    log = example()
    with can.Logger(str(path)) as logger:
        for i in range(len(log)):
            data = int(100 * i).to_bytes(2, "little") + bytes([i % 200, (3 * i) % 200, 1, i % 256, 0, 0])
            logger.on_message_received(
                can.Message(timestamp=1.7e9 + log.time[i], arbitration_id=256, is_extended_id=False, data=data)
            )
    return path


def spoiled(data: bytes, rng: np.random.Generator) -> bytes:
    """A file that something happened to."""
    raw = bytearray(data)
    kind = rng.integers(8)
    where = int(rng.integers(len(raw))) if rng.random() < 0.5 else int(rng.integers(min(len(raw), 600)))
    length = int(min(rng.integers(1, 64), len(raw) - where))
    if kind == 0:
        return bytes(raw[:where])
    if kind == 1:
        for _ in range(int(rng.integers(1, 20))):
            raw[int(rng.integers(len(raw)))] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        raw[where] ^= 1 << int(rng.integers(8))
    elif kind == 3:
        del raw[where : where + length]
    elif kind == 4:
        raw[where:where] = rng.bytes(length)
    elif kind == 5:
        raw[where : where + length] = raw[:length]
    elif kind == 6:
        raw[where : where + 8] = b"\xff" * min(8, len(raw) - where)
    else:
        raw[where : where + 8] = int(rng.integers(1, 1 << 40)).to_bytes(8, "little")[: min(8, len(raw) - where)]
    return bytes(raw)


def reworded(text: str, rng: np.random.Generator) -> str:
    """A database in which numbers and words were replaced by others, or by each other."""
    words = re.findall(r"\w+|\W", text)
    for _ in range(int(rng.integers(1, 4))):
        where = int(rng.integers(len(words)))
        other = words[int(rng.integers(len(words)))]
        words[where] = WORDS[int(rng.integers(len(WORDS)))] if rng.random() < 0.7 else other
    return "".join(words)


def answered(path: Path, channels: ChannelMap | None) -> str:
    """What the readers say of a file: 'read', 'refused', how it ended the reader process, or a traceback: a finding."""
    try:
        look(path, dbc=channels.dbc if channels else ()).table()
        read(path, channels=channels)
    except ClutchidError as error:
        text = str(error).strip()
        if "panick" in text or "Traceback" in text:
            return f"a sentence that is none: {text}"
        return next((end for end, mark in ENDS.items() if mark in text), "refused" if text else "no sentence")
    except Exception:  # the finding itself
        return traceback.format_exc()
    return "read"


def cases(kind: str, seeds: range, folder: Path) -> Iterator[tuple[int, Path, ChannelMap | None]]:
    """Spoiled files of a format, one after the other under one name."""
    good, channels = good_file(kind, folder)
    data = good.read_bytes()
    path = folder / f"case{''.join(good.suffixes)}"
    for seed in seeds:
        rng = np.random.default_rng(seed)
        if kind != "dbc" or seed % 2:
            path.write_bytes(b"" if seed == 0 else spoiled(data, rng))
        else:
            path.write_bytes(data)
        if kind == "dbc" and channels:
            broken = spoiled(DBC.encode(), rng) if seed % 3 else reworded(DBC, rng).encode()
            channels.dbc[0].write_bytes(broken if seed else b"")
        yield seed, path, channels


def _worker(kind: str, seeds: range, pipe: Connection) -> None:
    """Answer cases and report each; a case that was begun but not answered hung or died."""
    os.environ["CLUTCHID_READER_SECONDS"] = READER_SECONDS
    with tempfile.TemporaryDirectory() as folder:
        for seed, path, channels in cases(kind, seeds, Path(folder)):
            pipe.send(("begin", seed, ""))
            answer = answered(path, channels)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
            pipe.send((answer, seed, peak))
    pipe.send(("end", -1, 0))


def fuzz(kind: str, count: int, first: int, show: Callable[[str], None]) -> bool:
    """Whether all `count` cases of a format from seed `first` were answered as they should."""
    context = multiprocessing.get_context("spawn")
    answers = Counter({"read": 0, "refused": 0})
    bad: list[str] = []
    peak, seed, begun = 0, first, time.monotonic()
    while seed < first + count:
        ours, theirs = context.Pipe()
        process = context.Process(target=_worker, args=(kind, range(seed, first + count), theirs))
        process.start()
        theirs.close()
        while True:
            try:
                message = ours.recv() if ours.poll(PATIENCE) else ("hung", seed, 0)
            except EOFError:
                message = ("clutchid died", seed, 0)
            answer, at, used = message
            if answer == "begin":
                seed = at
                continue
            if answer == "end":
                seed = first + count
                break
            peak = max(peak, used)
            if answer in ("read", "refused", *ENDS):
                answers[answer] += 1
            else:
                bad.append(f"seed {at}: {answer}")
            seed = at + 1
            if answer in ("hung", "clutchid died"):
                break
        process.kill()
        process.join()
    counted = ", ".join(f"{number} {answer}" for answer, number in answers.items())
    taken = f"{count} cases in {time.monotonic() - begun:.0f} s"
    show(f"{kind}: {taken}, {counted}, {len(bad)} wrong, peak {peak / 2**20:.0f} MiB")
    for text in bad[:5]:
        show(text)
    return not bad and peak < MEMORY


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("formats", nargs="*", default=FORMATS)
    parser.add_argument("--cases", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    good = [fuzz(kind, asked.cases, asked.seed, lambda text: print(text, flush=True)) for kind in asked.formats]
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
