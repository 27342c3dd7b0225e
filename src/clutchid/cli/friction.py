"""``clutchid friction``: friction from recordings of a test rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from clutchid.cli.common import DONE, FileOptions, OutputFlag, guarded, print_json
from clutchid.cli.terminal import put, say
from clutchid.errors import ParameterError
from clutchid.log import Log
from clutchid.measurements.checks import AMBIENT
from clutchid.verbs.options import USUAL_FILES, pressure


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
        NAME=VALUE in SI of a parameter that is not estimated (F_C, K_z, D_v, D_zdot, force_zero); for lugre. Several
        may follow each other.
    inertia
        Mass in kg between the load cell and the friction, whose acceleration is part of the force; for lugre.
    json
        Print one JSON object on standard output.
    debug
        Show the traceback of an error.
    """
    from clutchid.verbs.rig import rig_recordings

    outside = pressure(options.ambient) or AMBIENT
    fixed = _fixed(fix or (), inertia, law, area)
    logs = rig_recordings(options.reading(files))
    text, content = _lugre(logs, fixed, inertia or 0.0) if law == "lugre" else _coulomb(logs, outside, area)
    if json:
        print_json({"status": "warning" if content["warnings"] else "ok", **content})
        return DONE
    put(text)
    say(content["warnings"])
    return DONE


def _coulomb(logs: Sequence[Log], ambient: float, area: float | None) -> tuple[str, dict[str, Any]]:
    from clutchid.rig import conclusions, coulomb_friction, implied
    from clutchid.rig.summary import level_table, parameter_table

    found = coulomb_friction(logs, ambient=ambient, area=area)
    sentence, *others = conclusions(found)
    levels = [
        {
            "pressure_Pa": level.pressure,
            "friction_N": level.friction.value,
            "low_N": level.friction.low,
            "high_N": level.friction.high,
            "cycles": level.cycles.size,
        }
        for level in found.levels
    ]
    parameters = implied(found)
    text = f"{level_table(found)}\n\n{parameter_table(parameters)}\n\n{sentence}"
    warnings = [f"{log.name}: {warning}" for log in logs for warning in log.warnings] + others
    estimates = {name: asdict(estimate) for name, estimate in parameters.items()}
    return text, {"message": sentence, "parameters": estimates, "levels": levels, "warnings": warnings}


def _fixed(items: Sequence[str], inertia: float | None, law: str, area: float | None) -> dict[str, float]:
    """Parameters by ``NAME=VALUE``; an option that the law does not have is an error."""
    others = {"--area": area} if law == "lugre" else {"--fix": items or None, "--inertia": inertia}
    for option, value in others.items():
        if value is not None:
            other = "coulomb" if law == "lugre" else "lugre"
            raise ParameterError(f"{option}: belongs to --law {other}, not to --law {law}; leave it out.")
    found = {}
    for item in items:
        name, _, text = item.partition("=")
        try:
            found[name.strip()] = float(text)
        except ValueError:
            raise ParameterError(f"--fix {item}: write NAME=VALUE in SI units, for example K_z=1e6.") from None
    return found


def _lugre(logs: Sequence[Log], fixed: Mapping[str, float], inertia: float) -> tuple[str, dict[str, Any]]:
    from clutchid.rig import fit_lugre
    from clutchid.rig.summary import lugre_table

    fits = [fit_lugre(log, fixed=fixed, inertia=inertia) for log in logs]
    estimates = {f"{name}@{fit.name}": asdict(estimate) for fit in fits for name, estimate in fit.parameters.items()}
    message = "; ".join(f"{fit.name}: fit {fit.fit_percent:.1f} % in free run" for fit in fits)
    entries = {fit.name: {"fit_percent": fit.fit_percent, "force_rms_N": fit.rms} for fit in fits}
    warnings = [f"{fit.name}: {warning}" for fit in fits for warning in fit.warnings]
    text = "\n\n".join(lugre_table(fit) for fit in fits)
    return text, {"message": message, "parameters": estimates, "logs": entries, "warnings": warnings}
