"""LuGre friction for a given velocity: kernels generated from the model's equations."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import ModuleType

from clutchid.codegen.cache import load_module

#: Parameters of the friction, in the order of the kernels.
NAMES = ("F_C", "K_z", "D_v", "D_zdot")

_HERE = Path(__file__)


@cache
def kernels() -> ModuleType:
    """Module with ``run_all`` for the deflection, and ``force`` and ``force_NAME`` for arrays of v and z.

    ``force_NAME`` is the derivative of the force with respect to z or a parameter. With a filled cache, neither SymPy
    is imported nor anything compiled.

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

    z, v = sp.symbols("z v", real=True)
    parameters = F_C, K_z, D_v, D_zdot = sp.symbols(NAMES, real=True)
    rate = deflection_rate(v, z, K_z, F_C)
    force = friction_force(v, z, rate, D_v, K_z, D_zdot)
    slopes = {f"force_{symbol}": sp.diff(force, symbol) for symbol in (z, *parameters)}
    return numba_source(System("rig_lugre", (z,), (v,), parameters, (), (rate,))) + "".join(
        elementwise_source(name, (v, z), parameters, value) for name, value in {"force": force, **slopes}.items()
    )
