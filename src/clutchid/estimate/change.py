"""What has changed in an actuator since its calibration, as position alone tells it.

A load that is read with calibrated numbers takes up whatever else has changed: in the cold the grease is thicker, and
the load seems a quarter higher. So after a fit every number that may change is asked where it would go if it were free,
which one Gauss-Newton step says (the score test; Rao 1948). Where the model errs it would move on the calibration
recording as well: only the difference to that is a change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from clutchid.estimate.changes import Change
from clutchid.estimate.free import FreeParameters
from clutchid.estimate.result import Fit
from clutchid.estimate.search_result import SearchResult
from clutchid.log import FloatArray
from clutchid.model.actuator import Actuator
from clutchid.names import ParameterName, base_of
from clutchid.numerics.failure import Failure
from clutchid.smoother.problem import condense, linearise
from clutchid.smoother.projection import ShootingSolution
from clutchid.uncertainty.calibration import Score
from clutchid.uncertainty.coordinates import SHARES, Prior, coordinates


@dataclass(frozen=True, slots=True)
class Range:
    """How far a number may change, and how differently two recordings of an unchanged actuator tell it.

    `far` and `same` are standard deviations: shares of the value, or in the number's own unit where it may be 0.
    """

    far: float
    same: float


@dataclass(frozen=True, slots=True, eq=False)
class Move:
    """Where the numbers of a kind would go in one recording, beyond where they went at the calibration.

    `shift` (k,) are shares of the value, or in the number's own unit where it may be 0; `far` is their root mean square
    in standard deviations, `std` (k,) those of each.
    """

    names: tuple[str, ...]
    shift: FloatArray
    far: float
    std: FloatArray


#: What may change, and the numbers that tell: those of one kind are set free together; docs/methods.md.
CHANGES: Mapping[str, Mapping[str, Range]] = {
    "viscous friction": {"D_v": Range(0.5, 0.015)},
    "flow of the valves": {"C_vs": Range(0.1, 0.0225), "C_ve": Range(0.1, 0.009)},
    "timing of the valves": {
        "R_0vs": Range(0.02, 0.002),
        "R_0ve": Range(0.02, 0.002),
        "a_0vs": Range(0.03, 0.0055),
        "a_0ve": Range(0.03, 0.004),
    },
}

#: Asked where none of those has changed: all of them look like another supply as well.
SUPPLY: Mapping[str, Mapping[str, Range]] = {"supply pressure": {"P_S": Range(0.05, 0.003)}}

_ALL = {**CHANGES, **SUPPLY}

#: Root mean square of the shifts of one kind, in standard deviations, from which on it has changed: of several numbers,
#: and of a single one, which costs little where it is set free in vain.
CHANGED, SINGLE_CHANGED = 3.0, 2.5


def score(done: SearchResult[ShootingSolution]) -> Score | Failure:
    """Where held numbers of `CHANGES` and `SUPPLY` would go at the end of a search, each in each recording."""
    task, found = done.problem, done.solution
    if isinstance(found, Failure):
        return found
    held = [
        (str(ParameterName(name, stem)), name, near)
        for stem in task.stems
        for kind in _ALL.values()
        for name, near in kind.items()
        if not {name, str(ParameterName(name, stem))} & set(task.names)
        and (name not in SHARES or task.actuator.value(name) > 0.0)
    ]
    names = tuple(own for own, _, _ in held)
    asked = coordinates(task.actuator, names, {}, {own: _prior(task.actuator, n, near) for own, n, near in held})
    # every sample counts: a change is told by more than what a load is read from
    wide = replace(task, coordinates=(*task.coordinates, *asked), noise=replace(task.noise, memory=0.0))
    linear = linearise(wide, np.concatenate([found.x, np.zeros(len(asked))]), found.X)
    if isinstance(linear, Failure):
        return linear
    factor, _ = condense(wide, linear)
    own = slice(len(task.coordinates), len(wide.coordinates))
    # last in the triangle: what is left for these numbers once all others follow
    root = np.array([near.far for _, _, near in held])[:, None] * np.linalg.inv(factor[own, own])
    return Score(names, -root @ factor[own, -1], root @ root.T)


def mean_score(scores: Sequence[Score]) -> Score:
    """The mean of the scores of several recordings, of numbers without the name of a recording."""
    names = tuple(base_of(name) for name in scores[0].names)
    shift = np.mean([one.shift for one in scores], axis=0)
    return Score(names, shift, np.mean([one.covariance for one in scores], axis=0) / len(scores))


def with_changes(wanted: FreeParameters, here: Score, before: Score, actuator: Actuator) -> FreeParameters:
    """`wanted` with the numbers free that have changed since the calibration, whose score is `before`.

    They have values of their own in the recording that has changed most; what others seem to have changed may be its
    doing, as they share the load. The same object where nothing has changed.
    """
    most, released = 0.0, dict[str, Prior]()
    for stem in dict.fromkeys(ParameterName.parse(name).recording or "" for name in here.names):
        free = wanted.free_in(stem)
        far, found = _changed(here, before, stem, free)
        if not found:
            far, found = _supply_changed(here, before, stem, free)
        if far > most:
            most, released = (
                far,
                {str(ParameterName(name, stem)): _prior(actuator, name, near) for name, near in found.items()},
            )
    if not released:
        return wanted
    return replace(wanted, names=(*wanted.names, *released), priors={**wanted.priors, **released})


def _changed(here: Score, before: Score, stem: str, free: Set[str]) -> tuple[float, dict[str, Range]]:
    """How far the kind moved that has changed most in the recording `stem`, and all numbers that have changed."""
    changed = {word: move for word, move in moves(here, before, stem, free).items() if move.far > _least(CHANGES[word])}
    found = {name: CHANGES[word][name] for word, move in changed.items() for name in move.names}
    return max((move.far for move in changed.values()), default=0.0), found


def _supply_changed(here: Score, before: Score, stem: str, free: Set[str]) -> tuple[float, dict[str, Range]]:
    """The same of the supply, where it alone explains more than any other kind alone does."""
    held = {
        word: (names, *_held(here, before, names, stem, free))
        for word, kind in _ALL.items()
        if (names := _known(here, before, kind, stem))
    }
    explained = {}
    for word, (names, now, then) in held.items():
        moved = now.shift - then.shift[: len(names)]
        explained[word] = float(moved @ np.linalg.solve(now.covariance, moved))
    ((word, kind),) = SUPPLY.items()
    if word not in held or explained[word] < max(explained.values()):
        return 0.0, {}
    names, now, then = held[word]
    far = distance(now, then, names, stem)
    return (far, dict(kind)) if far > _least(kind) else (0.0, {})


def _least(kind: Mapping[str, Range]) -> float:
    """How far a kind must have moved to be taken for changed, in standard deviations."""
    return SINGLE_CHANGED if len(kind) == 1 else CHANGED


def _known(here: Score, before: Score, kind: Mapping[str, Range], stem: str) -> list[str]:
    """The numbers of a kind that both scores know."""
    return [name for name in kind if name in before.names and str(ParameterName(name, stem)) in here.names]


def _held(here: Score, before: Score, names: Sequence[str], stem: str, free: Set[str]) -> tuple[Score, Score]:
    """Both scores of `names` with all others held; what is `free` in the fit here is free in the one before as well."""
    now = here.of([str(ParameterName(name, stem)) for name in names])
    return now, before.of([*names, *(name for name in before.names if name in free)])


def moves(here: Score, before: Score, stem: str, free: Set[str]) -> dict[str, Move]:
    """How every kind of `CHANGES` has moved in the recording `stem` since the score `before`, asked together.

    `free` are numbers that are fitted here. A kind is left out of which no number is held and known to both scores.
    """
    asked = [name for kind in CHANGES.values() for name in _known(here, before, kind, stem)]
    now, then = _held(here, before, asked, stem, free)
    shift = dict(zip(asked, (now.shift - then.shift[: len(asked)]).tolist(), strict=True))
    found = {}
    for word, kind in CHANGES.items():
        if names := tuple(name for name in kind if name in shift):
            far = distance(now, then, names, stem)
            std = np.sqrt(np.diag(_difference(now, names, stem)))
            found[word] = Move(names, np.array([shift[name] for name in names]), far, std)
    return found


def distance(here: Score, before: Score, names: Sequence[str], stem: str) -> float:
    """Root mean square of what `names` have moved since `before` in the recording `stem`, in standard deviations."""
    at = [here.names.index(str(ParameterName(name, stem))) for name in names]
    moved = here.shift[at] - before.shift[[before.names.index(name) for name in names]]
    return float(np.sqrt(moved @ np.linalg.solve(_difference(here, names, stem), moved) / len(names)))


def _difference(here: Score, names: Sequence[str], stem: str) -> FloatArray:
    """Covariance of the difference between two recordings of an unchanged actuator."""
    at = [here.names.index(str(ParameterName(name, stem))) for name in names]
    same = {name: near.same for kind in _ALL.values() for name, near in kind.items()}
    spread: FloatArray = here.covariance[np.ix_(at, at)] + np.diag([same[name] ** 2 for name in names])
    return spread


def fitted_changes(released: Sequence[str], before: Actuator, after: Fit) -> tuple[Change, ...]:
    """What has changed in which recording, from the actuator `before` and the fit with `released` free."""
    found = []
    for stem in dict.fromkeys(ParameterName.parse(name).recording or "" for name in released):
        for word, kind in _ALL.items():
            for name in kind:
                own = str(ParameterName(name, stem))
                if own in released:
                    now = after.parameters[own]
                    found.append(
                        Change(stem, name, before.value(name), now.value, now.std, now.unit, None, word, fitted=True)
                    )
    return tuple(found)


def in_si(actuator: Actuator, name: str, share: float) -> float:
    """In SI what is a share of the value, or in the number's own unit where it may be 0."""
    return share * actuator.value(name) if name in SHARES else share


def _prior(actuator: Actuator, name: str, near: Range) -> Prior:
    return Prior(actuator.value(name), in_si(actuator, name, near.far))
