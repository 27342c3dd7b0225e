"""Small files that unpack to gigabytes, through `look` and `fit`: ``python benchmarks/bombs.py``.

A Parquet of 0.8 MB with 60 million rows, a MATLAB 7.3 file of 3 MB with 1e8 zeros a channel, and a MATLAB 5 file of
2 MB with 2 GB of zeros. Printed are exit code, time, and the highest memory of the command with its reader process;
exit code 1 where one takes more than 60 s or 2 GB.
"""

from __future__ import annotations

import contextlib
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from pathlib import Path

import numpy as np
from day_file import watched

SECONDS, BYTES = 60.0, 2e9

NAMES = ("time", "position", "duty_supply", "duty_exhaust")
UNITS = ("s", "m", "1", "1")


def parquet(path: Path, rows: int = 60_000_000) -> None:
    """Zeros, 60 million rows of four columns."""
    import polars as pl

    zeros = pl.zeros(rows, eager=True)
    pl.DataFrame({f"{name} [{unit}]": zeros for name, unit in zip(NAMES, UNITS, strict=True)}).write_parquet(path)


def matlab_73(path: Path, samples: int = 100_000_000, chunk: int = 1 << 20) -> None:
    """Zeros in deflated chunks of HDF5."""
    import h5py

    zeros = np.zeros((1, chunk))
    with h5py.File(path, "w", userblock_size=512) as file:
        for name in NAMES:
            data = file.create_dataset(name, shape=(1, samples), dtype="f8", chunks=(1, chunk), compression="gzip")
            data.attrs["MATLAB_class"] = np.bytes_(b"double")
            for start in range(0, samples, chunk):
                data[:, start : start + chunk] = zeros[:, : min(chunk, samples - start)]
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def matlab_5(path: Path, samples: int = 62_500_000) -> None:
    """Zeros in deflated variables, never in memory as a whole."""
    with path.open("wb") as file:
        file.write(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM")
        for name in NAMES:
            variable = _variable(name.encode(), samples)
            file.write(struct.pack("<II", 15, len(variable)) + variable)


def _variable(name: bytes, samples: int) -> bytes:
    """A deflated column vector of zeros: flags, sides, name, numbers."""
    head = struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, samples, 1)
    head += struct.pack("<II", 1, len(name)) + name + bytes(-len(name) % 8) + struct.pack("<II", 9, 8 * samples)
    packing, zeros = zlib.compressobj(9), bytes(8 << 20)
    parts = [packing.compress(struct.pack("<II", 14, len(head) + 8 * samples) + head)]
    whole, rest = divmod(8 * samples, len(zeros))
    parts += [packing.compress(zeros) for _ in range(whole)]
    parts.append(packing.compress(zeros[:rest]))
    return b"".join([*parts, packing.flush()])


def measured(verb: str, path: Path) -> bool:
    """Run a command on a file; whether it stayed within time and memory."""
    begun = time.monotonic()
    command = [sys.executable, "-m", "clutchid", verb, str(path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    peaks = [0]
    watch = threading.Thread(target=watched, args=(process.pid, peaks))
    watch.start()
    said = process.communicate()[0].split()
    watch.join()
    seconds, size = time.monotonic() - begun, path.stat().st_size / 1e6
    taken = f"{seconds:.1f} s, peak {max(peaks) / 1e9:.2f} GB"
    print(f"{verb} {path.name} ({size:.2f} MB): exit {process.returncode}, {taken}")
    print(f"    {' '.join(said)[:160]}", flush=True)
    return seconds < SECONDS and max(peaks) < BYTES and process.returncode in (0, 2)


def main() -> int:
    """Make the files, and run both commands on each."""
    sound = True
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for make, name in ((parquet, "zeros.parquet"), (matlab_73, "zeros73.mat"), (matlab_5, "zeros5.mat")):
            make(Path(name))
            for verb in ("look", "fit"):
                sound = measured(verb, Path(name)) and sound
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
