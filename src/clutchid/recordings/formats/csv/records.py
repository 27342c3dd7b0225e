"""Records of a CSV file: lines, joined where a cell in quotes contains line breaks."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from clutchid.recordings.formats.csv.header import is_comment
from clutchid.recordings.formats.csv.lines import Block

#: The end of a line is in a quoted cell that is not closed there; a quote inside a cell is written twice.
_OPEN = re.compile(r'(?:^|[,;\t|]) *"(?:[^"]|"")*$')

#: Largest number of lines of a record above the samples, and of bytes of a block; a quote beyond them is a character.
_MOST_LINES = 100
_MOST_BYTES = 1 << 26


def records(lines: Sequence[str]) -> list[tuple[int, str]]:
    """Number of the first line, and text, of every record.

    Examples
    --------
    >>> records(['t,"piston', 'travel [mm]"', '0,1', 'a 5" pipe'])
    [(1, 't,"piston\\ntravel [mm]"'), (3, '0,1'), (4, 'a 5" pipe')]
    """
    found, at = [], 0
    while at < len(lines):
        end = _end(lines, at)
        found.append((at + 1, "\n".join(lines[at:end])))
        at = end
    return found


def _end(lines: Sequence[str], start: int) -> int:
    """Index after the last line of the record that begins at `start`."""
    line = lines[start]
    quotes = line.count('"')
    if quotes % 2 and not is_comment(line, ";") and _OPEN.search(line):
        for end in range(start + 1, min(start + _MOST_LINES, len(lines))):
            quotes += lines[end].count('"')
            if quotes % 2 == 0:
                return end + 1
    return start + 1


def whole_records(blocks: Iterator[Block]) -> Iterator[Block]:
    """Blocks, joined where one ends in a quoted cell."""
    held: Block | None = None
    for block in blocks:
        whole = block if held is None else Block(held.first, held.text + block.text, held.lines + block.lines)
        held = whole if whole.text.count(b'"') % 2 and len(whole.text) < _MOST_BYTES else None
        if held is None:
            yield whole
    if held is not None:
        yield held
