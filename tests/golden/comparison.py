"""Comparison of results with kept ones: one tolerance for all machines, and the list of what is different."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from clutchid.log import FloatArray

#: How the name of a column ends, whose leaf is that of `some`.
SOME = " samples"

#: How the names of lists end whose numbers have one unit, and may pass through zero.
ONE_UNIT = ("_N", "_m", "_percent", "/force", "/correlation")

#: A number in a sentence.
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def differences(golden: Mapping[str, Any], now: Mapping[str, Any], tolerance: Callable[[str], float]) -> list[str]:
    """Results that are not what they were, one line each.

    A number may differ by the `tolerance` of its name times its `scale`. Of sentences all words are compared, and all
    numbers at their printed digits. Rounding to these digits turns one of them in about a million, by one unit of the
    last, so that in a whole group one may be different.
    """
    lines = [f"{name}: kept, but not there now." for name in golden if name not in now]
    lines += [f"{name}: new." for name in now if name not in golden]
    turned: list[tuple[tuple[str, ...], str]] = []
    for name in (name for name in golden if name in now):
        old, new = golden[name], now[name]
        if isinstance(old, str) and isinstance(new, str):
            if old != new:
                line = f"{name}:\n    kept {old}\n    now  {new}"
                pair = turned_digits(old, new)
                if pair is None:
                    lines.append(line)
                else:
                    turned.append((pair, line))
        elif line := different(name, old, new, tolerance(name)):
            lines.append(f"{name}: {line}")
    return lines + ([line for _, line in turned] if len({pair for pair, _ in turned}) > 1 else [])


def some(columns: Mapping[str, FloatArray], count: int) -> dict[str, list[float]]:
    """Every column but the duty cycles as its range, its rms, and a `count` of samples or one more."""
    return {
        name + SOME: [
            float(np.nanmax(values) - np.nanmin(values)),
            float(np.sqrt(np.nanmean(values**2))),
            *np.asarray(values)[:: len(values) // count].tolist(),
        ]
        for name, values in columns.items()
        if not name.startswith("duty_")
    }


def scale(name: str, value: Any) -> FloatArray:
    """Sizes that the tolerance is a share of: of a number, the largest of its list, or the range of its column."""
    sizes = np.nan_to_num(np.abs(as_numbers(value)), nan=0.0, posinf=0.0)
    if sizes.size == 0 or not name.endswith((SOME, *ONE_UNIT)):
        return sizes
    return np.full(sizes.size, sizes[0] if name.endswith(SOME) else sizes.max())


def different(name: str, old: Any, new: Any, tolerance: float) -> str:
    """The worst difference of numbers beyond the allowed one, or of anything else; empty if there is none."""
    if any(value is None or isinstance(value, (bool, int, str)) for value in (old, new)):
        return "" if type(old) is type(new) and old == new else f"kept {old!r}, now {new!r}"
    first, other = as_numbers(old), as_numbers(new)
    if first.shape != other.shape:
        return f"kept {first.size} values, now {other.size}"
    same = (first == other) | (np.isnan(first) & np.isnan(other))
    with np.errstate(invalid="ignore"):
        apart = np.where(same, 0.0, np.nan_to_num(np.abs(first - other), nan=np.inf))
    allowed = tolerance * scale(name, old)
    if np.all(apart <= allowed):
        return ""
    at = int(np.argmax(apart / np.maximum(allowed, np.finfo(float).tiny)))
    place = f"[{at}]" if isinstance(old, list) else ""
    return f"kept {first[at]:.10g}, now {other[at]:.10g}{place}: {apart[at]:.2g} apart, allowed {allowed[at]:.2g}"


def as_numbers(values: Any) -> FloatArray:
    """A number or a list of numbers, in which None is not a number."""
    return np.array([np.nan if value is None else value for value in np.ravel(values).tolist()], dtype=float)


def turned_digits(old: str, new: str) -> tuple[str, ...] | None:
    """The one number, before and after, that rounding to its digits has turned; None if there is another difference."""
    if NUMBER.sub("#", old) != NUMBER.sub("#", new):
        return None
    pairs = {(a, b) for a, b in zip(NUMBER.findall(old), NUMBER.findall(new), strict=True) if a != b}
    if len(pairs) != 1:
        return None
    before, after = pairs.pop()
    return (before, after) if abs(float(before) - float(after)) <= 1.001 * max(unit(before), unit(after)) else None


def unit(number: str) -> float:
    """Unit of the last printed digit."""
    mantissa, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
