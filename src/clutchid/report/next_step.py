"""What to do after a fit, as a command that can be pasted."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from clutchid.estimate import Fit


@dataclass(frozen=True, slots=True)
class Command:
    """The command of a fit: its arguments behind ``clutchid``, the recordings, and the files of its options.

    `reading` are the arguments that say how the recordings are read.
    """

    arguments: tuple[str, ...]
    logs: tuple[Path, ...]
    start: Path | None = None
    save: Path | None = None
    report: Path | None = None
    reading: tuple[str, ...] = ()

    def with_options(self, *options: str, without: Sequence[str] = ()) -> str:
        """The command with `options` added, and `without` options that have one value."""
        kept: list[str] = []
        skip = False
        for argument in self.arguments:
            name = argument.partition("=")[0]
            if not skip and name not in without:
                kept.append(argument)
            skip = argument in without  # its value follows
        return shlex.join(["clutchid", *kept, *options])


def next_step(fit: Fit, command: Command) -> tuple[str, str]:
    """Why, and the command: continue, calibrate, read a worn clutch, or look at the page.

    Parameters
    ----------
    fit : Fit
        Not failed.
    command : Command
        The one that made it.
    """
    saved = command.save if command.save and command.save.suffix.lower() in ("", ".toml") else None
    if fit.search is not None and not fit.converged:
        return _continue(command, saved)
    if fit.baseline is not None:
        return _after_reading(command, saved)
    if fit.calibration is not None:
        if saved is None:
            return "keep the calibration", command.with_options("--save", "CAL.toml", without=("--save",))
        words = ["clutchid", "fit", "WORN.csv", *command.reading, "--start", str(saved), "--free", "load"]
        return "read a worn clutch, from position alone", shlex.join(words)
    measured = any("pressure_a" in recording.measured for recording in fit.recordings.values())
    logs = [str(path) for path in command.logs] if measured else ["CAL.csv"]
    words = ["clutchid", "fit", *logs, *command.reading, "--measure", "position,pressure_a", "--free", "auto"]
    why = "calibrate, because this recording has pressure" if measured else "record once with pressure, and calibrate"
    return why, shlex.join([*words, "--save", "CAL.toml"])


def _continue(command: Command, saved: Path | None) -> tuple[str, str]:
    if saved is None:
        return "save the result, to continue the search from it", command.with_options("--save", "FIT.toml")
    further = saved.with_name(f"{saved.stem}-continued{saved.suffix}")
    options = ("--start", str(saved), "--save", str(further))
    return "continue the search", command.with_options(*options, without=("--start", "--save", "--report"))


def _after_reading(command: Command, saved: Path | None) -> tuple[str, str]:
    log = command.logs[0]
    if command.report is None:
        return "see both loads on a page", command.with_options("--report", f"{log.stem}.html")
    if saved is None:
        return "keep the result", command.with_options("--save", f"{log.stem}.toml", without=("--save",))
    words = ["clutchid", "simulate", str(log), *command.reading, "--parameters", str(saved)]
    return "the pressure over time", shlex.join([*words, "--out", f"{log.stem}-pressure.csv"])
