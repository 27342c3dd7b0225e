"""A requested fit: its recipe, and the command and the Python that repeat it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

from clutchid.names import printable
from clutchid.systems import command_line
from clutchid.verbs.options import (
    USUAL_FILES,
    USUAL_SEARCH,
    ReadingText,
    RequestText,
    model_of,
    pressure_option,
    requested,
    words_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from clutchid.estimation.result import Fit
    from clutchid.numerics.progress import Progress
    from clutchid.verbs.reading import Reading

#: Options of a request that the verbs of Python take by name.
_EVERYDAY = ("free", "measure", "bounds", "method", "zero")


@dataclass(frozen=True, slots=True, kw_only=True)
class FitCommand:
    """A fit with its options as text.

    Attributes
    ----------
    verb : 'fit', 'calibrate' or 'estimate'
    logs, verify
        Recordings that are fitted, and those that the result is only simulated on.
    start
        Parameter file to start from.
    search, files, force
        Options of the fit, of its files, and whether it goes on although a check is bad.
    save, report
        Files to write.

    Examples
    --------
    >>> asked = FitCommand(verb="estimate", logs=(Path("worn.csv"),), start=Path("CAL.toml"), force=True)
    >>> " ".join(asked.words)
    'estimate worn.csv --start CAL.toml --force'
    >>> print(asked.python.splitlines()[2])
    fit = clutchid.estimate('worn.csv', 'CAL.toml', force=True)
    """

    verb: str
    logs: tuple[Path, ...]
    start: Path | None = None
    search: RequestText = USUAL_SEARCH
    verify: tuple[Path, ...] = ()
    files: ReadingText = USUAL_FILES
    force: bool = False
    save: tuple[Path, ...] = ()
    report: Path | None = None

    def run(self, progress: Progress | None = None) -> Fit:
        """Read and check the recordings, and fit them; a search that failed is a status.

        The files of `save` are written as soon as the search has ended, before profile likelihood and bootstrap begin.

        Raises
        ------
        DataError, ParameterError
            As `clutchid.fit`.
        """
        reading = self.files.reading(self.logs, self.verify, force=self.force)
        return self.run_on(reading, self.start, progress, self._saved)

    def _saved(self, fit: Fit) -> None:
        from clutchid.verbs.saving import save_fit

        for path in self.save:
            save_fit(fit, path)

    def run_on(
        self,
        reading: Reading,
        start: Path | None,
        progress: Progress | None = None,
        before_checks: Callable[[Fit], None] = lambda _: None,
    ) -> Fit:
        """`run` with other paths of the recordings and of the parameter file, as on the server of a page."""
        from clutchid.verbs.fitting import fitted
        from clutchid.verbs.start import start_of

        actuator, request = start_of(start, self.search.request(self.verb), model_of(self.search.model))
        return fitted(reading, actuator, request, progress, before_checks)

    @property
    def automatic(self) -> bool:
        """Whether all parameters are free that a recording with pressure may determine."""
        return self.search.request(self.verb).automatic

    @property
    def saved(self) -> Path | None:
        """The parameter file that is written, if one is."""
        return next((path for path in self.save if path.suffix.lower() in ("", ".toml")), None)

    @property
    def words(self) -> tuple[str, ...]:
        """The arguments of the command that repeats it."""
        start = () if self.start is None else ("--start", argument(self.start))
        files = (word for path in self.save for word in ("--save", argument(path)))
        report = () if self.report is None else ("--report", argument(self.report))
        verify = ("--verify", *map(argument, self.verify)) if self.verify else ()
        options = (*words_of(self.search), *words_of(self.files), *(("--force",) if self.force else ()))
        return (self.verb, *map(argument, self.logs), *start, *options, *verify, *files, *report)

    @property
    def python(self) -> str:
        """The Python that repeats it."""
        verb = "estimate" if self.start else self.verb  # `fit` and `calibrate` start from an actuator, not from a file
        asked, usual = self.search.request(self.verb), requested(verb, None)
        stated = {"free": self.search.free, "measure": self.search.measure}
        for name in (field.name for field in fields(asked)):
            value = getattr(asked, name)
            if not stated.get(name) and value != getattr(usual, name):
                stated[name] = ",".join(value) if isinstance(value, tuple) else value
        everyday = {name: stated.pop(name, None) for name in _EVERYDAY} | {
            "verify": [str(path) for path in self.verify] or None,
            "force": self.force or None,
            "ambient": pressure_option(self.files.ambient),
            "channels": None if self.files.map is None else str(self.files.map),
            "dbc": [str(path) for path in self.files.dbc or ()] or None,
        }
        logs = [str(path) for path in self.logs]
        start = None if self.start is None else str(self.start)
        request = f"request=clutchid.FitRequest({_arguments(stated)})" if stated else ""
        parts = [repr(logs[0] if len(logs) == 1 else logs), repr(start) if start else "", request, _arguments(everyday)]
        call = f"clutchid.{verb}({', '.join(filter(None, parts))})"
        return f"import clutchid\n\nfit = {call}\nprint(fit)\nfit.plot().savefig('load.png')\n"


def typed(arguments: Sequence[str]) -> str:
    """A command as it was typed, from its arguments."""
    return printable(f"clutchid {command_line(arguments)}")


def _arguments(options: Mapping[str, object]) -> str:
    """Options that are not None as arguments of a call; records are those of `clutchid`."""
    texts = (f"{name}={value!r}" for name, value in options.items() if value is not None)
    words = re.sub(r"\binf\b", "float('inf')", ", ".join(texts))
    return re.sub(r"\b(Prior|Partition)\(", r"clutchid.\1(", words)


def argument(path: Path) -> str:
    """A path as an argument, also where its name begins with a dash."""
    text = str(path)
    return f"./{text}" if text.startswith("-") else text
