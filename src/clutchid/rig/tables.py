"""Text tables of rig friction for the command line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from clutchid.estimation.result import Estimate
from clutchid.rig.coulomb import CoulombFriction
from clutchid.rig.lugre import LugreFit


def parameter_table(parameters: Mapping[str, Estimate]) -> str:
    """Parameters with their 95 % intervals, one per line."""
    rows = [
        [name, f"{e.value:.4g}", *(f"{x:.4g}" if math.isfinite(e.std) else "-" for x in (e.low, e.high)), e.unit]
        for name, e in parameters.items()
    ]
    return _table(["parameter", "value", "low", "high", "unit"], rows)


def lugre_table(found: LugreFit) -> str:
    """Fit and parameters of one recording."""
    head = (
        f"{found.name}: fit {found.fit_percent:.1f} % in free run, rms {found.rms:.3g} N, "
        f"{found.effective_samples:.0f} effective samples"
    )
    return f"{head}\n{parameter_table(found.parameters)}" if found.parameters else head


def level_table(found: CoulombFriction) -> str:
    """Coulomb friction by level, one per line."""
    rows = []
    for level in found.levels:
        friction, known = level.friction, math.isfinite(level.friction.std)
        rows.append(
            [
                f"{level.pressure / 1e5:.2f}" if math.isfinite(level.pressure) else "-",
                f"{friction.value:.3f}",
                *(f"{x:.3f}" if known else "-" for x in (friction.low, friction.high)),
                f"{level.cycles.size}",
                f"{level.cycles[0]:.2f} .. {level.cycles[-1]:.2f}",
                *(f"{speed * 1e3:+.1f}" for speed in level.speeds),
            ]
        )
    headings = ["bar above ambient", "F_C [N]", "low", "high", "cycles", "first .. last", "out [mm/s]", "back [mm/s]"]
    return _table(headings, rows)


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    lines = [[text.rjust(width) for text, width in zip(row, widths, strict=True)] for row in (headings, *rows)]
    return "\n".join("  ".join(line).rstrip() for line in lines)
