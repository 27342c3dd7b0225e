"""Failure of mathematics as a value."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Failure:
    """A point at which the residuals cannot be computed, and why."""

    message: str
