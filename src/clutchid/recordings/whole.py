"""How large a recording may be that is read as a whole."""

from __future__ import annotations

import math
from pathlib import Path

from clutchid.errors import DataError
from clutchid.recordings.guard.limits import MEMORY_VARIABLE, memory

#: Part of the memory limit that the values of a recording may take as a whole: reading holds them up to four times.
_PART = 0.4


def check_size(path: Path, samples: int, channels: int) -> None:
    """Check, before a sample is read, that as many `samples` of as many `channels` as the file has fit into memory.

    Raises
    ------
    DataError
        If their values take more than a part of the memory limit.
    """
    size, most = 8 * samples * channels, _PART * memory()
    if size > most:
        raise DataError(
            f"{path}: its {samples:,} samples of {channels} channels take {size / 1e9:.3g} GB in memory, more than the "
            f"{most / 1e9:.3g} GB that are read as a whole; cut out what is needed with `clutchid cut`, or allow more "
            f"with the environment variable {MEMORY_VARIABLE}={math.ceil(size / _PART / 1e9)}GB."
        )
