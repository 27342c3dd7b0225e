"""Requirements of an exported observer: the host program that checks each, and its drive."""

from __future__ import annotations

import numpy as np

from clutchid.codegen.templates import template
from clutchid.exports.c99 import CStyle, c_number
from clutchid.exports.parity import trial_drive
from clutchid.log import Log
from clutchid.observer.configuration import Observer
from clutchid.observer.intake import CLOCK
from clutchid.strokes.stroke import BEGINS


def requirement_drive(observer: Observer) -> Log:
    """The drive of the checks: the valve vents long enough for the piston to come to rest."""
    return trial_drive(observer, period=2.0, vents=1.2)


def requirement_files(observer: Observer, style: CStyle) -> dict[str, str]:
    """The program that checks each requirement (docs/control_unit.md) by its number, and its drive, by their paths."""
    drive, number = requirement_drive(observer), c_number(style.real)
    columns = [drive[name].tolist() for name in ("position", "duty_supply", "duty_exhaust")]
    values = {
        **style.values,
        "supply": observer.supply.recorded if observer.supply else 0.0,
        "parameters": len(observer.joint.coordinates),
        "considered": observer.joint.considered is not None,
        "shapes": [
            name for name in observer.joint.mapped.actuator.parameter_names if name.startswith("B_") and name != "B_0"
        ],
        "spacing_us": round(observer.spacing * 1e6),
        "clock_us": CLOCK,
        "begins": BEGINS,
        "moving": int(np.argmax(drive["position"] > 2.0 * BEGINS)),
        "engaged": int(np.argmax(drive["duty_exhaust"] > 0.0)),
        "strokes": int(np.count_nonzero(np.diff(drive["duty_supply"]) > 0.0)),
        "drive": [[number(value) for value in row] for row in zip(*columns, strict=True)],
    }
    names = {"test/requirements.c": "requirements.c.j2", "test/drive.h": "drive.h.j2"}
    return {path: template(name, "clutchid.exports").render(values) for path, name in names.items()}
