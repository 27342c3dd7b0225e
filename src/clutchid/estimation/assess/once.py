"""What follows from a fit is computed once for each fit."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from clutchid.estimation.result import Fit

Found = TypeVar("Found")


def once_a_fit(function: Callable[[Fit], Found]) -> Callable[[Fit], Found]:
    """The function, which remembers what it found for a fit as long as there is the fit."""
    known: WeakKeyDictionary[Fit, Found] = WeakKeyDictionary()

    @wraps(function)
    def remembered(fit: Fit) -> Found:
        if fit not in known:
            known[fit] = function(fit)
        return known[fit]

    return remembered
