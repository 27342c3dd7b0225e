"""`Check`: the result of one check, and `Inspection`: all results as a table and as warnings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from clutchid.recordings.text_table import text_table

#: "suspect": a fit is possible, but check the recording; "bad": a fit would be wrong; "undetermined": not enough data.
Grade = Literal["good", "suspect", "bad", "undetermined"]

_TITLES = ("check", "result", "grade")


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check: its name, the value with its unit, the grade, and a sentence that says what to do."""

    name: str
    value: str
    grade: Grade
    sentence: str


@dataclass(frozen=True, slots=True)
class Inspection:
    """Results of all checks of the recording `name`, and `notes` on what it lacks without being faulty."""

    name: str
    checks: tuple[Check, ...]
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.table()

    @property
    def warnings(self) -> tuple[str, ...]:
        """The sentence of each check that is "suspect" or "bad"; an undetermined one gives no warning."""
        poor = [check for check in self.checks if check.grade in ("suspect", "bad")]
        return tuple(f"{self.name}: {check.sentence}" for check in poor)

    @property
    def bad(self) -> tuple[str, ...]:
        """The sentence of each check that is "bad": a fit would be wrong."""
        return tuple(check.sentence for check in self.checks if check.grade == "bad")

    def table(self, how: str = "") -> str:
        """All checks as a text table for a terminal, followed by the sentences of those that are not good.

        Parameters
        ----------
        how
            Said of the recording behind its name: how it was read.

        Returns
        -------
        text : str
            One line per check.

        Examples
        --------
        >>> slow = Check("sample rate", "20 Hz", "bad", "20 Hz is slow; record faster.")
        >>> print(Inspection("run", (slow,)).table())
        run: 1 check, 1 bad
          check        result  grade
          sample rate  20 Hz   bad
        <BLANKLINE>
          - sample rate: 20 Hz is slow; record faster.
        """
        poor = [check for check in self.checks if check.grade != "good"]
        count = len(self.checks)
        grades = [check.grade for check in poor]
        counted = ", ".join(f"{grades.count(g)} {g}" for g in ("bad", "suspect", "undetermined") if g in grades)
        lines = [f"{self.name}{how}: {count} check{'' if count == 1 else 's'}, {counted or 'all good'}"]
        lines += text_table([_TITLES, *((check.name, check.value, check.grade) for check in self.checks)], len(_TITLES))
        sentences = [*(f"{check.name}: {check.sentence}" for check in poor), *self.notes]
        if sentences:
            lines += ["", *(f"  - {sentence}" for sentence in sentences)]
        return "\n".join(lines)
