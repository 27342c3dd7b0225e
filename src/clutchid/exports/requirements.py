"""Requirements of an exported observer: the list, the host program that checks each, and its drive."""

from __future__ import annotations

import tomllib
from typing import NamedTuple

import numpy as np

from clutchid.codegen.templates import template
from clutchid.exports.c99 import CStyle
from clutchid.exports.parity import begins_us, trial_drive
from clutchid.log import Log
from clutchid.observer.configuration import Observer
from clutchid.observer.intake import CLOCK
from clutchid.strokes.stroke import BEGINS


class Requirement(NamedTuple):
    """A sentence on what an export does, functions in C that do it, and what it needs; empty for nothing."""

    text: str
    code: str
    needs: str = ""


_LIST = tomllib.loads(template("requirements.toml", "clutchid.exports").render())

#: Requirements by their numbers.
REQUIREMENTS = {number: Requirement(**row) for number, row in _LIST.items()}


def requirement_table(name: str) -> str:
    """The requirements with the check of each in ``test/requirements.c``, and the functions of an export's C."""
    return "| | requirement | check | code |\n|---|---|---|---|\n" + "\n".join(
        f"| {number} | {row.text} | `{number.lower()}` | `{row.code.replace('NAME', name).replace(' ', '`, `')}` |"
        for number, row in REQUIREMENTS.items()
    )


def requirement_drive(observer: Observer) -> Log:
    """The drive of the checks, which they repeat: the piston comes to rest, and begins where friction leaves it."""
    drive = trial_drive(observer, period=2.0, vents=1.2, seconds=6.0)
    return drive.slice(round(2.0 / observer.spacing), len(drive))


def requirement_files(observer: Observer, style: CStyle) -> dict[str, str]:
    """The program that checks each requirement by its number, and its drive, by their paths."""
    drive, names = requirement_drive(observer), observer.joint.mapped.actuator.parameter_names
    values = {
        **style.values,
        "begins_us": begins_us(drive),
        "supply": observer.supply.recorded if observer.supply else 0.0,
        "parameters": len(observer.joint.coordinates),
        "considered": observer.joint.considered is not None,
        "shapes": [name for name in names if name.startswith("B_") and name != "B_0"],
        "spacing_us": round(observer.spacing * 1e6),
        "clock_us": CLOCK,
        "requirements": REQUIREMENTS,
        "begins": BEGINS,
        "moving": int(np.argmax(drive["position"] > 2.0 * BEGINS)),
        "engaged": int(np.argmax(drive["duty_exhaust"] > 0.0)),
        "drive": np.column_stack([drive[name] for name in ("position", "duty_supply", "duty_exhaust")]).tolist(),
    }
    made = ("requirements.c", "drive.h")
    return {f"test/{name}": template(f"{name}.j2", "clutchid.exports").render(values) for name in made}
