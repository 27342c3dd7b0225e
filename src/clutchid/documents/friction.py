"""Friction of a rig as a document: by level and law, with what follows for the model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict

from clutchid.documents.document import Document, LabelRow, Notice
from clutchid.documents.results import RigFriction
from clutchid.estimation import Estimate
from clutchid.log import Log
from clutchid.messages import text_table
from clutchid.rig import CoulombFriction, LugreFit, conclusions, implied


def friction_document(rig: RigFriction, command: str = "") -> Document:
    """Document of the friction of a rig."""
    if isinstance(rig.friction, CoulombFriction):
        return _coulomb(rig.logs, rig.friction, command)
    return _lugre(rig.friction, command)


def _coulomb(logs: Sequence[Log], friction: CoulombFriction, command: str) -> Document:
    sentence, *others = conclusions(friction)
    parameters = implied(friction)
    levels = [
        {
            "pressure_Pa": level.pressure,
            "friction_N": level.friction.value,
            "low_N": level.friction.low,
            "high_N": level.friction.high,
            "cycles": level.cycles.size,
        }
        for level in friction.levels
    ]
    warnings = [f"{log.name}: {warning}" for log in logs for warning in log.warnings] + others
    estimates = {name: asdict(estimate) for name, estimate in parameters.items()}
    text = f"{_level_lines(friction)}\n\n{_parameter_lines(parameters)}\n\n{sentence}"
    return _document(text, {"message": sentence, "parameters": estimates, "levels": levels}, warnings, command)


def _lugre(fits: Sequence[LugreFit], command: str) -> Document:
    estimates = {f"{name}@{fit.name}": asdict(estimate) for fit in fits for name, estimate in fit.parameters.items()}
    message = "; ".join(f"{fit.name}: fit {fit.fit_percent:.1f} % in free run" for fit in fits)
    logs = {fit.name: {"fit_percent": fit.fit_percent, "force_rms_N": fit.rms} for fit in fits}
    warnings = [f"{fit.name}: {warning}" for fit in fits for warning in fit.warnings]
    data = {"message": message, "parameters": estimates, "logs": logs}
    return _document("\n\n".join(map(_lugre_lines, fits)), data, warnings, command)


def _document(text: str, data: Mapping[str, object], warnings: Sequence[str], command: str) -> Document:
    status = "warning" if warnings else "ok"
    return Document(
        "Friction of a rig", rows=(LabelRow(None, text, fixed=True),), notices=tuple(map(Notice, warnings)),
        data=lambda: {"status": status, **data, "warnings": list(warnings)}, command=command,
    )  # fmt: skip


def _parameter_lines(parameters: Mapping[str, Estimate]) -> str:
    """Parameters with their 95 % intervals, one per line."""
    rows = [
        [name, f"{e.value:.4g}", *(f"{x:.4g}" if math.isfinite(e.std) else "-" for x in (e.low, e.high)), e.unit]
        for name, e in parameters.items()
    ]
    return "\n".join(text_table([["parameter", "value", "low", "high", "unit"], *rows], 0, ""))


def _lugre_lines(fit: LugreFit) -> str:
    """Fit and parameters of one recording."""
    head = (
        f"{fit.name}: fit {fit.fit_percent:.1f} % in free run, rms {fit.rms:.3g} N, "
        f"{fit.effective_samples:.0f} effective samples"
    )
    return f"{head}\n{_parameter_lines(fit.parameters)}" if fit.parameters else head


def _level_lines(coulomb: CoulombFriction) -> str:
    """Coulomb friction by level, one per line."""
    rows = []
    for level in coulomb.levels:
        friction, finite = level.friction, math.isfinite(level.friction.std)
        rows.append(
            [
                f"{level.pressure / 1e5:.2f}" if math.isfinite(level.pressure) else "-",
                f"{friction.value:.3f}",
                *(f"{x:.3f}" if finite else "-" for x in (friction.low, friction.high)),
                f"{level.cycles.size}",
                f"{level.cycles[0]:.2f} .. {level.cycles[-1]:.2f}",
                *(f"{speed * 1e3:+.1f}" for speed in level.speeds),
            ]
        )
    headings = ["bar above ambient", "F_C [N]", "low", "high", "cycles", "first .. last", "out [mm/s]", "back [mm/s]"]
    return "\n".join(text_table([headings, *rows], 0, ""))
