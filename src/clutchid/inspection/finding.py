"""`Finding`: what one check found, and `Inspection`: all of them as a table and as warnings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from clutchid.text_table import text_table

#: "look": a fit can be made, and somebody should know; "bad": a fit would be wrong; "not tellable": no evidence.
Verdict = Literal["good", "look", "bad", "not tellable"]

_TITLES = ("check", "found", "verdict")


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check found: its name, the value with its unit, the verdict, and a sentence with what to do next."""

    check: str
    value: str
    verdict: Verdict
    sentence: str


@dataclass(frozen=True, slots=True)
class Inspection:
    """Everything that the checks found in the recording `name`."""

    name: str
    findings: tuple[Finding, ...]

    def __str__(self) -> str:
        return self.table()

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence for each finding that is "look" or "bad"; what cannot be told is no reason to warn."""
        told = [finding for finding in self.findings if finding.verdict in ("look", "bad")]
        return tuple(f"{self.name}: {finding.sentence}" for finding in told)

    def table(self) -> str:
        """Every finding as plain text for a terminal, and below it the sentences of those that are not good.

        Returns
        -------
        text : str
            One line a check.

        Examples
        --------
        >>> slow = Finding("sample rate", "20 Hz", "bad", "20 Hz is slow; record faster.")
        >>> print(Inspection("run", (slow,)).table())
        run: 1 check, 1 bad
          check        found  verdict
          sample rate  20 Hz  bad
        <BLANKLINE>
          - sample rate: 20 Hz is slow; record faster.
        """
        poor = [finding for finding in self.findings if finding.verdict != "good"]
        count = len(self.findings)
        verdicts = [finding.verdict for finding in poor]
        counted = ", ".join(f"{verdicts.count(v)} {v}" for v in ("bad", "look", "not tellable") if v in verdicts)
        lines = [f"{self.name}: {count} check{'' if count == 1 else 's'}, {counted or 'all good'}"]
        lines += text_table([_TITLES, *((f.check, f.value, f.verdict) for f in self.findings)], len(_TITLES))
        if poor:
            lines += ["", *(f"  - {finding.check}: {finding.sentence}" for finding in poor)]
        return "\n".join(lines)
