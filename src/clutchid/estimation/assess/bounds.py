"""Estimates at their bounds: a reason against the result, or a note where it was measured to be harmless."""

from __future__ import annotations

import numpy as np

from clutchid.estimation.assess.reason import Reason
from clutchid.estimation.outcome import physical_limits
from clutchid.estimation.result import Fit
from clutchid.inference.uncertainty.identifiability import listed
from clutchid.names import base_of


def bound_reasons(fit: Fit) -> list[Reason]:
    """Estimates at bounds that are chosen, not physical: the data favour a value beyond."""
    at_bounds = [] if fit.departure is not None else _at_bounds(fit, physical=False)
    if not at_bounds:
        return []
    their = "its bound" if len(at_bounds) == 1 else "their bounds"
    text = f"{_lie(at_bounds)} at {their}: the data favour a value beyond, or the model is incomplete."
    return [Reason(text)]


def bound_notes(fit: Fit) -> list[str]:
    """Estimates at bounds that say nothing of the error of the load: benchmarks/results/calibration.md."""
    physical = _at_bounds(fit, physical=True)
    if fit.departure is not None:
        found = [*physical, *_at_bounds(fit, physical=False)]
        at, why = "a bound" if len(found) == 1 else "bounds", "no reason against a load from position alone"
    else:
        found, at = physical, "a physical limit" if len(physical) == 1 else "physical limits"
        why = "no reason against the load"
    return [f"{_lie(found)} at {at}: {why}."] if found else []


def _lie(names: list[str]) -> str:
    return f"{listed(names)} {'lies' if len(names) == 1 else 'lie'}"


def _at_bounds(fit: Fit, *, physical: bool) -> list[str]:
    """Estimates at a finite bound that is, or is not, a physical limit, which only fits with priors have."""
    found = []
    for name, estimate in fit.parameters.items():
        ends = zip(("lower", "upper"), fit.bounds.get(name, ()), strict=False)
        limits = physical_limits(fit.actuator, base_of(name)) if fit.follows else ()
        finite = [(word, end) for word, end in ends if np.isfinite(end) and (end in limits) == physical]
        found += [f"{name} ({word})" for word, end in finite if abs(estimate.value - end) <= 1e-9 * abs(end)]
    return found
