"""Names of parameters, shared by all recordings of a fit or belonging to one of them."""

from __future__ import annotations

from typing import NamedTuple

#: NAME@EACH stands for an own value in every recording.
EACH = "EACH"


class ParameterName(NamedTuple):
    """A parameter or load weight; with `recording` its value in that recording alone, written NAME@STEM.

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
        """The name that `text` writes."""
        base, _, stem = text.partition("@")
        return cls(base, stem or None)

    def __str__(self) -> str:
        return self.base if self.recording is None else f"{self.base}@{self.recording}"

    def holds_in(self, recording: str) -> bool:
        """Whether it is a parameter of `recording`: shared, or its own."""
        return self.recording in (None, recording)


def base_of(text: str) -> str:
    """The parameter that NAME or NAME@STEM is about."""
    return ParameterName.parse(text).base
