"""Rules of MISRA C:2012 that cppcheck's addon reports for an export, with the reason of each."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import NamedTuple

from clutchid.codegen.templates import template


class Finding(NamedTuple):
    """A rule that the addon reports: its category, at how many places at most by source, and why."""

    category: str
    places: Mapping[str, int]
    reason: str


#: The program that reports them, and its command.
CHECKER = "cppcheck 2.22.0", "cppcheck --addon=misra --enable=style --std=c99"

_LIST = tomllib.loads(template("misra.toml", "clutchid.exports").render())

#: By the number of the rule. `tests/exports/test_misra.py` counts them in the sources of every method.
FINDINGS = {rule: Finding(**row) for rule, row in _LIST.items()}
