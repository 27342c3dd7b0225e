"""Requests of the page, checked before their job starts, as the command and the Python that repeat them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from clutchid.app.records import File
from clutchid.errors import ParameterError
from clutchid.verbs.commands import FitCommand, typed
from clutchid.verbs.options import USUAL, ReadingText, RequestText, bounds, pressure, priors

#: Defaults of a fit on the page by verb: those of the commands of the same name.
VERBS = {
    verb: {"measure": ",".join(measure), "free": ",".join(free)}
    for verb, (measure, free) in USUAL.items()
    if verb != "fit"
}

#: Methods of a fit; an empty text leaves the choice to it.
METHODS = ("", "simulation", "shooting", "prediction-error")

_TEXTS = {"measure": None, "free": None, "method": METHODS, "zero": ("", "subtract", "keep"), "ambient": None}
_LISTS = {"bounds": bounds, "prior": priors}


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
    names = {*_TEXTS, *_LISTS, "force"}
    if unknown := sorted(map(str, {*options} - names)):
        raise ParameterError(f"options: {', '.join(unknown)} is not known; {', '.join(sorted(names))}.")
    stated: dict[str, Any] = {}
    for name, choices in _TEXTS.items():
        text = options.get(name, "")
        if not isinstance(text, str):
            raise ParameterError(f"--{name}: a text is needed.")
        if choices and text.strip() not in choices:
            raise ParameterError(f"--{name} {text}: is not known; {', '.join(filter(None, choices))}.")
        stated |= {name: text.strip()} if text.strip() else {}
    for name, parse in _LISTS.items():
        items = options.get(name, [])
        if not isinstance(items, list) or not all(isinstance(item, str) for item in items):
            raise ParameterError(f"--{name}: a list of texts is needed.")
        parse(items)
        stated |= {name: items} if items else {}
    ambient = stated.pop("ambient", None)
    pressure(ambient)
    return FitCommand(
        verb=verb, logs=_names(files), verify=_names(verify), start=None if start is None else Path(start),
        search=RequestText(**stated), files=ReadingText(ambient=ambient, map=_map_of([*files, *verify])),
        force=bool(options.get("force")),
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
