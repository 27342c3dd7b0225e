"""`Step`: where a long computation is, as data that a terminal and a page word; `Progress`: who is called with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

#: Stages of a fit in their order. "position alone" are the searches by which a calibration learns how a load from
#: position alone errs, "alone" the fits of single recordings behind that of all,
#: "causes" what may be wrong with the inputs of a reading that its calibration does not explain.
Stage = Literal[
    "reading",
    "checks",
    "compiling",
    "preparation",
    "coarse search",
    "fine search",
    "changes",
    "evidence",
    "position alone",
    "innovations",
    "causes",
    "alone",
    "verification",
    "writing",
]


class Step(NamedTuple):
    """A stage that has begun or goes on, its evaluations so far, and the cost of a search, NaN where there is none.

    After `most` evaluations it ends, converged or not; infinite where there is no such limit.
    """

    stage: Stage
    evaluations: int = 0
    cost: float = math.nan
    most: float = math.inf


Progress = Callable[[Step], None]


def report_stage(progress: Progress | None, stage: Stage) -> None:
    """Say that a stage begins, where somebody listens."""
    if progress is not None:
        progress(Step(stage))


def within_stage(progress: Progress | None, stage: Stage, before: int = 0, more: int = 0) -> Progress | None:
    """Progress of a computation within another one, all of it under the name of the outer `stage`.

    The outer one has had `before` evaluations, and takes `more` at most.

    Examples
    --------
    >>> within_stage(print, "alone", 40, 600)(Step("fine search", 3, 0.5, 600))
    Step(stage='alone', evaluations=43, cost=0.5, most=1200)
    """

    def outer(step: Step) -> Step:
        return step._replace(stage=stage, evaluations=before + step.evaluations, most=step.most + more)

    return None if progress is None else lambda step: progress(outer(step))
