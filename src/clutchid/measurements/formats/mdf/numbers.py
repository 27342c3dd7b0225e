"""Conversions of MDF channels to physical values: asammdf's, but for formulas and texts that mean true or false.

asammdf evaluates a formula that numexpr refuses as Python; a file may hold any formula, so it is parsed here.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray
from clutchid.measurements.no_value import TRUTH, means_no_value

# by the number of a conversion, in MDF 4 and in MDF 3
_ROLES_4 = {0: "none", 1: "rule", 2: "rule", 3: "formula", 4: "rule", 5: "rule", 6: "rule", 7: "text", 8: "text"}
_ROLES_3 = {65535: "none", 10: "formula", 11: "text", 12: "text"} | dict.fromkeys((0, 1, 2, 6, 7, 8, 9), "rule")
_RANGES_3 = 12

_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: np.power, ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "arcsin": np.arcsin, "arccos": np.arccos, "arctan": np.arctan, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh,
    "exp": np.exp, "log": np.log, "ln": np.log, "log10": np.log10, "sqrt": np.sqrt, "abs": np.abs, "pow": np.power,
}  # fmt: skip
_LONGEST_FORMULA = 500


def convertible(conversion: Any, version: int) -> bool:
    """Whether an asammdf `conversion` gives numbers.

    Texts for values do not, unless a numeric rule stands beside them, or they are an "on" and an "off".
    """
    role = _role(conversion, version)
    if role == "formula":
        return formula(str(conversion.formula)) is not None
    if role == "text":
        return _has_rule(conversion, version) or _is_switch(conversion, version)
    return role is not None


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
        if role == "formula":
            rule = formula(str(conversion.formula))
            assert rule is not None
            return np.asarray(np.broadcast_to(rule(numbers), numbers.shape), dtype=np.float64)
        return numbers if role == "none" else np.asarray(conversion.convert(numbers), dtype=np.float64)


def has_texts(conversion: Any, version: int) -> bool:
    """Whether a conversion turns some values into texts, which are missing samples."""
    return _role(conversion, version) == "text"


def formula(text: str) -> Callable[[FloatArray], Any] | None:
    """The function of X that `text` states; None where it is anything but arithmetic.

    Examples
    --------
    >>> formula("0.1*X1^2 + sqrt(X)")(np.array([4.0]))
    array([3.6])
    >>> formula("__import__('os')") is None
    True
    """
    if len(text) > _LONGEST_FORMULA:
        return None
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval").body
        _value(tree, np.ones(1))
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        return None
    return lambda values: _value(tree, values)


def _value(node: ast.expr, x: FloatArray) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return np.float64(number)
        case ast.Name(id="X" | "X1" | "x" | "x1"):
            return x
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _OPERATORS:
            with np.errstate(all="ignore"):
                return _OPERATORS[type(sign)](_value(left, x), _value(right, x))
        case ast.UnaryOp(op=sign, operand=operand) if type(sign) in _OPERATORS:
            return _OPERATORS[type(sign)](_value(operand, x))
        case ast.Call(func=ast.Name(id=name), args=values, keywords=[]) if name.lower() in _FUNCTIONS:
            with np.errstate(all="ignore"):
                return _FUNCTIONS[name.lower()](*(_value(value, x) for value in values))
    raise ValueError(ast.dump(node))


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
