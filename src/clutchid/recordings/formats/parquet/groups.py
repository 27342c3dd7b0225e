"""Parquet row groups appended to one file: the footer of all of them from the footers of single files."""

from __future__ import annotations

from typing import NamedTuple

from clutchid.recordings.formats.parquet.thrift import Compact, Tree, encoded

#: Bytes at the start and at the end of a Parquet file.
MAGIC = b"PAR1"

#: Fields of the footer: samples, row groups; of a row group: columns, its first byte, its number.
_ROWS, _GROUPS, _COLUMNS, _GROUP_OFFSET, _ORDINAL = 3, 4, 1, 5, 7

#: Fields that are places in the file: of a column, and of its description (field 3).
_COLUMN_OFFSETS, _DESCRIPTION, _PAGE_OFFSETS = (2, 4, 6), 3, (9, 10, 11, 14)


class Groups(NamedTuple):
    """Row groups that are in a file up to the byte `end`, and its footer, None before the first.

    Each group of the footer is encoded once, when it is added, so that a footer costs no more the longer a file grows.
    """

    end: int = len(MAGIC)
    footer: Tree | None = None


def appended(groups: Groups, whole: bytes) -> tuple[Groups, bytes]:
    """Row groups with those of another whole file behind them, and the bytes to write at ``groups.end``."""
    length = int.from_bytes(whole[-8:-4], "little")
    cut = len(whole) - 8 - length
    new, shift = Compact(whole[cut:-8]).struct(), groups.end - len(MAGIC)
    before = [] if groups.footer is None else groups.footer[_GROUPS][1][1]
    kind, (inner, added) = new[_GROUPS]
    moved = [encoded(_moved(group, shift, len(before) + i)) for i, group in enumerate(added)]
    rows = new[_ROWS][1] + (0 if groups.footer is None else groups.footer[_ROWS][1])
    footer = {**new, _ROWS: (new[_ROWS][0], rows), _GROUPS: (kind, (inner, [*before, *moved]))}
    return Groups(shift + cut, footer), whole[len(MAGIC) : cut]


def footer_bytes(groups: Groups) -> bytes:
    """What stands behind the row groups in a whole file."""
    content = encoded(groups.footer or {})
    return content + len(content).to_bytes(4, "little") + MAGIC


def _moved(group: Tree, shift: int, number: int) -> Tree:
    kind, (inner, columns) = group[_COLUMNS]
    found = {**group, _COLUMNS: (kind, (inner, [_column(one, shift) for one in columns]))}
    if _ORDINAL in group:
        found[_ORDINAL] = (group[_ORDINAL][0], number)
    return _shifted(found, (_GROUP_OFFSET,), shift)


def _column(column: Tree, shift: int) -> Tree:
    kind, description = column[_DESCRIPTION]
    found = {**column, _DESCRIPTION: (kind, _shifted(description, _PAGE_OFFSETS, shift))}
    return _shifted(found, _COLUMN_OFFSETS, shift)


def _shifted(tree: Tree, fields: tuple[int, ...], shift: int) -> Tree:
    """A structure whose places in the file are moved; 0 is none."""
    return {
        field: (kind, value + shift if field in fields and value else value) for field, (kind, value) in tree.items()
    }
