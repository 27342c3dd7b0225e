"""Names of parameters, shared by all recordings of a fit or of a single recording."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

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
