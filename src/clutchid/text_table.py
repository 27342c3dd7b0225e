"""Tables as plain text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence


def text_table(rows: Sequence[Sequence[str]], words: int) -> list[str]:
    """Lines of a table, two blanks in: the first `words` columns to the left, numbers to the right.

    Examples
    --------
    >>> print(*text_table([("name", "value"), ("P_S", "9e5"), ("M", "10")], 1), sep="|")
      name  value|  P_S     9e5|  M        10
    """
    if not rows:
        return []
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            f"{cell:<{width}}" if i < words else f"{cell:>{width}}"
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append(("  " + "  ".join(cells)).rstrip())
    return lines
