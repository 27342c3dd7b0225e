"""Progress of a command as data: its stages, the share that is done, and words for a terminal or a page."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import accumulate
from time import monotonic
from types import MappingProxyType
from typing import NamedTuple

from clutchid.codegen.cache import when_compiling
from clutchid.numerics.progress import Stage, Step

__all__ = ["CALIBRATION", "ESTIMATE", "Progressed", "Usual", "shared", "when_compiling", "words"]


class Usual(NamedTuple):
    """Usual duration of a stage: its share of the whole time, and the evaluations until a search has converged."""

    part: float
    evaluations: float = math.inf


#: Usual stages of a calibration and of an estimate of 10 s at 1 kHz, measured with `python benchmarks/app.py --stages`.
CALIBRATION: Mapping[Stage, Usual] = MappingProxyType({
    "reading": Usual(0.01),
    "checks": Usual(0.05),
    "compiling": Usual(0.0),
    "preparation": Usual(0.29),
    "coarse search": Usual(0.23, 15.0),
    "fine search": Usual(0.10, 25.0),
    "evidence": Usual(0.12),
    "position alone": Usual(0.09, 15.0),
    "innovations": Usual(0.08),
    "verification": Usual(0.0),
    "writing": Usual(0.03),
})  # fmt: skip
ESTIMATE: Mapping[Stage, Usual] = MappingProxyType({
    "reading": Usual(0.03),
    "checks": Usual(0.10),
    "compiling": Usual(0.0),
    "alone": Usual(0.0),
    "preparation": Usual(0.20),
    "coarse search": Usual(0.14, 5.0),
    "fine search": Usual(0.14, 10.0),
    "changes": Usual(0.30),
    "evidence": Usual(0.04),
    "causes": Usual(0.0, 60.0),
    "verification": Usual(0.0),
    "writing": Usual(0.05),
})  # fmt: skip

_WORDS: Mapping[Stage, str] = MappingProxyType({
    "changes": "what has changed since the calibration",
    "evidence": "intervals and evidence",
    "position alone": "errors of a load from position alone",
    "innovations": "innovations of the observer",
    "causes": "faults of the inputs",
    "alone": "recordings one by one",
})  # fmt: skip


class Progressed(NamedTuple):
    """A step of a command, in words, with the share of the usual time until it ends, from 0 to 1."""

    step: Step
    share: float
    words: str


def shared(
    usual: Mapping[Stage, Usual], show: Callable[[Progressed], None], clock: Callable[[], float] = monotonic
) -> Callable[[Step], None]:
    """Progress that calls `show` with the share that is done, which never decreases.

    A search approaches the end of its part, because nobody knows when it will have converged; its words say how long
    it takes at most, by the evaluations that are left and the rate of its stage so far on the `clock` in s.

    Examples
    --------
    >>> seen = []
    >>> progress = shared(CALIBRATION, seen.append)
    >>> progress(Step("reading")); progress(Step("fine search", 60, 12.5))
    >>> [(f"{one.share:.2f}", one.words) for one in seen]
    [('0.00', 'reading'), ('0.67', 'fine search, 60 simulations, cost 12.5')]
    """
    parts = [stage.part for stage in usual.values()]
    begins = dict(zip(usual, accumulate(parts, initial=0.0), strict=False))
    whole, share, first, begin = sum(parts), 0.0, Step("reading"), 0.0

    def progress(step: Step) -> None:
        nonlocal share, first, begin
        if step.stage != first.stage or not 0 < first.evaluations < step.evaluations:
            first, begin = step, clock()
        if step.stage in usual:
            stage = usual[step.stage]
            inside = stage.part * (1.0 - math.exp(-step.evaluations / stage.evaluations))
            share = max(share, (begins[step.stage] + inside) / whole)
        count = step.evaluations - first.evaluations
        left = (clock() - begin) / count * (step.most - step.evaluations) if count else math.inf
        show(Progressed(step, share, words(step, left)))

    return progress


def words(step: Step, left: float = math.inf) -> str:
    """A step in words: the stage, how many simulations of its search, their least cost, and the most time left in s.

    Examples
    --------
    >>> words(Step("changes")), words(Step("coarse search", 1))
    ('what has changed since the calibration', 'coarse search, 1 simulation')
    >>> words(Step("fine search", 60, most=600), 212.0)
    'fine search, 60 of at most 600 simulations, at most 4 min left'
    """
    text = _WORDS.get(step.stage, step.stage)
    if step.evaluations:
        most = f" of at most {step.most:g}" if math.isfinite(step.most) else ""
        text += f", {step.evaluations}{most} simulation{'s' if most or step.evaluations > 1 else ''}"
    text += f", cost {step.cost:.4g}" if math.isfinite(step.cost) else ""
    time = f"{left:.0f} s" if left < 120.0 else f"{left / 60.0:.0f} min"
    return f"{text}, at most {time} left" if math.isfinite(left) else text
