"""Files of other projects, read by clutchid and by the peers' own readers, value by value.

    python benchmarks/foreign.py FOLDER ... [--list]

Every file below the folders is opened; its channels must be among those of asammdf, scipy.io and h5py, pyarrow,
python-can, cantools or Python's csv, with the same values. Printed is, by folder and kind of file: files, read, refused
rightly (the peer refuses the file too, or finds no channel of two or more numbers), refused wrongly, read wrongly, and
the slowest file. `--list` adds a line a file. Exit code 1 where a file is refused or read wrongly.

Frames of a bus are compared through a DBC that is made for the log: every identifier in it is a message of bytes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from foreign_peers import Channels, bus_database, kind_by_origin, peer_channels

from clutchid.errors import ClutchidError
from clutchid.measurements.look import look
from clutchid.measurements.opening import open_source
from clutchid.measurements.source import Source, Table

#: A file for which clutchid and its peer take longer than this in s counts as hung.
PATIENCE = 180.0

VERDICTS = ("read", "refused rightly", "refused wrongly", "read wrongly")


@dataclass(frozen=True)
class Finding:
    """What came of one file: one of `VERDICTS`, why, and the time in s that clutchid took for `look`."""

    path: Path
    kind: str
    verdict: str
    reason: str
    seconds: float


def ours(path: Path, dbc: list[Path]) -> Channels:
    """Every channel of every time grid as clutchid reads it."""
    source = open_source(path, dbc)
    if source.problems or not source.rasters:
        raise ClutchidError(" ".join(source.problems) or "no channel")
    channels: Channels = []
    trouble = ""
    for number, raster in enumerate(source.rasters):
        every = [heading.index for heading in raster.headings]
        tables = _tables(source, number, every)
        if not isinstance(tables, str):
            channels += [
                (h.text, np.concatenate([table.numbers[h.index] for table in tables])) for h in raster.headings
            ]
            continue
        trouble = tables
        for heading in raster.headings:  # a recording needs a few of them only
            alone = _tables(source, number, [heading.index])
            if not isinstance(alone, str):
                channels.append((heading.text, np.concatenate([table.numbers[heading.index] for table in alone])))
    if not channels:
        raise ClutchidError(trouble)
    return channels


def _tables(source: Source, number: int, columns: list[int]) -> list[Table] | str:
    """Blocks of these columns, or what is wrong with them."""
    tables = list(source.tables(number, columns, 1 << 20))
    problems = [problem for table in tables for problem in table.problems]
    return " ".join(problems) if problems or not tables else tables


def compared(path: Path) -> Finding:
    """clutchid and the peer on one file."""
    what = kind_by_origin(path)
    begun = time.monotonic()
    with suppress(ClutchidError):
        look(path).table()
    seconds = time.monotonic() - begun
    sentence = ""
    with tempfile.TemporaryDirectory() as folder:
        dbc, trouble = bus_database(path, what, Path(folder))
        try:
            mine = ours(path, dbc)
        except ClutchidError as error:
            mine, sentence = [], str(error)
        theirs, trouble = ([], trouble) if trouble else peer_channels(path, what, dbc)
    verdict, reason = _verdict(what, mine, sentence, theirs, trouble)
    return Finding(path, what, verdict, reason, seconds)


def _verdict(what: str, mine: Channels, sentence: str, theirs: Channels, trouble: str) -> tuple[str, str]:
    useful = [(name, values) for name, values in theirs if values.size > 1 and not name.startswith("#")]
    if not mine:
        if useful:
            return "refused wrongly", f"{sentence} | the peer has {len(useful)} channels, such as {useful[0][0]}"
        return "refused rightly", f"{sentence} | the peer: {trouble or 'no channel of two or more numbers'}"
    if trouble:
        return "read", f"{len(mine)} channels, which nobody can compare: the peer says {trouble}"
    for name, values in mine:
        if not np.isfinite(values).any() or any(_same(name, values, other) for _, other in theirs):
            continue
        near = [other for label, other in theirs if label == name]
        if near or what != "csv":  # Python's csv knows no dates, remarks above the header, or decimal commas
            shown = [other[:3].tolist() for other in near]
            return "read wrongly", f"{name}: {values[:3].tolist()} ... of {values.size}, the peer has {shown}"
    lacking = [name for name, values in useful if not any(_same(name, values, own) for _, own in mine)]
    note = f"; {len(lacking)} more that the peer has, such as {lacking[0]}" if lacking else ""
    return "read", f"{len(mine)} channels{note}"


def _same(name: str, values: np.ndarray, other: np.ndarray) -> bool:
    """Equal but for rounding in the last digits; stamps of frames, from which an origin was taken, within 1 µs."""
    if values.shape != other.shape:
        return False
    slack = 1e-6 if name == "time" else 0.0
    return bool(np.allclose(values, other, rtol=1e-12, atol=slack, equal_nan=True))


def findings(paths: list[Path]) -> Iterator[Finding]:
    """What came of every file, each in a process that may die or hang."""
    pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"))
    for path in paths:
        try:
            yield pool.submit(compared, path).result(timeout=PATIENCE)
        except (BrokenProcessPool, TimeoutError) as error:
            for process in list((pool._processes or {}).values()):
                process.kill()
            pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"))
            yield Finding(
                path, kind_by_origin(path), "read wrongly", f"clutchid or the peer: {type(error).__name__}", PATIENCE
            )
    pool.shutdown()


def main() -> int:
    """Compare, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--list", action="store_true")
    asked = parser.parse_args()
    rows: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    slowest: dict[tuple[str, str], float] = defaultdict(float)
    wrong = []
    files = [(folder, path) for folder in asked.folders for path in sorted(folder.rglob("*")) if path.is_file()]
    for (folder, path), finding in zip(files, findings([path for _, path in files]), strict=True):
        inside = path.relative_to(folder).parts
        key = (inside[0] if len(inside) > 1 else folder.name, finding.kind)
        rows[key][finding.verdict] += 1
        slowest[key] = max(slowest[key], finding.seconds)
        if finding.verdict.endswith("wrongly"):
            wrong.append(finding)
        if asked.list:
            print(
                f"{path.relative_to(folder)}: {finding.verdict}: {finding.reason} [{finding.seconds:.1f} s]",
                flush=True,
            )
    titles = ("folder", "kind", "files", *VERDICTS, "slowest [s]")
    print("| " + " | ".join(titles) + " |\n|" + "---|" * len(titles))
    for key, counts in sorted(rows.items()):
        numbers = (counts.total(), *(counts[verdict] for verdict in VERDICTS))
        print(f"| {' | '.join([*key, *map(str, numbers), f'{slowest[key]:.1f}'])} |")
    total = sum(rows.values(), Counter())
    print(f"| all | | {' | '.join(map(str, (total.total(), *(total[v] for v in VERDICTS))))} | |")
    for finding in wrong:
        print(f"- {finding.path.name}: {finding.verdict}: {finding.reason}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
