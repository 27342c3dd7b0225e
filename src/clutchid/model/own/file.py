"""Models of one's own from a Python file: ``FILE.py:NAME``."""

from __future__ import annotations

import runpy
import sys
import traceback
from contextlib import redirect_stdout
from dataclasses import replace
from os import PathLike
from pathlib import Path

from clutchid.errors import ParameterError
from clutchid.model.compiled import Model
from clutchid.model.own.model import OwnModel
from clutchid.model.variants import VARIANTS
from clutchid.names import unknown_name


def own_model(path: str | PathLike[str], name: str) -> OwnModel:
    """The `OwnModel` of that `name` in a Python file. The file is executed.

    Raises
    ------
    ParameterError
        If the file cannot be read or raises, or has no such model; the text names the file and the line.
    """
    file = Path(path)
    if not file.is_file():
        raise ParameterError(f"{path}: there is no such file; a model is named FILE.py:NAME.")
    try:
        with redirect_stdout(sys.stderr):  # standard output is for results
            names = runpy.run_path(str(file), run_name="<own model>")
    except (Exception, SystemExit) as error:
        raise ParameterError(f"{_place(file, error)}: {_what(error)}") from error
    models = {key: value for key, value in names.items() if isinstance(value, OwnModel)}
    if name not in models:
        if name in names:
            raise ParameterError(
                f"{path}: {name} is not an OwnModel but {type(names[name]).__name__}; {_listed(models)}"
            )
        raise ParameterError(f"{path}: there is no '{name}'; {_listed(models)}")
    return replace(models[name], name=name, file=file.name)


def model_named(text: str) -> Model:
    """The model that an option names: a variant, or FILE.py:NAME of one's own.

    Raises
    ------
    ParameterError
        If there is no such variant, file or model.

    Examples
    --------
    >>> model_named("isothermal")
    'isothermal'
    """
    path, colon, name = text.rpartition(":")
    if colon and path.endswith(".py"):
        return own_model(path, name)
    if text.endswith(".py"):
        raise ParameterError(f"--model {text}: which model of the file? Write {text}:NAME.")
    if text not in VARIANTS:
        raise ParameterError(f"{unknown_name(text, VARIANTS, 'model')} A model of your own is named FILE.py:NAME.")
    return text


def _listed(models: dict[str, OwnModel]) -> str:
    return f"models in it are {', '.join(models)}." if models else "it has no OwnModel; see docs/own_models.md."


def _place(file: Path, error: BaseException) -> str:
    """The file, and the line of it that raised."""
    if isinstance(error, SyntaxError) and error.filename == str(file):
        return f"{file}, line {error.lineno}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(file)]
    return f"{file}, line {lines[-1]}" if lines else str(file)


def _what(error: BaseException) -> str:
    """Fault in words: a sentence of clutchid, or the name of the error with its text."""
    if isinstance(error, ParameterError):
        return str(error)
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"the file cannot be executed ({type(error).__name__}: {text})."
