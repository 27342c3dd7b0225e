"""Requests of the page, checked before their job starts, as the command and the Python that repeat them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from clutchid.app.records import File
from clutchid.errors import ParameterError
from clutchid.files.records import read_record
from clutchid.names import unknown_names
from clutchid.verbs.commands import FitCommand, typed
from clutchid.verbs.options import USUAL, ReadingText, RequestText, pressure_option

#: Defaults of a fit on the page by verb: those of the commands of the same name.
VERBS = {
    verb: {"measure": ",".join(measure), "free": ",".join(free)}
    for verb, (measure, free) in USUAL.items()
    if verb != "fit"
}

#: Methods of a fit; an empty text leaves the choice to it.
METHOD_CHOICES = ("", "simulation", "shooting", "prediction-error")

#: Options of a fit that the page has; a model of one's own is a file that would be executed.
_SEARCH = ("measure", "free", "method", "zero", "bounds", "prior")


def fit_command(
    verb: str, options: Any, files: Sequence[File], verify: Sequence[File] = (), start: str | None = None
) -> FitCommand:
    """A fit as the page asks for it, with the recordings by the names that a command has for them.

    Raises
    ------
    ParameterError
        If an option cannot be understood, with the sentence of the command line.
    """
    if not isinstance(options, dict):
        raise ParameterError("options: a table is needed.")
    if unknown := unknown_names(map(str, options), (*_SEARCH, "ambient", "force"), "option"):
        raise ParameterError("\n".join(unknown))
    stated = {name: value.strip() if isinstance(value, str) else value for name, value in options.items()}
    stated = {name: value for name, value in stated.items() if value not in ("", [])}
    force, ambient = bool(stated.pop("force", False)), stated.pop("ambient", None)
    search = read_record(RequestText, stated, "options")
    pressure_option(None if ambient is None else read_record(str, ambient, "options ambient"))
    return FitCommand(
        verb=verb, logs=_names(files), verify=_names(verify), start=None if start is None else Path(start),
        search=search, files=ReadingText(ambient=ambient, map=_map_of([*files, *verify])), force=force,
    )  # fmt: skip


def repeated(asked: FitCommand, files: Sequence[File]) -> tuple[str, str]:
    """The command and the Python that repeat a fit of these recordings; empty where they have different maps."""
    return (typed(asked.words), asked.python) if len(_maps_of(files)) == 1 else ("", "")


def repeated_observation(file: File, start: str, method: str, *, force: bool) -> tuple[str, str]:
    """The command and the Python that observe a recording."""
    channels = _map_of([file])
    words = ["observe", file.name, "--start", start, "--method", method, "--out", "est.parquet"]
    words += [*(["--map", str(channels)] if channels else []), *(["--force"] if force else [])]
    arguments = [repr(file.name), repr(start), f"method={method!r}"]
    arguments += [*([f"channels={str(channels)!r}"] if channels else []), *(["force=True"] if force else [])]
    call = f"run = clutchid.observe({', '.join(arguments)})\nprint(run.load_by_stroke())"
    return typed(words), f"import clutchid\n\n{call}\n"


def _names(files: Sequence[File]) -> tuple[Path, ...]:
    return tuple(Path(file.name) for file in files)


def _maps_of(files: Sequence[File]) -> set[str]:
    """The texts of the channel maps of recordings, empty where there is no map."""
    return {file.map.read_text(encoding="utf-8") if file.map else "" for file in files}


def _map_of(files: Sequence[File]) -> Path | None:
    """Name of the downloaded channel map of recordings; None if they have different maps, or none."""
    mapped = [file for file in files if file.map]
    return Path(f"{Path(mapped[0].name).name}.map.toml") if mapped and len(_maps_of(files)) == 1 else None
