"""Names of parameters, shared by all recordings of a fit or of a single recording."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import fields
from importlib import import_module
from types import MappingProxyType
from typing import Any, NamedTuple

from clutchid.errors import ParameterError

#: Unknown names that a message lists; a file may have any number of them.
_SHOWN = 5

#: Suffix of a parameter that has a value of its own in every recording, NAME@EACH.
EVERY_RECORDING = "EACH"


class ParameterName(NamedTuple):
    """A parameter or load weight; with `recording`, its value in that recording only, written NAME@STEM.

    Examples
    --------
    >>> ParameterName.parse("P_S@day_3")
    ParameterName(base='P_S', recording='day_3')
    >>> str(ParameterName("F_C", "day_3")), str(ParameterName("F_C"))
    ('F_C@day_3', 'F_C')
    """

    base: str
    recording: str | None = None

    @classmethod
    def parse(cls, text: str) -> ParameterName:
        """The name in `text`."""
        base, _, stem = text.partition("@")
        return cls(base, stem or None)

    def __str__(self) -> str:
        return self.base if self.recording is None else f"{self.base}@{self.recording}"

    def applies_to(self, recording: str) -> bool:
        """Whether it is a parameter of `recording`: shared, or of that recording."""
        return self.recording in (None, recording)


def base_of(text: str) -> str:
    """The parameter of NAME or NAME@STEM."""
    return ParameterName.parse(text).base


def listed_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Names given as a sequence, or as one text with commas, as on the command line.

    Examples
    --------
    >>> listed_names("load, P_S") == listed_names(["load", "P_S"])
    True
    """
    return tuple(part.strip() for part in names.split(",") if part.strip()) if isinstance(names, str) else tuple(names)


def unknown_name(name: str, choices: Iterable[str], what: str = "parameter") -> str:
    """Message for a name that is not among `choices`, with the nearest known name.

    Examples
    --------
    >>> unknown_name("C_sv", ["C_vs", "C_ve"])
    "no parameter 'C_sv'; did you mean 'C_vs'? Known are C_vs, C_ve."
    """
    names = list(choices)
    same = [choice for choice in names if choice.casefold() == name.casefold()]
    near = difflib.get_close_matches(name, same or names, n=1, cutoff=0.0 if same else 0.4)
    hint = f"; did you mean '{near[0]}'?" if near else "."
    return f"no {what} '{name}'{hint} Known are {', '.join(names)}."


def check_names(names: Iterable[str], choices: Collection[str], what: str = "parameter") -> None:
    """Refuse names that are not among `choices`.

    Raises
    ------
    ParameterError
        With the message of `unknown_name` for each of them.
    """
    ParameterError.raise_for(unknown_name(str(name), choices, what) for name in names if name not in choices)


def unknown_names(names: Iterable[str], choices: Sequence[str], what: str = "parameter") -> list[str]:
    """Messages for those of `names` that are not among `choices`: the first few, and the count of the others.

    Examples
    --------
    >>> unknown_names(["F_c", "M"], ["F_C", "M"])
    ["no parameter 'F_c'; did you mean 'F_C'? Known are F_C, M."]
    """
    unknown = [name for name in names if name not in choices]
    messages = [unknown_name(name, choices, what) for name in unknown[:_SHOWN]]
    messages[:-1] = [message.partition(" Known are ")[0] for message in messages[:-1]]  # once is enough
    return [*messages, f"and {len(unknown) - _SHOWN:,} more."] if len(unknown) > _SHOWN else messages


def made_anew(record: Any) -> tuple[Callable[..., Any], tuple[object, ...]]:
    """``__reduce__`` of a public record: it is pickled and copied by its fields, and checked again when it is restored.

    So a mapping that is read-only may be pickled, arrays are read-only again, and methods are attached.
    """
    values = (getattr(record, item.name) for item in fields(record))
    plain = (dict(value) if isinstance(value, MappingProxyType) else value for value in values)
    return import_module("clutchid").made, (type(record).__name__, *plain)


def printable(text: str) -> str:
    r"""`text` with a question mark for each character that cannot be printed, as in names of foreign files.

    These are control characters, bytes that are not UTF-8, and marks that turn the direction of writing.

    Examples
    --------
    >>> printable("run\x1b[31m\n7"), printable("\u202egpj.exe")
    ('run?[31m?7', '?gpj.exe')
    """
    return text if text.isprintable() else "".join(letter if letter.isprintable() else "?" for letter in text)


def as_text(name: str) -> str:
    r"""The name of a file or folder with its bytes that are no UTF-8 as numbers, so that it can be written as text.

    Examples
    --------
    >>> as_text("r\udcff.csv"), as_text("Prüfung.csv")
    ('r\\xff.csv', 'Prüfung.csv')
    """
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def natural(name: str) -> list[tuple[bool, int, str]]:
    """Sort key of a name, in which numbers count as such.

    Examples
    --------
    >>> sorted(["r10", "r9", "a"], key=natural)
    ['a', 'r9', 'r10']
    """
    parts = re.split(r"(\d+)", name)
    return [(part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in parts]


def capital(words: str) -> str:
    """Words with a capital first letter."""
    return f"{words[:1].upper()}{words[1:]}"
