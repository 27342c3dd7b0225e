"""Next step after a fit, as data for a page, and as a command that can be pasted."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, count
from pathlib import Path

from clutchid.documents import Document, document_of
from clutchid.documents.document import NextStep
from clutchid.estimation import Fit
from clutchid.estimation.assess.verdict import of_the_paper, states_of_wear, verdict
from clutchid.model import Actuator
from clutchid.systems import command_line
from clutchid.verbs.commands import FitCommand, argument
from clutchid.verbs.options import words_of


def document_with_next_step(fit: Fit, asked: FitCommand) -> Document:
    """Document of a fit as it was asked for, with the command that repeats it and the next step."""
    document = document_of(fit, _line(*asked.words))
    return document if fit.status == "failed" else replace(document, next=next_step(fit, asked))


def next_step(fit: Fit, asked: FitCommand) -> NextStep:
    """The next step: continue, calibrate, read a worn clutch, follow its wear, or look at the page.

    Kinds: continue a search from the saved result ("continue"), or save it for that ("save to continue"); follow the
    wear of a vehicle ("track"); calibrate this recording ("calibrate"), or record one with pressure ("record"); correct
    the problems that the reasons name and calibrate again ("correct"); keep a calibration ("keep"); read a worn clutch
    ("estimate"); see both loads on a page ("report"); keep a result ("keep result"); simulate the pressure over time
    ("simulate").

    Parameters
    ----------
    fit : Fit
        Not failed.
    asked : FitCommand
        What was asked for.
    """
    reading = _reading(asked)
    if not fit.converged:
        return _continue(asked)
    if states_of_wear(fit) is not None and asked.start is not None and "--model" not in reading:
        words = ["track", *map(argument, asked.logs), *reading, "--start", argument(asked.start)]
        return NextStep("track", "follow the wear", _line(*words, "--out", _new_file(asked, "WEAR.parquet")))
    if fit.baseline is not None:
        return _after_reading(asked)
    if fit.calibration is not None:
        return _after_calibration(fit, asked)
    measured = any("pressure_a" in recording.measured for recording in fit.recordings.values())
    logs = [*map(argument, asked.logs), *_again(asked)] if measured else ["CAL.csv", *reading]
    own = not (of_the_paper(fit) and fit.actuator.equipment == Actuator().equipment)
    start = ("--start", argument(asked.start)) if own and asked.start else ()
    what = _line("calibrate", *logs, *start, "--save", _new_file(asked, "CAL.toml"))
    if measured:
        return NextStep("calibrate", "calibrate, because this recording has pressure", what)
    return NextStep("record", "record once with pressure, and calibrate", what)


def _continue(asked: FitCommand) -> NextStep:
    saved = asked.saved
    if saved is None:
        return NextStep(
            "save to continue", "save the result, to continue the search from it", _saving(asked, "FIT.toml")
        )
    further = saved.with_name(f"{saved.stem}-continued{saved.suffix}")
    words = replace(asked, start=None, save=(), report=None).words
    again = _line(*words, "--start", argument(saved), "--save", argument(further))
    return NextStep("continue", "continue the search", again)


def _after_calibration(fit: Fit, asked: FitCommand) -> NextStep:
    if verdict(fit).trust == "none":
        return NextStep(
            "correct", ("correct the problems that the reasons name, and calibrate again"), _line(*asked.words)
        )
    if asked.saved is None:
        return NextStep("keep", "keep the calibration", _saving(asked, "CAL.toml"))
    what = _line("estimate", "WORN.csv", *_reading(asked), "--start", argument(asked.saved))
    return NextStep("estimate", "estimate the load of a worn clutch from position alone", what)


def _after_reading(asked: FitCommand) -> NextStep:
    log, saved = asked.logs[0], asked.saved
    if asked.report is None:
        page = _line(*asked.words, "--report", _new_file(asked, f"{log.stem}.html"))
        return NextStep("report", "see both loads on a page", page)
    if saved is None:
        return NextStep("keep result", "keep the result", _saving(asked, f"{log.stem}.toml"))
    words = ["simulate", argument(log), *_again(asked), "--parameters", argument(saved)]
    return NextStep(
        "simulate", "the pressure over time", _line(*words, "--out", _new_file(asked, f"{log.stem}-pressure.csv"))
    )


def _line(*words: str) -> str:
    return command_line(["clutchid", *words])


def _saving(asked: FitCommand, name: str) -> str:
    """The command, which also saves its result."""
    return _line(*asked.words, "--save", _new_file(asked, name))


def _reading(asked: FitCommand) -> tuple[str, ...]:
    """Arguments that say how any recording is read."""
    model = asked.search.model or ""
    return (*words_of(asked.files), *(("--model", model) if ".py:" in model else ()))


def _again(asked: FitCommand) -> tuple[str, ...]:
    """Arguments that say how the same recordings are read."""
    return (*_reading(asked), *(("--force",) if asked.force else ()))


def _new_file(asked: FitCommand, name: str) -> str:
    """`name`, with a number if the command reads or writes a file of that name."""
    path, files = Path(name), (*asked.logs, asked.start, *asked.save, asked.report)
    taken = {file.absolute() for file in files if file is not None}
    numbered = (path.with_name(f"{path.stem}-{number}{path.suffix}") for number in count(2))
    return argument(next(candidate for candidate in chain([path], numbered) if candidate.absolute() not in taken))
