"""Conversions of MDF channels to physical values: asammdf's, but for texts that mean true or false.

A formula is not read, since asammdf evaluates what numexpr refuses as Python, and a file may hold any formula.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.measurements.no_value import TRUTH, means_no_value

# by the number of a conversion, in MDF 4 and in MDF 3
_ROLES_4 = {0: "none", 1: "rule", 2: "rule", 3: "formula", 4: "rule", 5: "rule", 6: "rule", 7: "text", 8: "text"}
_ROLES_3 = {65535: "none", 10: "formula", 11: "text", 12: "text"} | dict.fromkeys((0, 1, 2, 6, 7, 8, 9), "rule")
_RANGES_3 = 12


def convertible(conversion: Any, version: int) -> bool:
    """Whether an asammdf `conversion` gives numbers.

    Texts for values do not, unless a numeric rule stands beside them, or they are an "on" and an "off".
    """
    role = _role(conversion, version)
    if role == "text":
        return _has_rule(conversion, version) or _is_switch(conversion, version)
    return role in ("none", "rule")


def converted(values: NDArray[Any], conversion: Any, version: int) -> FloatArray:
    """Physical values; a value that the conversion turns into a text is NaN, 1 for "on" and 0 for "off".

    Raises
    ------
    Exception
        Whatever asammdf raises on a table that makes no sense.
    """
    role = _role(conversion, version)
    with np.errstate(all="ignore"):
        if role == "text":
            switch = not _has_rule(conversion, version)
            distinct, places = np.unique(values, return_inverse=True)
            texts = conversion.convert(distinct, as_object=True)
            return np.array([_number(text, switch) for text in texts.tolist()], dtype=np.float64)[places]
        numbers = np.asarray(values, dtype=np.float64)
        return numbers if role == "none" else np.asarray(conversion.convert(numbers), dtype=np.float64)


def has_texts(conversion: Any, version: int) -> bool:
    """Whether a conversion turns some values into texts, which are missing samples."""
    return _role(conversion, version) == "text"


def has_formula(conversion: Any, version: int) -> bool:
    """Whether a conversion is a formula."""
    return _role(conversion, version) == "formula"


def _role(conversion: Any, version: int) -> str | None:
    if conversion is None:
        return "none"
    return (_ROLES_4 if version == 4 else _ROLES_3).get(conversion.conversion_type)


def _has_rule(conversion: Any, version: int) -> bool:
    """Whether all that a conversion has beside its texts are numeric rules, and there is one."""
    if version == 3:
        return False
    rules = [rule for rule in conversion.referenced_blocks.values() if not isinstance(rule, bytes | None)]
    return bool(rules) and all(_role(rule, version) in ("none", "rule") for rule in rules)


def _is_switch(conversion: Any, version: int) -> bool:
    """Whether the texts are an "on" and an "off", and all others say that there is no value."""
    words = {_word(text) for text in _texts(conversion, version)}
    both = {TRUTH[word] for word in words if word in TRUTH} == {0.0, 1.0}
    return both and all(word == "" or means_no_value(word or "-") for word in words - TRUTH.keys())


def _texts(conversion: Any, version: int) -> Iterator[Any]:
    if version == 4 or conversion.conversion_type == _RANGES_3:
        yield from (text for text in conversion.referenced_blocks.values() if text is not None)
    else:
        yield from (conversion[f"text_{number}"] for number in range(conversion.ref_param_nr))


def _word(text: Any) -> str | None:
    """A text of asammdf as a word to compare; None where it is no text."""
    if not isinstance(text, bytes):
        return None
    return text.partition(b"\0")[0].decode("latin-1").strip().casefold()


def _number(value: object, switch: bool) -> float:
    if isinstance(value, int | float | np.number | np.bool_):
        return float("nan") if switch else float(value)
    word = _word(value) if switch else None
    return TRUTH.get(word or "", float("nan"))
