"""TOML files that people write: parameter files and channel maps."""

from __future__ import annotations

import tomllib
from os import PathLike
from typing import Any

from clutchid.errors import ParameterError
from clutchid.recordings.files import small_file

#: Bytes of a TOML file; the largest that clutchid writes, a calibration with many recordings, has a fifth of it.
LARGEST = 4_000_000


def read_toml(path: str | PathLike[str], what: str) -> dict[str, Any]:
    """Contents of a TOML file, with or without a byte-order mark; `what` names the kind of file in messages.

    Raises
    ------
    DataError
        If there is no readable plain file, or it is too large for what it should be.
    ParameterError
        If it is no TOML.
    """
    return toml_of(small_file(path, what, LARGEST), path, what)


def toml_of(content: bytes, path: str | PathLike[str], what: str) -> dict[str, Any]:
    """The `content` of the TOML file at `path`, as `read_toml`.

    Raises
    ------
    ParameterError
        If it is no TOML.
    """
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except RecursionError:
        raise ParameterError(f"{path}: is no {what}: its lists are nested too deeply.") from None
    except ValueError as error:  # no UTF-8, no TOML, or an integer of thousands of digits
        reason = "a number has too many digits" if "digits" in str(error) else error
        raise ParameterError(f"{path}: is no TOML file ({reason}).") from None
