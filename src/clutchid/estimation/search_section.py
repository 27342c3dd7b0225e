"""Section ``[fit.search]`` of a parameter file: how the search ended, and what a later one needs to continue it."""

from __future__ import annotations

import math
from typing import Any, get_args

from clutchid.errors import ParameterError
from clutchid.estimation.search_state import SearchState, SearchStatus
from clutchid.uncertainty.coordinates import Prior


def search_section(state: SearchState) -> dict[str, Any]:
    """Entries of a search."""
    return {
        "status": state.status,
        "evaluations": state.evaluations,
        "free": list(state.free),
        "priors": {name: [prior.mean, prior.std] for name, prior in state.priors.items()},
    }


def search_in(section: Any) -> SearchState:
    """The search in a file.

    Raises
    ------
    ParameterError
        If an entry cannot be understood.
    """
    state: SearchState | None
    try:
        status: SearchStatus = section["status"]
        priors = {str(name): Prior(float(mean), float(std)) for name, (mean, std) in section["priors"].items()}
        state = SearchState(status, int(section["evaluations"]), tuple(map(str, section["free"])), priors)
    except (KeyError, TypeError, ValueError, AttributeError):
        state = None
    if state is None or state.status not in get_args(SearchStatus) or not all(map(_proper, state.priors.values())):
        raise ParameterError(
            "[fit.search]: status (converged, stalled or limit), evaluations, free, and priors as NAME = [mean, std] "
            "are needed; save the fit again, or take the section out to start a new search."
        )
    return state


def _proper(prior: Prior) -> bool:
    return math.isfinite(prior.mean) and 0.0 < prior.std < math.inf
