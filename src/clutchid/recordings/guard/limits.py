"""How much memory and time the reader process may take, and what is said when it takes more."""

from __future__ import annotations

import os
import re

from clutchid.errors import ParameterError

MEMORY_VARIABLE, SECONDS_VARIABLE = "CLUTCHID_READER_MEMORY", "CLUTCHID_READER_SECONDS"

_MEMORY = 1_250_000_000
_SECONDS = 60.0

#: Bytes of a file for which the reader has a further second, as a large sound file takes long.
_BYTES_PER_SECOND = 1e6

_SIZE = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(GB|MB)\s*", re.IGNORECASE)


def memory() -> int:
    """Bytes that the reader process may have in memory: 1.25 GB, or as the user has set it.

    Raises
    ------
    ParameterError
        If the environment variable is not a size.
    """
    text = os.environ.get(MEMORY_VARIABLE)
    if text is None:
        return _MEMORY
    match = _SIZE.fullmatch(text)
    if match is None:
        raise ParameterError(f"{MEMORY_VARIABLE} = '{text}': a size in MB or GB is needed, for example 4GB.")
    return int(float(match[1]) * (1e9 if match[2].upper() == "GB" else 1e6))


def seconds(size: int) -> float:
    """Time in s that one answer about a file of `size` bytes may take.

    Raises
    ------
    ParameterError
        If the environment variable is not a time.
    """
    text = os.environ.get(SECONDS_VARIABLE)
    try:
        least = _SECONDS if text is None else float(text)
    except ValueError:
        raise ParameterError(f"{SECONDS_VARIABLE} = '{text}': a time in s is needed, for example 300.") from None
    return least + size / _BYTES_PER_SECOND


def too_large() -> str:
    """End of the sentence about a file that needs more memory than the reader process may have."""
    return (
        f"needs more than {memory() / 1e9:.3g} GB to be read; save only the channels that are needed, convert it to "
        f"Parquet, or allow more with the environment variable {MEMORY_VARIABLE}=4GB."
    )


def too_long(limit: float) -> str:
    """End of the sentence about a file that takes longer than `limit` in s."""
    return (
        f"was not read within {limit:.0f} s, so it is damaged or very slow to read; copy it again, or allow more with "
        f"the environment variable {SECONDS_VARIABLE}=600."
    )
