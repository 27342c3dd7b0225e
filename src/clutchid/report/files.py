"""Write text and images to files atomically."""

from __future__ import annotations

from os import PathLike

from clutchid.io.files import atomic_write


def write_text(text: str, path: str | PathLike[str]) -> None:
    """Write `text` in UTF-8 to `path`, atomically; bytes of file names that are not UTF-8 become question marks.

    Raises
    ------
    ExportError
        If it cannot be written; an existing file stays unchanged.
    """
    write_bytes(text.encode("utf-8", "replace"), path)


def write_bytes(content: bytes, path: str | PathLike[str]) -> None:
    """Write `content` to `path`, atomically.

    Raises
    ------
    ExportError
        If it cannot be written; an existing file stays unchanged.
    """
    with atomic_write(path) as temporary:
        temporary.write_bytes(content)
