"""An exported observer for Simulink: an S-function of the same C sources."""

from __future__ import annotations

from clutchid.codegen.templates import template
from clutchid.exports.c99 import CStyle
from clutchid.exports.outputs import OUTPUTS


def matlab_files(style: CStyle) -> dict[str, str]:
    """The files of the folder ``matlab`` of an export by their names; the sources in C are in ``../src``."""
    name = style.name
    values = {
        **style.values,
        "outputs": list(OUTPUTS),
        "modules": [f"{name}_model", f"{name}_filter", f"{name}_data", name],
    }
    files = {f"{name}_sfun.c": "sfun.c", "make_sfunction.m": "make_sfunction.m", "README.md": "matlab.md"}
    return {file: template(f"{of}.j2", "clutchid.exports").render(values) for file, of in files.items()}
