"""What may have changed in an actuator since its calibration, though not surely enough to be set free.

It is held, and the band counts it: one that does not is right for an actuator that has not changed, and says nothing of
the one at hand. Grease that is 3 K warmer moves the load by 3 % of its peak, and no score test can be sure of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Set

import numpy as np

from clutchid.estimate.change import CHANGES, Move, in_si, moves
from clutchid.estimate.changes import Change
from clutchid.model.actuator import Actuator
from clutchid.uncertainty.calibration import Calibration, Score

#: Root mean square of the shifts of one kind, in standard deviations, from which on it may have changed.
SUSPECTED = 2.0

#: With the grease the walls have become warmer or colder, by this share: 30 K.
WARMTH = 0.1


def doubted(
    calibration: Calibration,
    here: Score,
    free: Mapping[str, Set[str]],
    released: Set[str],
    actuator: Actuator,
    slow: bool = False,
) -> tuple[Calibration, tuple[Change, ...]]:
    """`calibration`, less sure of what may have changed since, and each parameter of a kind that seems to have.

    Parameters
    ----------
    calibration : Calibration
        With a score.
    here : Score
        Where held numbers would go at the end of the fit.
    free : {recording: names}
        What is fitted in each recording.
    released : names
        What was set free because it has changed. Where there is any, all others of `CHANGES` are known only as well as
        two recordings tell them alike.
    actuator : Actuator
        As calibrated.
    slow
        Whether the pulses of a recording were put together. Their edges are not where they were at the calibration, so
        again all of `CHANGES` are known only so well.
    """
    assert calibration.score is not None, "without a score nothing can be asked"
    found, most = list[Change](), dict[str, Move]()
    for stem, names in free.items():
        for word, move in moves(here, calibration.score, stem, names).items():
            if move.far > SUSPECTED:
                found += _suspected(stem, word, move, actuator)
                if word not in most or move.far > most[word].far:
                    most[word] = move
    shifts = [dict(zip(move.names, move.shift.tolist(), strict=True)) for move in most.values()]
    if released or slow:
        shifts += [{n: near.same} for kind in CHANGES.values() for n, near in kind.items() if n not in released]
    if "D_v" in released:
        shifts.append({"T_w": WARMTH})
    for shift in shifts:
        by = np.array([in_si(actuator, name, share) for name, share in shift.items()])
        calibration = calibration.inflated(tuple(shift), np.outer(by, by))
    return calibration, tuple(found)


def _suspected(stem: str, word: str, move: Move, actuator: Actuator) -> list[Change]:
    return [
        Change(
            stem,
            name,
            actuator.value(name),
            actuator.value(name) + in_si(actuator, name, share),
            abs(in_si(actuator, name, std)),
            actuator.unit(name),
            None,
            word,
            fitted=False,
            distance=move.far,
        )
        for name, share, std in zip(move.names, move.shift.tolist(), move.std.tolist(), strict=True)
    ]
