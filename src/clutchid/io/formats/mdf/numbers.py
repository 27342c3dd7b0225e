"""Numbers of MDF channels: bits of a record, then the conversion to physical values."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from clutchid.log import FloatArray

Kind = Literal["u", "i", "f"]

# by data type of MDF 4 and MDF 3: kind and whether the high byte stands first
_KINDS_4: Mapping[int, tuple[Kind, bool]] = {
    0: ("u", False), 1: ("u", True), 2: ("i", False), 3: ("i", True), 4: ("f", False), 5: ("f", True),
}  # fmt: skip
_KINDS_3: Mapping[int, tuple[Kind, bool]] = {
    0: ("u", False), 1: ("i", False), 2: ("f", False), 3: ("f", False),
    9: ("u", True), 10: ("i", True), 11: ("f", True), 12: ("f", True),
    13: ("u", False), 14: ("i", False), 15: ("f", False), 16: ("f", False),
}  # fmt: skip

# by the number of a conversion, in MDF 4 and in MDF 3
_ROLES_4 = {
    0: "none",
    1: "linear",
    2: "rational",
    3: "formula",
    4: "table",
    5: "table",
    6: "table",
    7: "text",
    8: "text",
}
_ROLES_3 = {65535: "none", 0: "linear", 9: "rational", 10: "formula"} | dict.fromkeys((1, 2, 6, 7, 8), "table")

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


@dataclass(frozen=True, slots=True)
class Bits:
    """Where the value of a channel stands in a record; `size` 0 is a value that is the number of the record itself."""

    byte: int
    bit: int
    size: int
    kind: Kind
    swapped: bool
    invalid: int | None = None

    @property
    def end(self) -> int:
        """The first byte behind the value."""
        return self.byte + (self.bit + self.size + 7) // 8


def bits_of(channel: Any, version: int) -> Bits | None:
    """Where the value of an asammdf `channel` stands; None where it is no number."""
    known = (_KINDS_4 if version == 4 else _KINDS_3).get(channel.data_type)
    if known is None:
        return None
    kind, swapped = known
    size = int(channel.bit_count)
    if version == 4:
        if channel.channel_type in (3, 6):
            return Bits(0, 0, 0, "u", False)
        if channel.channel_type not in (0, 2):
            return None
        byte, bit = int(channel.byte_offset), int(channel.bit_offset)
        invalid = int(channel.pos_invalidation_bit) if channel.flags & 2 else None
    else:
        byte, bit = divmod(int(channel.start_offset) + 8 * int(getattr(channel, "additional_byte_offset", 0)), 8)
        invalid = None
    fits = size in (16, 32, 64) and bit == 0 if kind == "f" else size > 0 and bit + size <= 64
    return Bits(byte, bit, size, kind, swapped, invalid) if fits else None


def unpacked(records: NDArray[np.uint8], bits: Bits) -> NDArray[Any]:
    """The values of a channel in `records`, one row of bytes a record.

    Examples
    --------
    A speed of 12 bits, signed, that begins at bit 4 of the first byte:

    >>> unpacked(np.array([[0xF0, 0xFF], [0x50, 0x00]], dtype=np.uint8), Bits(0, 4, 12, "i", False))
    array([-1,  5])
    """
    cells = records[:, bits.byte : bits.end]
    if bits.bit == 0 and bits.size in (8, 16, 32, 64):
        order = ">" if bits.swapped else "<"
        column: NDArray[Any] = cells.view(f"{order}{bits.kind}{bits.size // 8}")[:, 0]
        return column
    wide = np.zeros((len(cells), 8), dtype=np.uint8)
    wide[:, : cells.shape[1]] = cells[:, ::-1] if bits.swapped else cells
    high = np.uint64(64 - bits.bit - bits.size)
    aligned = wide.view("<u8")[:, 0] << high
    down = 64 - bits.size
    return aligned.view("<i8") >> np.int64(down) if bits.kind == "i" else aligned >> np.uint64(down)


def valid(invalidation: NDArray[np.uint8], bit: int) -> NDArray[np.bool_]:
    """Which records are valid by their invalidation `bit`."""
    column: NDArray[np.bool_] = (invalidation[:, bit // 8] >> (bit % 8)) & 1 == 0
    return column


def convertible(conversion: Any, version: int) -> bool:
    """Whether an asammdf `conversion` gives numbers; texts for values do not, but for a numeric rule beside them."""
    role = _role(conversion, version)
    if role == "formula":
        return formula(str(conversion.formula)) is not None
    if role == "text":
        rules = [rule for rule in conversion.referenced_blocks.values() if not isinstance(rule, bytes | None)]
        return bool(rules) and all(_role(rule, version) in ("none", "linear", "rational", "table") for rule in rules)
    return role is not None


def converted(values: NDArray[Any], conversion: Any, version: int) -> FloatArray:
    """Physical values; a value that the conversion turns into a text is NaN.

    Raises
    ------
    Exception
        Whatever asammdf raises on a table that makes no sense.
    """
    role = _role(conversion, version)
    with np.errstate(all="ignore"):
        if role == "linear":
            factor, offset = float(conversion.a), float(conversion.b)
            plain = values.astype(np.float64)
            return plain if (factor, offset) == (1.0, 0.0) else plain * factor + offset
        if role == "rational":
            return _rational(values.astype(np.float64), conversion)
        if role == "formula":
            rule = formula(str(conversion.formula))
            assert rule is not None
            return np.asarray(np.broadcast_to(rule(values.astype(np.float64)), values.shape), dtype=np.float64)
        if role == "table":
            return np.asarray(conversion.convert(values), dtype=np.float64)
        if role == "text":
            distinct, places = np.unique(values, return_inverse=True)
            texts = conversion.convert(distinct, as_object=True)
            return np.array([_number(text) for text in texts.tolist()], dtype=np.float64)[places]
    return np.asarray(values, dtype=np.float64)


def formula(text: str) -> Callable[[FloatArray], Any] | None:
    """The function of X that `text` states; None where it is anything but arithmetic.

    A formula comes from a file, so it is never evaluated as Python.

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


def _rational(x: FloatArray, rule: Any) -> FloatArray:
    p1, p2, p3, p4, p5, p6 = (float(getattr(rule, f"P{number}")) for number in range(1, 7))
    if (p1, p4, p5) == (0, 0, 0):  # the common case, without rounding twice
        return np.asarray((p2 * x + p3) / p6)
    return np.asarray((p1 * x**2 + p2 * x + p3) / (p4 * x**2 + p5 * x + p6))


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float | np.number | np.bool_) else float("nan")
