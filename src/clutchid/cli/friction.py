"""``clutchid friction``: friction from recordings of a test rig."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from clutchid.cli.common import DONE, FileOptions, OutputFlag, guarded, print_document
from clutchid.errors import ParameterError
from clutchid.verbs.options import USUAL_FILES


@guarded
def friction(
    *files: Path,
    law: Literal["coulomb", "lugre"] = "coulomb",
    area: float | None = None,
    fix: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    inertia: float | None = None,
    options: FileOptions = USUAL_FILES,
    json: OutputFlag = False,
    debug: OutputFlag = False,
) -> int:
    """Estimate the friction of a seal from recordings of a test rig.

    Parameters
    ----------
    files
        Recordings with `time`, `position`, `force` and, if measured, `pressure_a`.
    law
        coulomb: Coulomb friction at each constant pressure from strokes at constant speed, and whether it depends on
        the pressure. lugre: F_C, K_z, D_v and D_zdot of each recording, by simulation from its position alone.
    area
        Slope of the force over the pressure in m², if known; for coulomb.
    fix
        Fixed parameters, NAME=VALUE in SI (F_C, K_z, D_v, D_zdot, force_zero), one or several; for lugre.
    inertia
        Mass in kg between the load cell and the friction, whose acceleration is part of the force; for lugre.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.documents import document_of
    from clutchid.verbs.rig import rig_friction

    fixed = _fixed(fix or (), inertia, law, area)
    reading = options.reading(files)
    friction = rig_friction(reading, reading.ambient, law, area, fixed, inertia or 0.0)
    print_document(document_of(friction), json=json)
    return DONE


def _fixed(items: Sequence[str], inertia: float | None, law: str, area: float | None) -> dict[str, float]:
    """Parameters by ``NAME=VALUE``; an option that the law does not have is an error."""
    others = {"--area": area} if law == "lugre" else {"--fix": items or None, "--inertia": inertia}
    for option, value in others.items():
        if value is not None:
            other = "coulomb" if law == "lugre" else "lugre"
            raise ParameterError(f"{option}: belongs to --law {other}, not to --law {law}; leave it out.")
    fixed = {}
    for item in items:
        name, _, text = item.partition("=")
        try:
            fixed[name.strip()] = float(text)
        except ValueError:
            raise ParameterError(f"--fix {item}: write NAME=VALUE in SI units, for example K_z=1e6.") from None
    return fixed
