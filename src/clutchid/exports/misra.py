"""Rules of MISRA C:2012 that cppcheck's addon reports for an export, with the reason of each."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Deviation(NamedTuple):
    """A rule that is not kept: at how many places at most in the sources of an export, and why."""

    places: int
    reason: str


#: The program that reports them, and its command.
CHECKER = "cppcheck 2.22.0", "cppcheck --addon=misra --enable=style --std=c99 src/*.c"

#: By the number of the rule. `tests/exports/test_misra.py` counts them in the sources of every method.
DEVIATIONS: Mapping[str, Deviation] = MappingProxyType({
    "2.2": Deviation(2, "a method without free parameters has sums over none of them"),
    "8.7": Deviation(10, "functions for your tasks are called from no file of the export itself"),
    "8.14": Deviation(8, "restrict says that rows of a matrix do not overlap, which saves loads"),
    "10.3": Deviation(40, "a condition is kept in an int, 0 or 1, so that C99's _Bool is not needed"),
    "12.2": Deviation(1, "the bit of a flag is a shift by its number, which is below 32"),
    "15.5": Deviation(11, "no derivatives, a short lag, a run that is not finite and verdicts return early"),
    "17.3": Deviation(6, "the barrier between two tasks is a macro, whose assembler looks like an undeclared function"),
    "21.15": Deviation(1, "the bytes of a number are copied into words for their checksum"),
})  # fmt: skip
