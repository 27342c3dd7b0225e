"""What the texts in a MATLAB struct say of the channels beside them: their units, and how a signal is called."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from clutchid.recordings.formats.mat.tree import Node, Numbers, Struct, Text

_UNITS = ("unit", "units", "einheit", "einheiten")
_LABELS = ("label", "name", "signalname")
_REMARKS = ("description", "comment", "blockname")
_INFOS = ("datainfo", "timeinfo")
_TIME = re.compile(
    r"(t|time|zeit|tout|timestamps?|zeitstempel|messzeit|elapsed_?time)(_?[\[(]?(s|sec|sek|ms|us|ns)[\])]?)?"
)


@dataclass(frozen=True, slots=True)
class Naming:
    """Of a struct: units by field, and of its `only` channel besides the time the label and what else is said of it.

    `used` are the fields that say so.
    """

    units: Mapping[str, str] = field(default_factory=dict)
    only: str = ""
    label: str = ""
    comment: str = ""
    used: frozenset[str] = frozenset()


def means_time(name: str) -> bool:
    """Whether a name is one of those that time vectors have.

    Examples
    --------
    >>> [means_time(name) for name in ("t", "Zeit", "time_ms", "tout", "torque", "T_oil")]
    [True, True, True, True, False, False]
    """
    return _TIME.fullmatch(name.casefold()) is not None


def naming(fields: Mapping[str, Node]) -> Naming:
    """What the texts in a struct say.

    Examples
    --------
    >>> said = naming({"values": Numbers((900, 1)), "label": Text("stroke"), "unit": Text("mm")})
    >>> said.only, said.label, said.units
    ('values', 'stroke', {'values': 'mm'})
    """
    vectors = [name for name, node in fields.items() if isinstance(node, Numbers) and node.size > 1]
    clocks, others = [n for n in vectors if means_time(n)], [n for n in vectors if not means_time(n)]
    only = others[0] if len(others) == 1 else ""
    texts = {name: node.text.strip() for name, node in fields.items() if isinstance(node, Text)}
    units, used = _units(fields, texts, only, clocks)
    label = _first(texts, _LABELS) if only else ""
    remark = _first(texts, _REMARKS) if only else ""
    used |= {name for name in texts if name.casefold() in (*_LABELS, *_REMARKS)}
    return Naming(units, only, label, remark, frozenset(used))


def _first(texts: Mapping[str, str], names: tuple[str, ...]) -> str:
    """The first of these texts that says something."""
    return next((text for key in names for name, text in texts.items() if name.casefold() == key and text), "")


def _units(
    fields: Mapping[str, Node], texts: Mapping[str, str], only: str, clocks: list[str]
) -> tuple[dict[str, str], set[str]]:
    """Units by field, and the fields that they were found in."""
    units: dict[str, str] = {}
    used: set[str] = set()
    for name, node in fields.items():
        key = name.casefold()
        if isinstance(node, Struct) and key in (*_UNITS, *_INFOS):
            told = {field: child.text for field, child in node.fields.items() if isinstance(child, Text)}
            if key in _INFOS:
                ends = clocks if key == "timeinfo" else [only]
                told = dict.fromkeys(ends, _first(told, _UNITS))
            elif len(told) < len(node.fields):
                continue
            units.update(told)
            used.add(name)
        elif name in texts and key in _UNITS:
            units.setdefault(only, texts[name])
            used.add(name)
        elif name in texts and (match := re.fullmatch(r"(.+)_(unit|units|einheit)", key)):
            of = next((other for other in fields if other.casefold() == match[1]), "")
            units.setdefault(of, texts[name])
            used.add(name)
    return {name: unit for name, unit in units.items() if name and unit}, used
