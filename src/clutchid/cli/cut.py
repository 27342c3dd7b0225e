"""``clutchid cut``: cut a long recording into strokes and rests, and select the most informative strokes."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.cli.common import (
    DONE,
    FileOptions,
    OutOption,
    OutputFlag,
    PathOutput,
    check_outputs,
    guarded,
    pieces_of,
    print_written,
    progress_bar,
)
from clutchid.cli.terminal import put
from clutchid.errors import DataError
from clutchid.verbs.options import USUAL_FILES

if TYPE_CHECKING:
    from clutchid.strokes import Section


@guarded
def cut(
    recording: Path,
    /,
    *,
    out: OutOption,
    table: PathOutput = None,
    seconds: float = 60.0,
    files: FileOptions = USUAL_FILES,
    debug: OutputFlag = False,
) -> int:
    """Cut a long recording into strokes and rests, and write those with the most information about the load.

    The recording is read in pieces, so that a day at 1 kHz needs no more memory than a minute.

    Parameters
    ----------
    recording
        Recording in any format that `clutchid look` reads.
    out
        Selected strokes as one recording with holes between them (.parquet, .csv, .mf4 or .mat), for `fit`.
    table
        CSV list of all strokes and rests to write: label, start, reach, speeds, vented rest, missing samples.
    seconds
        Greatest total length of the selected strokes in s.
    debug
        Show the traceback of an error.
    """
    from clutchid.files import atomic_write
    from clutchid.measurements import write
    from clutchid.strokes import choose, joined, sections_table
    from clutchid.strokes import cut as sections_of

    check_outputs({"--out": out, "--table": table}, [("the recording itself", recording)])
    counts: Counter[str] = Counter()
    with progress_bar("cut") as show:
        pieces = pieces_of(recording, files, show)
        sections = sections_of(pieces)
        if table is None:
            chosen = choose(_counted(sections, counts, lambda _: None), seconds)
        else:
            with atomic_write(table) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
                chosen = choose(_counted(sections, counts, csv.writer(file).writerow), seconds)
    put(", ".join(f"{count:,} {label}" for label, count in counts.most_common()))
    if not chosen:
        raise DataError(f"{recording}: no usable stroke of at most {seconds:g} s was found; nothing is written.")
    write(joined(chosen), out)
    put(f"\n{sections_table(chosen)}\n")
    print_written(out, table)
    return DONE


def _counted(
    sections: Iterable[Section], counts: Counter[str], write_row: Callable[[Iterable[object]], object]
) -> Iterator[Section]:
    """The sections, counted by label and written to the table one by one."""
    for number, section in enumerate(sections, 1):
        summary = asdict(section.summary)
        if number == 1:
            heads = [name + _UNITS.get(name, "") for name in summary]
            write_row(["number", "kind", "label", "first_sample", "start_s", "departure_s", "end_s", *heads])
        ends = (section.start, section.departure, section.end)
        write_row([number, section.kind, section.label, section.first, *ends, *summary.values()])
        counts[section.label] += 1
        yield section


_UNITS = {
    **dict.fromkeys(("lowest", "highest", "level", "reach"), "_m"),
    **dict.fromkeys(("opening_speed", "closing_speed"), "_m_s"),
    "vented_rest": "_s",
}
