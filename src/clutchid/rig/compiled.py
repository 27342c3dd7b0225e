"""LuGre friction for a given velocity: kernels generated from the model's equations."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import ModuleType

from clutchid.codegen.cache import load_module

#: Parameters of the friction, in the order of the kernels.
NAMES = ("F_C", "K_z", "D_v", "D_zdot")

#: Below this decay exponent the gain is a series: both have an error of 1e-11 there.
_SERIES_BELOW = 1e-5

_HERE = Path(__file__)


@cache
def kernels() -> ModuleType:
    """Module with ``force`` for arrays of v and z, and ``decay`` and ``gain`` for arrays of v and intervals h.

    While the velocity is constant, the deflection after h is decay times that before, plus gain. ``force_NAME``,
    ``decay_NAME`` and ``gain_NAME`` are derivatives with respect to z or a parameter. With a filled cache, neither
    SymPy is imported nor anything compiled.

    Raises
    ------
    OSError
        If neither the cache folder nor a temporary folder can be written.
    """
    package = _HERE.parent.parent
    codegen = [path for path in (package / "codegen").rglob("*") if path.suffix in (".py", ".j2")]
    return load_module("rig_lugre", [_HERE, package / "model" / "friction.py", *codegen], _source)


def _source() -> str:
    """Source of the module: Eqs. (2) and (3) with the velocity as input."""
    import sympy as sp

    from clutchid.codegen.numba_source import elementwise_source, numba_source
    from clutchid.codegen.system import System
    from clutchid.model.friction import deflection_rate, friction_force

    z, v, h = sp.symbols("z v h", real=True)
    parameters = F_C, K_z, D_v, D_zdot = sp.symbols(NAMES, real=True)
    rate = deflection_rate(v, z, K_z, F_C)
    force = friction_force(v, z, rate, D_v, K_z, D_zdot)
    slope, drive = sp.diff(rate, z), rate.subs(z, 0)  # the rate is linear in z: solved exactly
    decay = sp.exp(slope * h)
    series = drive * h * (1 + slope * h / 2)
    gain = sp.Piecewise((drive * (decay - 1) / slope, -slope * h > _SERIES_BELOW), (series, True))
    sources = [numba_source(System("rig_lugre", (z,), (v,), parameters, (), (rate,)))]
    sources += [elementwise_source("force", (v, z), parameters, force)]
    sources += [elementwise_source(f"force_{p}", (v, z), parameters, sp.diff(force, p)) for p in (z, *parameters)]
    for name, value in {"decay": decay, "gain": gain}.items():
        sources.append(elementwise_source(name, (v, h), (F_C, K_z), value))
        sources += [elementwise_source(f"{name}_{p}", (v, h), (F_C, K_z), sp.diff(value, p)) for p in (F_C, K_z)]
    return "".join(sources)
