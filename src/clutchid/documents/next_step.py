"""Next step after a fit, as data for a page, and as a command that can be pasted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path

from clutchid.documents.document import NextStep
from clutchid.estimation import Fit
from clutchid.estimation.assess.verdict import of_the_paper, states_of_wear, verdict
from clutchid.model import Actuator
from clutchid.systems import command_line


@dataclass(frozen=True, slots=True)
class Command:
    """The command of a fit: its arguments behind ``clutchid``, the recordings, and the files of its options.

    `save` is the parameter file, `others` are further files that are saved, such as those for MATLAB. `reading` are the
    arguments that say how any recording is read, `forced` that these recordings are fitted although a check of them is
    bad.
    """

    arguments: tuple[str, ...]
    logs: tuple[Path, ...]
    start: Path | None = None
    save: Path | None = None
    report: Path | None = None
    reading: tuple[str, ...] = ()
    forced: bool = False
    others: tuple[Path, ...] = ()

    def with_options(self, *options: str, without: Sequence[str] = ()) -> str:
        """The command with `options` added, and `without` options that have one value."""
        arguments: list[str] = []
        skip = False
        for argument in self.arguments:
            name = argument.partition("=")[0]
            if not skip and name not in without:
                arguments.append(argument)
            skip = not skip and argument in without  # its value follows
        at = arguments.index("--") if "--" in arguments else len(arguments)  # what follows is no option
        return command_line(["clutchid", *arguments[:at], *options, *arguments[at:]])

    @property
    def names(self) -> list[str]:
        """The recordings as arguments."""
        return [_argument(path) for path in self.logs]

    @property
    def again(self) -> tuple[str, ...]:
        """The arguments that say how these recordings are read."""
        return (*self.reading, *(("--force",) if self.forced else ()))

    def new_file(self, name: str) -> str:
        """`name`, with a number if the command reads or writes a file of that name."""
        path = Path(name)
        files = (*self.logs, self.start, self.save, *self.others, self.report)
        taken = {file.absolute() for file in files if file is not None}
        numbered = (path.with_name(f"{path.stem}-{number}{path.suffix}") for number in count(2))
        return _argument(next(candidate for candidate in chain([path], numbered) if candidate.absolute() not in taken))


def next_step(fit: Fit, command: Command) -> NextStep:
    """The next step: continue, calibrate, read a worn clutch, follow its wear, or look at the page.

    Kinds: continue a search from the saved result ("continue"), or save it for that ("save to continue"); follow the
    wear of a vehicle ("track"); calibrate this recording ("calibrate"), or record one with pressure ("record"); correct
    what the reasons say and calibrate again ("correct"); keep a calibration ("keep"); read a worn clutch ("estimate");
    see both loads on a page ("report"); keep a result ("keep result"); simulate the pressure over time ("simulate").

    Parameters
    ----------
    fit : Fit
        Not failed.
    command : Command
        Command of this result.
    """
    saved = command.save if command.save and command.save.suffix.lower() in ("", ".toml") else None
    if not fit.converged:
        return _continue(command, saved)
    if states_of_wear(fit) is not None and command.start is not None and "--model" not in command.reading:
        words = ["clutchid", "track", *command.names, *command.reading, "--start", _argument(command.start)]
        return NextStep("track", "follow the wear", command_line([*words, "--out", command.new_file("WEAR.parquet")]))
    if fit.baseline is not None:
        return _after_reading(command, saved)
    if fit.calibration is not None:
        return _after_calibration(fit, command, saved)
    measured = any("pressure_a" in recording.measured for recording in fit.recordings.values())
    logs = [*command.names, *command.again] if measured else ["CAL.csv", *command.reading]
    own = command.start is not None and not (of_the_paper(fit) and fit.actuator.equipment == Actuator().equipment)
    words = ["clutchid", "calibrate", *logs, *(("--start", _argument(command.start)) if own and command.start else ())]
    what = command_line([*words, "--save", command.new_file("CAL.toml")])
    if measured:
        return NextStep("calibrate", "calibrate, because this recording has pressure", what)
    return NextStep("record", "record once with pressure, and calibrate", what)


def _continue(command: Command, saved: Path | None) -> NextStep:
    if saved is None:
        saving = command.with_options("--save", command.new_file("FIT.toml"))
        return NextStep("save to continue", "save the result, to continue the search from it", saving)
    further = saved.with_name(f"{saved.stem}-continued{saved.suffix}")
    options = ("--start", _argument(saved), "--save", _argument(further))
    again = command.with_options(*options, without=("--start", "--save", "--report"))
    return NextStep("continue", "continue the search", again)


def _after_calibration(fit: Fit, command: Command, saved: Path | None) -> NextStep:
    if verdict(fit).trust == "none":
        return NextStep("correct", "correct what the reasons say, and calibrate again", command.with_options())
    if saved is None:
        saving = command.with_options("--save", command.new_file("CAL.toml"))
        return NextStep("keep", "keep the calibration", saving)
    words = ["clutchid", "estimate", "WORN.csv", *command.reading, "--start", _argument(saved)]
    return NextStep("estimate", "estimate the load of a worn clutch from position alone", command_line(words))


def _after_reading(command: Command, saved: Path | None) -> NextStep:
    log = command.logs[0]
    if command.report is None:
        page = command.with_options("--report", command.new_file(f"{log.stem}.html"))
        return NextStep("report", "see both loads on a page", page)
    if saved is None:
        saving = command.with_options("--save", command.new_file(f"{log.stem}.toml"))
        return NextStep("keep result", "keep the result", saving)
    words = ["clutchid", "simulate", command.names[0], *command.again, "--parameters", _argument(saved)]
    what = command_line([*words, "--out", command.new_file(f"{log.stem}-pressure.csv")])
    return NextStep("simulate", "the pressure over time", what)


def _argument(path: Path) -> str:
    """A path as an argument, also where its name begins with a dash."""
    return f"./{path}" if str(path).startswith("-") else str(path)
