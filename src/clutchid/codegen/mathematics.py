"""Mathematical functions of vectors, as instructions: LLVM has one by one what is no instruction of the processor.

exp, log and pow are polynomials, to 4 units in the last place for results of usual size. Where an argument of a lane is
not (near overflow, no positive number), all lanes have what the library gives.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from clutchid.codegen.llvm import Writer

#: Coefficients of exp r for |r| up to log(2) / 2, and behind the first of log(m) / s in s^2, with s = (m - 1) / (m + 1)
#: and m from sqrt(1/2) to sqrt(2): the series of Taylor, as far as a double shows it.
_EXP = [1.0 / math.factorial(k) for k in range(14)]
_LOG = [2.0 / (2 * k + 3) for k in range(10)]

#: log 2 in two parts, the first so short that its products with exponents are exact.
_LOG_2 = (float.fromhex("0x1.62e42fefa3800p-1"), float.fromhex("0x1.ef35793c76730p-45"))

#: Where exp comes near the ends of the range of a double.
_LARGE = 700.0

#: Bits of 1, and of sqrt(1/2), as a whole number.
_ONE, _ROOT = 0x3FF << 52, 0x3FE6A09E667F3BCD


def function(w: Writer, name: str, *values: str) -> str:
    """A function of vectors."""
    if name == "sqrt":
        return _intrinsic(w, name, values[0])
    if name == "exp":
        return _unless_rare(w, name, values, _exp(w, values[0]), [_large(w, values[0])])
    if name == "log":
        return _unless_rare(w, name, values, _log(w, values[0]), _beyond(w, values[0]))
    if name == "pow":
        logarithm = w.chain("fmul", [values[1], _log(w, values[0])])
        return _unless_rare(w, name, values, _exp(w, logarithm), [*_beyond(w, values[0]), _large(w, logarithm)])
    return _by_lane(w, name, values)


def _by_lane(w: Writer, name: str, values: Sequence[str]) -> str:
    """A function, lane by lane."""
    result = "poison"
    for lane in range(w.lanes):
        number = w.called(name, *(w.new(f"extractelement {w.real} {value}, i64 {lane}") for value in values))
        result = w.new(f"insertelement {w.real} {result}, double {number}, i64 {lane}")
    return result


def _unless_rare(w: Writer, name: str, arguments: Sequence[str], usual: str, rare: Sequence[str]) -> str:
    """The value `usual`; where a condition of `rare` holds in a lane, in all lanes that of the library."""
    first, *others = rare
    for other in others:
        first = w.new(f"or {w.truth} {first}, {other}")
    return w.where(w.any(w.masked(w.mask, first)), [usual], lambda: [_by_lane(w, name, arguments)])[0]


def _intrinsic(w: Writer, name: str, value: str) -> str:
    return w.new(f"call {w.real} @llvm.{name}.v{w.lanes}f64({w.real} {value})")


def _large(w: Writer, x: str) -> str:
    return w.compared("ugt", _intrinsic(w, "fabs", x), w.constant(_LARGE))


def _beyond(w: Writer, x: str) -> list[str]:
    """Where x is no positive number of full precision."""
    least, most = w.constant(sys.float_info.min), w.constant(sys.float_info.max)
    return [w.compared("ult", x, least), w.compared("ugt", x, most)]


def _exp(w: Writer, x: str) -> str:
    """exp x = 2^k exp r; k is whole, as it is the last bits of a sum in which no others have place."""
    hidden, r = w.constant(1.5 * 2.0**52), x
    total = _strict(w, "fadd", _strict(w, "fmul", x, w.constant(1.0 / math.log(2.0))), hidden)
    k = _strict(w, "fsub", total, hidden)
    for part in _LOG_2:
        r = _strict(w, "fsub", r, _strict(w, "fmul", k, w.constant(part)))
    scale = _whole(w, "shl", _bits(w, total), 52)
    return _number(w, _whole(w, "add", _bits(w, _polynomial(w, r, _EXP)), scale))


def _log(w: Writer, x: str) -> str:
    """log x = k log 2 + log m with m from sqrt(1/2) to sqrt(2)."""
    bits, unit = _bits(w, x), w.constant(1.0)
    k = _whole(w, "lshr", _whole(w, "add", bits, _ONE - _ROOT), 52)
    m = _number(w, _whole(w, "add", _whole(w, "sub", bits, _whole(w, "shl", k, 52)), _ONE))
    whole = _number(w, _whole(w, "or", k, 0x433 << 52))
    exponent = _strict(w, "fsub", whole, w.constant(2.0**52 + 1023))
    s = w.chain("fdiv", [w.chain("fsub", [m, unit]), w.chain("fadd", [m, unit])])
    square = w.chain("fmul", [s, s])
    tail = w.chain("fmul", [square, _polynomial(w, square, _LOG)])
    logarithm = w.chain("fmul", [s, w.chain("fadd", [w.constant(2.0), tail])])
    return _strict(w, "fadd", _strict(w, "fmul", exponent, w.constant(math.log(2.0))), logarithm)


def _strict(w: Writer, operation: str, a: str, b: str) -> str:
    """A sum or product whose terms stay in their order."""
    return w.new(f"{operation} contract {w.real} {a}, {b}")


def _polynomial(w: Writer, x: str, coefficients: Sequence[float]) -> str:
    """A polynomial, by Estrin's scheme."""
    terms = [w.constant(coefficient) for coefficient in coefficients]
    while len(terms) > 1:
        pairs = zip(terms[::2], terms[1::2], strict=False)
        joined = [w.chain("fadd", [a, w.chain("fmul", [x, b])]) for a, b in pairs]
        terms, x = joined + terms[len(joined) * 2 :], w.chain("fmul", [x, x])
    return terms[0]


def _bits(w: Writer, x: str) -> str:
    return w.new(f"bitcast {w.real} {x} to <{w.lanes} x i64>")


def _number(w: Writer, bits: str) -> str:
    return w.new(f"bitcast <{w.lanes} x i64> {bits} to {w.real}")


def _whole(w: Writer, operation: str, value: str, other: str | int) -> str:
    """An operation on whole numbers."""
    other = f"splat (i64 {other})" if isinstance(other, int) else other
    return w.new(f"{operation} <{w.lanes} x i64> {value}, {other}")
