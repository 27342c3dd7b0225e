"""Numerical failure as a value."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Failure:
    """A numerical failure, for example a point at which the simulation diverges, and its reason."""

    message: str
