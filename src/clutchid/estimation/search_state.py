"""How a search ended, in the same words everywhere, and what a later search needs to continue it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from clutchid.inference.uncertainty.coordinates import Prior

SearchStatus = Literal["converged", "stalled", "limit"]


@dataclass(frozen=True, slots=True)
class SearchState:
    """How a search with priors ended, the parameters that were requested free, and the priors of all free ones in SI.

    `priors` has more names than `free` if the method freed parameters of its own, such as the phase of the carrier.
    """

    status: SearchStatus
    evaluations: int
    free: tuple[str, ...]
    priors: Mapping[str, Prior]


@dataclass(frozen=True, slots=True)
class Continuation:
    """An earlier search that may be continued: its state, values in SI, noise scales, and hashes of its recordings."""

    state: SearchState
    values: Mapping[str, float]
    scales: Mapping[str, float]
    data: Mapping[str, str]

    def applies(self, free: Iterable[str], measure: Iterable[str], data: Mapping[str, str]) -> bool:
        """Whether the same parameters are free, and the same columns of the same recordings are compared.

        A recording without a known hash, such as one that is not from a file, is never the same.
        """
        same = set(free) == set(self.state.free) and set(measure) == set(self.scales)
        return same and bool(data) and "unknown" not in data.values() and dict(data) == dict(self.data)


def ended(status: SearchStatus, evaluations: int) -> str:
    """How a search ended, for messages.

    Examples
    --------
    >>> ended("converged", 34)
    'converged after 34 evaluations'
    """
    words = {
        "converged": "converged after {} evaluations",
        "stalled": "stalled after {} evaluations, not converged: no shorter step lowers the cost",
        "limit": "stopped after {} evaluations, not converged: its budget is used up",
    }
    return words[status].format(evaluations)
