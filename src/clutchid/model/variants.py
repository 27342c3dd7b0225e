"""The model variants: their states and equations."""

from __future__ import annotations

from clutchid.codegen.system import System
from clutchid.names import check_names

#: States of each gas model, in the order of the kernels; a variant is a gas model, with or without Stribeck friction.
_GAS = {
    "isothermal": ("y", "v", "p_A", "p_B", "z"),
    "energy-balance": ("y", "v", "p_A", "p_B", "z", "T_A", "T_B", "p_S", "p_G", "z_h"),
}
_STRIBECK = "-stribeck"
_PROPORTIONAL = "-proportional"

#: Model variants by name, with their states. The one of proportional valves has the spools of both.
VARIANTS = {
    **{f"{gas}{friction}": states for gas, states in _GAS.items() for friction in ("", _STRIBECK)},
    f"energy-balance{_STRIBECK}{_PROPORTIONAL}": (*_GAS["energy-balance"], "x_vs", "x_ve"),
}


def variant_system(variant: str) -> System:
    """The equations of a model variant.

    Raises
    ------
    ParameterError
        If there is no such variant.
    """
    from clutchid.model.energy_balance import energy_balance
    from clutchid.model.isothermal import isothermal

    check_variant(variant)
    if variant.endswith(_PROPORTIONAL):
        return energy_balance(stribeck=True, proportional=True)
    gas = {"isothermal": isothermal, "energy-balance": energy_balance}[variant.removesuffix(_STRIBECK)]
    return gas(stribeck=variant.endswith(_STRIBECK))


def check_variant(variant: str) -> None:
    """Refuse a variant that does not exist.

    Raises
    ------
    ParameterError
        The text has the nearest known one.
    """
    check_names([variant], VARIANTS, "model")
