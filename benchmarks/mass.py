"""Why warm trucks are read with a lower supply: ``python benchmarks/mass.py FOLDER --family B --seed 3200``.

Every truck is calibrated once with pressure; its worn clutch is read from position alone under each case of
`widening.py`. Variants differ in what a calibration frees and what may drift afterwards. ``--without`` takes a property
from the virtual truck (`LOSSES`), for the calibration and for the reading: a property whose loss removes the error is
one that the model lacks. ``--scores`` prints, at the reading with the true load and the changes of temperature, by how
much each fixed parameter alone would lower the cost, and what load the free reading would then have.

FOLDER keeps every calibration and reading, so a run goes on where it was interrupted. Errors are those of
``prove.py``, rms over 0.5 to 20 mm in % of the peak, median / worst; bias is the mean signed error; "lower supply" the
share of readings in which a changed supply pressure has more than half of the probability.
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from prove import SECONDS
from widening import CASES, left_out, seeds, worn_clutch

from clutchid import FitRequest, Prior, fit
from clutchid.estimation.hypotheses import explanation
from clutchid.estimation.position_only import position_only_errors
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.shooting import SHOOTING
from clutchid.inference.problem import Problem, with_hypothesis
from clutchid.inference.smoother.problem import condense, linearise
from clutchid.inference.smoother.search import ShootingSolution
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.coordinates import Coordinate, coordinates
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.parameters import Drift, Parameters
from clutchid.truck import GRID, Drive, Vehicle, drive, truck

TEMPERATURE, SUPPLY = "temperature and grease", "supply pressure"

#: Drift of the parameters of friction near rest, as shipped: what a variant may do without.
NEAR_REST: Mapping[str, Drift | None] = {name: Parameters.row(name).drift for name in ("K_z", "R_S", "v_S")}


class Variant(NamedTuple):
    """Prior of the mass in a calibration, from the truck, None for the default; and the drift of friction near rest."""

    mass: Callable[[Vehicle], Prior] | None = None
    drift: Mapping[str, Drift | None] = NEAR_REST


FIXED: Mapping[str, Drift | None] = dict.fromkeys(NEAR_REST)

VARIANTS: Mapping[str, Variant] = {
    "mass of Appendix A": Variant(lambda _: Prior(10.0, 1e-3), FIXED),
    "true mass": Variant(lambda kind: Prior(kind.M, 1e-3), FIXED),
    "mass free": Variant(drift=FIXED),
    "as shipped": Variant(),
}

#: What a truck loses, by name. Those of family B alone are left out for family A.
LOSSES: Mapping[str, Mapping[str, Any]] = {
    "nothing": {},
    "another mass": {"M": 10.0},
    "shear thinning": {"v_g": 1e9},
    "drop over the tube": {"C_t": 4e-7},
    "curved scale of the position": {"e_lin": 0.0},
    "static friction": {"R_S": 1.0},
}


class Reading(NamedTuple):
    """A load read from position alone: rms and mean error in % of the peak, probability of a changed supply."""

    error: float
    bias: float
    supply: float
    seconds: float


@contextmanager
def drifting(drifts: Mapping[str, Drift | None]) -> Iterator[None]:
    """With other drifts of some parameters."""
    rows = Parameters.rows()
    before = {name: rows[name].drift for name in drifts}
    try:
        for name, drift_of in drifts.items():
            object.__setattr__(rows[name], "drift", drift_of)
        yield
    finally:
        for name, drift_of in before.items():
            object.__setattr__(rows[name], "drift", drift_of)


class Setting(NamedTuple):
    """A truck of a family, what it lost, and where its results are kept."""

    number: int
    family: str
    without: str
    folder: Path

    def kind(self) -> Vehicle:
        """The truck."""
        return truck(self.number, self.family).replace(dict(LOSSES[self.without]))

    def path(self, *parts: str) -> Path:
        """File of a result."""
        name = "_".join((f"{self.family}{self.number}", self.without, *parts)).replace(" ", "-")
        return self.folder / name


def calibration_log(setting: Setting) -> Log:
    """The calibration recording of a truck, with pressure and without conditions."""
    driven = drive(setting.kind(), seconds=SECONDS, seed=seeds(setting.number)[0], name="calibration", conditions=True)
    return driven.log.without(*left_out("default"))


def worn(setting: Setting, case: str) -> Drive:
    """A recording of the worn clutch of a truck under a case of `widening.py`."""
    return worn_clutch(setting.number, setting.family, case, kind=setting.kind())


def calibrated(setting: Setting, name: str) -> tuple[Actuator, Calibration]:
    """The kept calibration of a truck, or a new one; its errors from position alone belong to the variant."""
    variant = VARIANTS[name]
    prior = {} if variant.mass is None else {"M": variant.mass(setting.kind())}
    shared = setting.path("calibration", "mass free" if variant.mass is None else name)

    def once() -> tuple[Actuator, Calibration]:
        with drifting(FIXED):
            result = fit(
                calibration_log(setting),
                measure=("position", "pressure_a"),
                free=("auto",),
                request=FitRequest(priors=prior),
            )
        assert result.calibration is not None, "a calibration with pressure keeps one"
        return result.actuator, result.calibration

    actuator, calibration = stored(shared.with_suffix(".pickle"), once)
    if variant.drift is FIXED:
        return actuator, calibration

    def anew() -> tuple[Actuator, Calibration]:
        errors = position_only_errors(SHOOTING, [calibration_log(setting)], actuator, calibration)
        return actuator, replace(calibration, position_only=errors)

    with drifting(variant.drift):
        return stored(setting.path("calibration", name).with_suffix(".pickle"), anew)


def stored(path: Path, make: Callable[[], tuple[Actuator, Calibration]]) -> tuple[Actuator, Calibration]:
    """What `path` keeps, made by `make` if there is nothing."""
    if not path.exists():
        part = path.with_suffix(f".{os.getpid()}")
        part.write_bytes(pickle.dumps(make()))
        part.rename(path)
    content: tuple[Actuator, Calibration] = pickle.loads(path.read_bytes())
    return content


def reading(setting: Setting, name: str, case: str) -> Reading | None:
    """The kept reading of a case, or a new one; None if its search fails."""
    path = setting.path(name, case).with_suffix(".json")
    if not path.exists():
        actuator, calibration = calibrated(setting, name)
        driven = worn(setting, case)
        with drifting(VARIANTS[name].drift):
            result = _read(driven, actuator, calibration)
        path.write_text(json.dumps(None if result is None else result._asdict()))
    values = json.loads(path.read_text())
    return None if values is None else Reading(**values)


def _read(driven: Drive, actuator: Actuator, calibration: Calibration) -> Reading | None:
    begin = time.perf_counter()
    result = fit(driven.log.without(*left_out("default")), actuator, request=FitRequest(calibration=calibration))
    if result.status == "failed":
        return None
    error = percent(driven, np.interp(GRID, result.load_curve.position, result.load_curve.force))
    supply = max((change.probability for change in result.changes if change.group == SUPPLY), default=0.0)
    return Reading(rms(error), float(np.mean(error)), supply, time.perf_counter() - begin)


def percent(driven: Drive, force: FloatArray) -> FloatArray:
    """Error of a load on the grid in % of the true peak."""
    truth = driven.truth.load(GRID)
    error: FloatArray = 100 * (force - truth) / truth.max()
    return error


def rms(values: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def one_truck(setting: Setting, names: Sequence[str], cases: Sequence[str]) -> None:
    """Every reading of a truck, kept; each is printed, after the calibrated masses."""
    for name in names:
        actuator, calibration = calibrated(setting, name)
        std = np.sqrt(calibration.covariance_of(("M",))[0, 0])
        masses = f"{actuator.value('M'):.1f} ± {std:.1f} kg, true {setting.kind().M:.1f} kg"
        print(f"{setting.family}{setting.number:<6}{setting.without:<24}{'mass':<20}{name:<24}{masses}", flush=True)
    for case in cases:
        for name in names:
            result = reading(setting, name, case)
            cells = "no load" if result is None else f"{result.error:6.2f} {result.bias:+6.2f} {result.supply:5.2f}"
            print(f"{setting.family}{setting.number:<6}{setting.without:<24}{case:<20}{name:<24}{cells}", flush=True)


def table(settings: Sequence[Setting], names: Sequence[str], cases: Sequence[str]) -> Iterator[str]:
    """A line for each case and variant, over all trucks."""
    yield f"{'case':<20}{'variant':<24}{'trucks':>8}{'error [%]':>16}{'bias [%]':>10}{'lower supply':>14}{'failed':>8}"
    for case in cases:
        for name in names:
            readings = [reading(setting, name, case) for setting in settings]
            fits = [r for r in readings if r is not None]
            error = np.array([r.error for r in fits])
            supply = 100 * np.mean([r.supply > 0.5 for r in fits])
            yield (
                f"{case:<20}{name:<24}{len(fits):>8}{f'{np.median(error):.2f} / {error.max():.2f}':>16}"
                f"{np.mean([r.bias for r in fits]):>+10.2f}{f'{supply:.0f} %':>14}{len(readings) - len(fits):>8}"
            )


#: Standard deviation in N with which `scores` hold the load at the truth.
AT_TRUTH = 20.0


def scores(setting: Setting, name: str, case: str) -> Iterator[str]:
    """What single parameters would gain at the changes of temperature, with the load free and at the truth."""
    actuator, calibration = calibrated(setting, name)
    driven = worn(setting, case)
    with drifting(VARIANTS[name].drift):
        free = FreeParameters(actuator.load.names, ("position",))
        start = SHOOTING.search([driven.log.without(*left_out("default"))], actuator, free, calibration, None)
        if SHOOTING.changes is None or isinstance(start.solution, Failure) or calibration.position_only is None:
            return
        first = explanation(start, calibration.position_only.dispersion)
        warmer = with_hypothesis(start.problem, (TEMPERATURE,))
        x = np.clip(first.solution.x + first.under((TEMPERATURE,)).step, *warmer.bounds())
        reached = SHOOTING.changes.refine(start, warmer, x)
        weights = _weights(actuator, driven)
        priors = {n: Prior(value, AT_TRUTH) for n, value in zip(actuator.load.names, weights.tolist(), strict=True)}
        held = replace(warmer, measured={**warmer.measured, **priors})
        if isinstance(reached.solution, Failure):
            return
        true = SHOOTING.changes.refine(reached, held, reached.solution.x)
        for what, result in (("free", reached), ("true", true)):
            if not isinstance(result.solution, Failure):
                yield f"  load {what}: " + "; ".join(_gains(result.problem, result.solution, driven)[:8])


#: Positions in m at which the load weights meet the true load: from the rest on, and to the end of all strokes.
ALL = np.linspace(0.0, 0.0235, 500)


def _weights(actuator: Actuator, driven: Drive) -> FloatArray:
    """Load weights, shape (m,), nearest to the true load, and to the calibrated ones beyond it."""
    phi, before = actuator.load.phi(ALL), np.array(actuator.load.theta)
    rows = np.vstack([phi, 1e-3 * np.eye(before.size)])
    change = np.linalg.lstsq(rows, np.r_[driven.truth.load(ALL) - phi @ before, np.zeros(before.size)], rcond=None)[0]
    result: FloatArray = before + change
    return result


def _gains(problem: Problem, solution: ShootingSolution, driven: Drive) -> list[str]:
    """What each parameter that is fixed would gain, by the linearisation, the largest first."""
    extra = _fixed(problem)
    k = len(problem.coordinates)
    wide = problem.widened(extra)
    linear = linearise(wide, np.r_[solution.x, np.zeros(len(extra))], solution.at.X)
    if isinstance(linear, Failure):
        return []
    data, _ = condense(wide, replace(linear, prior=linear.prior[:0]))
    prior = problem.prior_at(solution.x.tobytes())

    def least(added: Sequence[int]) -> tuple[float, FloatArray]:
        at = [*range(k), *(k + i for i in added), data.shape[1] - 1]
        own = np.hstack([prior[:, :k], np.zeros((len(prior), len(added))), prior[:, -1:]])
        unit = np.hstack([np.zeros((len(added), k)), np.eye(len(added)), np.zeros((len(added), 1))])
        rows = np.vstack([data[:, at], own, unit])
        step = np.linalg.lstsq(rows[:, :-1], -rows[:, -1], rcond=None)[0]
        return float(np.sum((rows[:, :-1] @ step + rows[:, -1]) ** 2)), step

    def bias(step: FloatArray) -> float:
        load = problem.actuator_of(solution.x + step[:k], problem.stems[0]).load
        return float(np.mean(percent(driven, load.force(GRID))))

    base, none = least([])
    gains = [(base - cost, c.base, step) for i, c in enumerate(extra) for cost, step in [least([i])]]
    best = sorted(gains, key=lambda pair: -pair[0])
    shown = [f"{name} {gain:.0f} ({step[k]:+.1f} spreads, load {bias(step):+.1f} %)" for gain, name, step in best]
    return [f"cost {base:.0f}, load {bias(none):+.1f} %", *shown]


def _fixed(problem: Problem) -> tuple[Coordinate, ...]:
    """Coordinates of the parameters that act, have a prior and are fixed in a reading."""
    actuator = problem.actuator
    free = {c.base for c in problem.coordinates}
    rows = {n: actuator.rows[n] for n in actuator.acting if n in actuator.rows and n not in free}
    return coordinates(actuator, [n for n, row in rows.items() if row.spread is not None], {}, {})


def main() -> None:
    """Print a line a reading, then the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--family", default="B", choices=("A", "B"))
    options.add_argument("--trucks", type=int, default=12)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--case", action="append", choices=tuple(CASES), help="default: nothing, warm, supply")
    options.add_argument("--variant", action="append", choices=tuple(VARIANTS), help="default: all but the true mass")
    options.add_argument("--without", action="append", choices=tuple(LOSSES), help="default: nothing")
    options.add_argument("--scores", action="store_true")
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    chosen.folder.mkdir(parents=True, exist_ok=True)
    cases = chosen.case or ["nothing", "warm", "supply"]
    names = chosen.variant or [name for name in VARIANTS if name != "true mass"]
    numbers = range(chosen.seed, chosen.seed + chosen.trucks)
    for without in chosen.without or ["nothing"]:
        settings = [Setting(number, chosen.family, without, chosen.folder) for number in numbers]
        for setting in settings:
            if chosen.scores:
                print(*(line for case in cases for line in scores(setting, names[0], case)), sep="\n", flush=True)
            else:
                one_truck(setting, names, cases)
        if not chosen.scores:
            print(f"\nwithout {without}", *table(settings, names, cases), sep="\n")


if __name__ == "__main__":
    main()
