"""Parameters of virtual trucks as fields with their rows, and where their values are from."""

from __future__ import annotations

from dataclasses import field
from typing import Any

from clutchid.parameters import Row

FACTS, PAPER = "truck specification", "Appendix A"


def number(value: float, unit: str, meaning: str, low: float, high: float, source: str = FACTS) -> Any:
    """A parameter with its default, unit, meaning, admissible range and source."""
    return field(default=value, metadata={"row": Row(unit, meaning, low, high, True, source)})


def choice(value: str, variants: tuple[str, ...]) -> Any:
    """A parameter that names one of the `variants`."""
    return field(default=value, metadata={"variants": variants})
