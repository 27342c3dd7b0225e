"""Parts of messages and tables for people: values with units, counts, lists and names that are not too long."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from clutchid.names import printable

#: Number of locations or names that a message lists before it counts the rest.
SHOWN = 5


def quantity(value: float, unit: str | None) -> str:
    """A value with its unit, for a message.

    Examples
    --------
    >>> quantity(0.25, "s"), quantity(1.2, "1")
    ('0.25 s', '1.2')
    """
    return f"{value:.10g}" + (f" {unit}" if unit not in (None, "1") else "")


def sample_count(count: int) -> str:
    """A number of samples, for a message."""
    return f"{count:,} sample{'' if count == 1 else 's'}"


def listed(texts: Iterable[str], most: int = SHOWN, total: int | None = None) -> str:
    """The first `most` texts, and the number of the others; `total` is the number of all, if not all are given.

    Examples
    --------
    >>> listed(["line 4", "line 7", "line 9"], 2), listed(["line 4"], total=3)
    ('line 4, line 7 and 1 more', 'line 4 and 2 more')
    """
    all_texts = list(texts)
    shown = all_texts[:most]
    rest = (len(all_texts) if total is None else total) - len(shown)
    return ", ".join(shown) + (f" and {rest} more" if rest else "")


def shortened(text: str, length: int = 40) -> str:
    """`text` on one line and not longer than `length`, for a message."""
    line = printable(" ".join(text.split()))
    return line if len(line) <= length else line[: length - 1] + "…"


def text_table(rows: Sequence[Sequence[str]], text_columns: int, indent: str = "  ") -> list[str]:
    """Lines of an indented table: the first `text_columns` columns left-aligned, the others right-aligned.

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
        lines.append((indent + "  ".join(cells)).rstrip())
    return lines
