"""How to install an optional library into the environment that clutchid runs in."""

from __future__ import annotations

import re
import sys
from importlib.metadata import requires
from importlib.util import find_spec

from clutchid.errors import MissingExtra


def requirements(extra: str) -> tuple[str, ...]:
    """The requirements of an extra of clutchid, as its metadata have them.

    Examples
    --------
    >>> [re.match("[a-z0-9-]+", requirement)[0] for requirement in requirements("mat")]
    ['h5py', 'mat-io']
    """
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
