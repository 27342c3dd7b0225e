"""Exceptions of clutchid, by what the caller must correct.

Each one is also a built-in exception, so that code without knowledge of clutchid can catch it.
"""

import re
import sys
from collections.abc import Iterable
from importlib.util import find_spec


class ClutchidError(Exception):
    """Base class of all errors that clutchid raises; the text is written for the user."""

    @classmethod
    def raise_for(cls, problems: Iterable[str]) -> None:
        """Raise one error that lists all `problems`, if there are any."""
        if text := "\n".join(problems):
            raise cls(text)


class ParameterError(ClutchidError, ValueError):
    """A parameter, bound or option is not admissible."""


class DataError(ClutchidError, ValueError):
    """A recording cannot be used; the text lists every problem found in it."""

    @classmethod
    def of(cls, source: str, problems: list[str]) -> "DataError":
        """One error for all `problems` of the file or recording `source`."""
        if len(problems) == 1:
            return cls(f"{source}: {problems[0]}")
        return cls(f"{source}: {len(problems)} problems.\n" + "\n".join(f"  - {problem}" for problem in problems))


class SolveError(ClutchidError, ArithmeticError):
    """A simulation or a fit produced values that are not finite."""


class ExportError(ClutchidError, OSError):
    """An output cannot be written; no partial file is left."""


class MissingExtra(ClutchidError, ImportError):
    """An optional dependency is not installed."""


def requirements(extra: str) -> tuple[str, ...]:
    """The requirements of an extra of clutchid, as its metadata have them.

    Examples
    --------
    >>> [re.match("[a-z0-9-]+", requirement)[0] for requirement in requirements("mat")]
    ['h5py', 'mat-io']
    """
    from importlib.metadata import requires  # slow to import, and asked for only where a library is absent

    marked = [requirement.partition(";") for requirement in requires("clutchid") or ()]
    return tuple(text.strip() for text, _, marker in marked if re.search(rf"extra\s*==\s*['\"]{extra}['\"]", marker))


def install_command(extra: str) -> str:
    """The command that installs the libraries of an extra, not clutchid itself, which need not be on any index.

    It names the interpreter, as the `pip` of a terminal may belong to another environment.
    """
    python = f'"{sys.executable}"' if " " in sys.executable else sys.executable
    pip = f"{python} -m pip install" if find_spec("pip") else f"uv pip install --python {python}"
    return " ".join([pip, *(f'"{requirement}"' for requirement in requirements(extra))])


def missing(what: str, library: str, extra: str) -> MissingExtra:
    """The error that `what` needs a library of an extra, which is not installed."""
    return MissingExtra(f"{what} needs {library}, which is not installed; install it with: {install_command(extra)}")
