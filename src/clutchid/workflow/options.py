"""Options that people write as text, on the command line and on the page."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

from clutchid.errors import ParameterError
from clutchid.log.units import UNITS, known_units

if TYPE_CHECKING:
    from clutchid.inference.uncertainty.coordinates import Prior


Default = TypeVar("Default", float, float | None)


def pressure(text: str | None, default: Default) -> float | Default:
    """A pressure option in Pa: a number in Pa, or with a unit."""
    if text is None:
        return default
    number, unit = text.strip(), "Pa"
    for name in sorted(known_units("Pa"), key=len, reverse=True):
        if number.endswith(name):
            number, unit = number.removesuffix(name).strip(), name
            break
    try:
        value = float(number) * UNITS[unit].scale
    except ValueError:
        value = math.nan
    if UNITS[unit].gauge or not (1e4 < value < 2e5):
        raise ParameterError(
            f"--ambient {text}: an absolute pressure between 0.1 and 2 bar is needed, for example 1.013bar or 101300."
        )
    return value


def bounds(items: Sequence[str]) -> dict[str, tuple[float, float]]:
    """``NAME=LOW:HIGH`` options; an empty side is open."""
    result = {}
    for item in items:
        match = re.fullmatch(r"\s*(\w+)\s*=([^:]*):([^:]*)", item)
        try:
            name, low, high = match.groups() if match else ("", "x", "x")
            result[name] = (float(low or "-inf"), float(high or "inf"))
        except ValueError:
            raise ParameterError(
                f"--bounds {item}: write NAME=LOW:HIGH in SI units, for example C_vs=1e-8:3e-8; a side may be empty."
            ) from None
    return result


def priors(items: Sequence[str]) -> dict[str, Prior]:
    """``NAME=VALUE±STD`` options."""
    from clutchid.inference.uncertainty.coordinates import Prior

    result = {}
    for item in items:
        match = re.fullmatch(r"\s*([^=\s]+)\s*=\s*(.+?)\s*(?:±|\+-|\+/-)\s*(.+?)\s*", item)
        try:
            name, mean, std = match.groups() if match else ("", "x", "x")
            result[name] = Prior(float(mean), float(std))
        except ValueError:
            result[name] = Prior(math.nan, math.nan)
        if not (math.isfinite(result[name].mean) and 0.0 < result[name].std < math.inf):
            raise ParameterError(
                f"--prior {item}: write NAME=VALUE±STD in SI units, STD a standard deviation above 0, "
                "for example P_S=8.5e5±5e3."
            )
    return result
