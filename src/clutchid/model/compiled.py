"""The compiled kernels of a model variant, from the cache or made from the equations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType

from clutchid.codegen.cache import load_module
from clutchid.codegen.system import System
from clutchid.errors import ParameterError
from clutchid.parameters import unknown_name

#: States of each gas model, in the order of the kernels; a variant is a gas model, with or without Stribeck friction.
_GAS = {
    "isothermal": ("y", "v", "p_A", "p_B", "z"),
    "energy-balance": ("y", "v", "p_A", "p_B", "z", "T_A", "T_B", "p_S", "p_G", "z_h"),
}
_STRIBECK = "-stribeck"

#: Model variants by name, with their states.
VARIANTS = {f"{gas}{friction}": states for gas, states in _GAS.items() for friction in ("", _STRIBECK)}

_HERE = Path(__file__).parent


def system(variant: str) -> System:
    """The equations of a model variant.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    from clutchid.model.energy_balance import energy_balance
    from clutchid.model.isothermal import isothermal

    check_variant(variant)
    gas = {"isothermal": isothermal, "energy-balance": energy_balance}[variant.removesuffix(_STRIBECK)]
    return gas(stribeck=variant.endswith(_STRIBECK))


def check_variant(variant: str) -> None:
    """Refuse a variant that does not exist.

    Raises
    ------
    ParameterError
        The text has the nearest known one.
    """
    if variant not in VARIANTS:
        raise ParameterError(unknown_name(variant, VARIANTS, "model"))


@cache
def kernels(variant: str) -> ModuleType:
    """Kernels of `variant`: ``run``, ``run_table``, ``run_all`` and ``linearise``, and what else is made of its text.

    That is ``terms`` one after the other, the ``paper_table`` of the load, and ``opening`` and ``passed_pulses`` of
    the valves for arrays. A warm call neither imports SymPy nor compiles.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    check_variant(variant)
    code = [path for folder in (_HERE, _HERE.parent / "codegen") for path in folder.rglob("*") if path.is_file()]
    sources = [path for path in code if path.suffix in (".py", ".j2")]
    return load_module(variant.replace("-", "_"), [*sources, _HERE.parent / "parameters.py"], _builder(variant))


def _builder(variant: str) -> Callable[[], str]:
    def build() -> str:
        import sympy as sp

        from clutchid.codegen.numba_source import elementwise_source, function_source, numba_source
        from clutchid.codegen.terms import terms_source
        from clutchid.model.load import table_expressions
        from clutchid.model.opening import opening, passed_pulses

        text = system(variant)
        knots = sp.symbols("t_1:5 phi2_slope", real=True)
        u, R_0, R_1, a, b, s, e, c, d = sp.symbols("u R_0 R_1 a b s e c d", real=True)
        return "".join(
            (
                numba_source(text),
                terms_source(text),
                function_source("paper_table", knots, table_expressions(*knots)),
                elementwise_source("opening", (u,), (R_0, R_1), opening(u, R_0, R_1)),
                elementwise_source("passed_pulses", (a, b, c, d), (s, e), passed_pulses(a, b, s, e, c, d)),
            )
        )

    return build
