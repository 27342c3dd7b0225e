"""Where the tables of a fleet lie: a folder, or what stands for one; files by their names in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

from clutchid.files import make_folder, write_bytes


class Storage(Protocol):
    """Files by their names, which are paths with `/`."""

    def names(self, under: str) -> Iterator[str]:
        """Names that begin with a prefix."""

    def read(self, name: str) -> bytes:
        """Content of a file."""

    def write(self, name: str, content: bytes) -> None:
        """Write a file, which is whole or not there."""

    def delete(self, names: Iterable[str]) -> None:
        """Delete files, also some that are not there any more."""


class FolderStorage(NamedTuple):
    """A folder of this machine, or of a share."""

    path: Path

    def names(self, under: str) -> Iterator[str]:
        """Names that begin with a prefix, which ends at a folder."""
        for path in sorted((self.path / under).rglob("*")):
            if path.is_file():
                yield path.relative_to(self.path).as_posix()

    def read(self, name: str) -> bytes:
        """Content of a file."""
        return (self.path / name).read_bytes()

    def write(self, name: str, content: bytes) -> None:
        """Write a file and its folders; on any error, an existing one is unchanged."""
        make_folder((self.path / name).parent)
        write_bytes(content, self.path / name)

    def delete(self, names: Iterable[str]) -> None:
        """Delete files, also some that are not there any more."""
        for name in names:
            (self.path / name).unlink(missing_ok=True)
