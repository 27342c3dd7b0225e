"""Plain-text tables for a terminal."""

from __future__ import annotations

from collections.abc import Sequence


def text_table(rows: Sequence[Sequence[str]], text_columns: int) -> list[str]:
    """Lines of a table indented by two spaces: the first `text_columns` columns left-aligned, the others right-aligned.

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
            f"{cell:<{width}}" if i < text_columns else f"{cell:>{width}}"
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append(("  " + "  ".join(cells)).rstrip())
    return lines
