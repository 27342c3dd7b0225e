"""Functions of a fit that are computed once for each fit."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from clutchid.estimation.result import Fit

Value = TypeVar("Value")


def once_a_fit(function: Callable[[Fit], Value]) -> Callable[[Fit], Value]:
    """The function, which remembers what it found for a fit as long as there is the fit."""
    known: WeakKeyDictionary[Fit, Value] = WeakKeyDictionary()

    @wraps(function)
    def remembered(fit: Fit) -> Value:
        if fit not in known:
            known[fit] = function(fit)
        return known[fit]

    return remembered
