"""``clutchid look``: what is in a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from clutchid.cli.common import BAD_INPUT, DONE, guarded, pressure
from clutchid.parameters import Parameters


def look(file: Path, /, *, ambient: str | None = None, debug: Annotated[bool, Parameter(negative="")] = False) -> int:
    """List the columns of a recording with unit, range and holes, and every problem found.

    Parameters
    ----------
    file
        Recording, CSV or Parquet.
    ambient
        Ambient pressure for gauge units, for example 1.013bar; default P_0.
    debug
        Show the traceback of an error.
    """

    def work() -> int:
        from clutchid.io import look as look_at

        seen = look_at(file, pressure(ambient, Parameters().P_0))
        print(seen.table())
        return BAD_INPUT if seen.problems else DONE

    return guarded(work, as_json=False, debug=debug)
