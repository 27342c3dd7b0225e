"""``clutchid cut``: cut a long recording into strokes and rests, and select the most informative strokes."""

from __future__ import annotations

from pathlib import Path

from clutchid.cli.common import DONE, FileOptions, OutOption, OutputFlag, guarded, print_written, progress_bar
from clutchid.documents.console import put, say
from clutchid.errors import DataError
from clutchid.verbs.options import USUAL_FILES


@guarded
def cut(
    recording: Path,
    /,
    *,
    out: OutOption,
    seconds: float = 60.0,
    files: FileOptions = USUAL_FILES,
    debug: OutputFlag = False,
) -> int:
    """Cut a long recording into strokes and rests, and write those with the most information about the load.

    The recording is read in pieces, so a day at 1 kHz needs no more memory than a minute.

    Parameters
    ----------
    recording
        Recording in any format that `clutchid look` reads.
    out
        Selected strokes as one recording with gaps between them (.parquet, .csv, .mf4 or .mat), for `fit`.
    seconds
        Greatest total length of the selected strokes in s.
    debug
        Show the traceback of an error.
    """
    from clutchid.verbs.cutting import cut_file
    from clutchid.verbs.saving import check_outputs, write_log

    check_outputs({"--out": out}, [("the recording itself", recording)])
    with progress_bar("cut") as show:
        best = cut_file(files.reading([recording]), seconds, say, show)
    put(best.counts)
    say(best.divisions)
    if best.log is None:
        raise DataError(f"{recording}: no usable stroke of at most {seconds:g} s was found; nothing was written.")
    write_log(best.log, out)
    put(best.chosen)
    print_written(out)
    return DONE
