"""Text and pictures into files, whole or not at all."""

from __future__ import annotations

from os import PathLike

from clutchid.io.files import atomic_write


def write_text(text: str, path: str | PathLike[str]) -> None:
    """`text` in UTF-8 at `path`, in one step.

    Raises
    ------
    ExportError
        If it cannot be written; an older file stays as it was.
    """
    write_bytes(text.encode("utf-8"), path)


def write_bytes(content: bytes, path: str | PathLike[str]) -> None:
    """`content` at `path`, in one step.

    Raises
    ------
    ExportError
        If it cannot be written; an older file stays as it was.
    """
    with atomic_write(path) as temporary:
        temporary.write_bytes(content)
