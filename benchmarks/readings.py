"""Store readings of changed trucks: ``python benchmarks/readings.py DIR --family A --trucks 8 --seed 0``.

Every truck is calibrated once with pressure and the supply pressure recorded, into ``DIR/A_00000.toml``, and once with
the ambient temperature as well, ``DIR/A_00000_air.toml``. Its worn clutch is read under the cases of `widening.py` from
position alone, with the supply pressure recorded and without, and with both recorded, and followed by observers.
Families: A, B, a hybrid h:SEED, and own, the plant of `own_plant.py`, which shares no part with the package.
``--variant`` calibrates and reads without what an earlier round added, as `mass.py` does.

``DIR/A_00000.npz`` has every reading as plain arrays named CASE/RECORDED/ARRAY, from which `bands.py` computes any band
without a fit. What is there is not made again, so that a run can be stopped. A reading that is refused is printed and
has no arrays.

The arrays, with the h hypotheses in the order of `HYPOTHESES`, at the points of `GRID`: `truth` (points,) in N;
`searched`, `score` and `odds` (h,); `load` (h, points) and its standard deviations `std` and, for a share of 1 of the
load where the grease differs by a factor of e, `grease`; `costs` (h, blocks); `per_supply` (h, points), the derivative
of the load by the logarithm of the supply pressure; `misfit`; the load of the observer, and its `mismatch`.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from mass import FIXED, drifting
from widening import LATE, NO_PRIORS, OWN, calibrated, worn_clutch

from clutchid.errors import ClutchidError, ParameterError, SolveError
from clutchid.estimation.departure import relative_misfit
from clutchid.estimation.hypotheses import (
    Explanation,
    Explanations,
    IntervalSettings,
    explained,
    hypothesis_score,
    mixture,
    most_probable,
)
from clutchid.estimation.parameter_file import ParameterFile, contents_of_fit, read_parameters, write_parameters
from clutchid.estimation.request import FreeParameters
from clutchid.estimation.shooting import SHOOTING
from clutchid.inference.smoother.residuals import BLOCKS
from clutchid.inference.smoother.rows import link_costs
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.change_prior import HYPOTHESES, log_odds
from clutchid.inference.uncertainty.coordinates import Prior
from clutchid.log import FloatArray, Log
from clutchid.model.actuator import Actuator
from clutchid.numerics.failure import Failure
from clutchid.observer import observe_recording, observer
from clutchid.strokes.vented_rest import from_rest
from clutchid.truck import GRID
from clutchid.truck.families import RANGE_FILES, family_label, hybrid_letters

#: Changes between calibration and use.
CASES = (
    "nothing", "supply", "cold", "warm", "valves", "seals", "supply and warm", "supply and cold", "cold and valves",
    "5 K warmer", LATE,
)  # fmt: skip

#: Columns that a reading lacks, by what it has.
LACKING: dict[str, tuple[str, ...]] = {
    "position": ("temperature_ambient", "pressure_supply"), "supply": ("temperature_ambient",), "supply and air": (),
}  # fmt: skip

#: What is recorded where the ambient temperature is not.
WITHOUT_AIR = ("position", "supply")

#: What a calibration and its readings do without.
VARIANTS = ("mass of Appendix A", "friction near rest fixed")

#: A posterior without what is added to it, and with a grease that is missed by the whole load.
PLAIN, GREASE = IntervalSettings(missed=0.0, least=0.0), IntervalSettings(missed=1.0, least=0.0)


def family_name(text: str) -> str:
    """Name of a family, for `argparse`."""
    if text not in (*RANGE_FILES, OWN):
        try:
            hybrid_letters(text)
        except ParameterError as error:
            raise argparse.ArgumentTypeError(f"{text!r}: must be A, B, {OWN}, or h:SEED, such as h:7.") from error
    return text


def file_of(folder: Path, family: str, number: int) -> Path:
    """File of the readings of a truck; beside it lie its calibrations, `.toml` and `_air.toml`."""
    return folder / f"{family_label(family).removesuffix('_')}_{number:05d}.npz"


def calibration_of(
    number: int, family: str, path: Path, recorded: str = "supply", priors: Mapping[str, Prior] = NO_PRIORS
) -> ParameterFile:
    """The calibration of a truck, from its file if it has one."""
    if not path.exists():
        once = calibrated(number, family, LACKING[recorded], "shooting", priors)
        write_parameters(contents_of_fit(once, once.verdict.trust), path)
    return read_parameters(path)


def one_truck(
    number: int, family: str, path: Path, cases: Sequence[str] = CASES, columns: Sequence[str] = tuple(LACKING),
    variant: str = "",
) -> dict[str, Any]:  # fmt: skip
    """Readings of a truck under some cases, with the calibration in a file, and another beside it for recorded air."""
    priors = {"M": Prior(10.0, 1e-3)} if variant == "mass of Appendix A" else NO_PRIORS
    calibrations = {}
    for recorded in columns:
        # a calibration knows the air that its recording had, so that a reading without needs its own
        own, of = (path, "supply") if recorded in WITHOUT_AIR else (path.with_stem(f"{path.stem}_air"), recorded)
        calibrations[recorded] = calibration_of(number, family, own, of, priors)
    arrays_of_truck: dict[str, Any] = {}
    for case in cases:
        worn = worn_clutch(number, family, case)
        for recorded, once in calibrations.items():
            assert once.calibration is not None, "a calibration with pressure keeps one"
            log = worn.log.without(*LACKING[recorded])
            try:
                counted = from_rest(log, once.calibration.rest, "subtract").log
                arrays = reading(counted, once.actuator, once.calibration)
            except ClutchidError as error:
                print(f"{family} {number}, {case}, {recorded}: {error}", flush=True)
                continue
            arrays |= observed(log, once.actuator, once.calibration)
            arrays["truth"] = worn.truth.load(GRID)
            arrays_of_truck |= {f"{case}/{recorded}/{name}": array for name, array in arrays.items()}
    return arrays_of_truck


def reading(log: Log, actuator: Actuator, calibration: Calibration) -> dict[str, Any]:
    """The load of a recording from position alone under every hypothesis."""
    functions = SHOOTING.changes
    assert functions is not None, "shooting weighs hypotheses"
    free = FreeParameters(actuator.load.names, ("position",))
    first = SHOOTING.search([log], actuator, free, calibration, None)
    if isinstance(first.solution, Failure):
        raise SolveError(str(first.solution))
    explanations = explained(first, functions, calibration)
    best = explanations[most_probable(explanations, calibration)]
    problem, by_hypothesis = best.result.problem, [explanations.get(hypothesis, best) for hypothesis in HYPOTHESES]
    plain, grease = (mixture(explanations, calibration, 1.0, band) for band in (PLAIN, GREASE))
    rows = np.array([to_load(explanations, x) for x in plain.means])
    variance, with_grease = (
        np.einsum("hij,hjk,hik->hi", rows, explanation.covariances, rows) for explanation in (plain, grease)
    )
    at = next(j for j, c in enumerate(problem.coordinates) if c.base == "P_S")
    by_supply = plain.covariances[:, :, at] / plain.covariances[:, at, at, None]
    share = np.array([problem.slopes(x)[at] / problem.si(x)[at] for x in plain.means])
    return {
        "searched": np.array([hypothesis in explanations for hypothesis in HYPOTHESES]),
        "score": np.array(
            [
                hypothesis_score(explanation.under(h), h, calibration)
                for explanation, h in zip(by_hypothesis, HYPOTHESES, strict=True)
            ]
        ),
        "odds": np.array([log_odds(hypothesis) for hypothesis in HYPOTHESES]),
        "load": np.array([problem.actuator_of(x, problem.stems[0]).load.force(GRID) for x in plain.means]),
        "std": np.sqrt(variance),
        "grease": np.sqrt(np.maximum(with_grease - variance, 0.0)),
        "costs": np.array([block_costs(explanation, calibration) for explanation in by_hypothesis]),
        "per_supply": np.einsum("hij,hj->hi", rows, by_supply) / share[:, None],
        "misfit": relative_misfit(
            min(explanation.solution.at.cost for explanation in explanations.values()), [log], calibration
        ),
    }


def block_costs(explanation: Explanation, calibration: Calibration) -> FloatArray:
    """Cost of the windows of each of ten blocks and of the links behind them, as the evidence counts it."""
    problem, at, blocks = explanation.result.problem, explanation.solution.at, []
    for chain, starts, sigma in zip(at.chains, at.X, problem.sigmas, strict=True):
        costs = chain.windows.costs + link_costs(chain.windows.ends, starts, sigma, problem.noise.outlier)
        blocks += [
            float(part.sum()) for part in np.split(costs, np.linspace(0, costs.size, BLOCKS + 1).astype(int)[1:-1])
        ]
    errors = calibration.position_only
    return np.array(blocks) / max(1.0, errors.dispersion if errors else 1.0)


def to_load(explanations: Explanations, x: FloatArray) -> FloatArray:
    """Derivative of the load at the points of the grid with respect to x, shape (points, k)."""
    problem = next(iter(explanations.values())).result.problem
    names, slopes = problem.actuator.load.names, problem.slopes(x)
    weights = np.zeros((len(names), x.size))
    for j, c in enumerate(problem.coordinates):
        if c.base in names:
            weights[names.index(c.base), j] = slopes[j]
    result: FloatArray = problem.actuator.load.phi(GRID) @ weights
    return result


def observed(log: Log, actuator: Actuator, calibration: Calibration) -> dict[str, FloatArray]:
    """The load of the observer at the end of a recording, by its method, and the `mismatch` of its innovations."""
    follower = observer(actuator, calibration=calibration)
    after = observe_recording(follower, log).after
    return {follower.method: follower.load(after).force(GRID), "mismatch": np.array(after.mismatch)}


def store(
    path: Path, number: int, family: str, cases: Sequence[str] = CASES, columns: Sequence[str] = tuple(LACKING),
    variant: str = "",
) -> None:  # fmt: skip
    """Read a truck that has no file yet."""
    if path.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    with drifting(FIXED) if variant == "friction near rest fixed" else nullcontext():
        arrays = one_truck(number, family, path.with_suffix(".toml"), cases, columns, variant)
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        np.savez_compressed(file, **arrays)
    part.rename(path)
    print(f"{path.name}: {time.perf_counter() - begin:.0f} s", flush=True)


def main() -> None:
    """Store the readings of some trucks."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--family", default="A", type=family_name, help="A, B, h:SEED or own")
    options.add_argument("--trucks", type=int, default=8)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--case", action="append", choices=(*CASES, "60 K colder"), help="default: all but the last")
    options.add_argument("--recorded", action="append", choices=tuple(LACKING), help="default: all")
    options.add_argument("--variant", default="", choices=VARIANTS, help="default: as shipped")
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    for number in range(chosen.seed, chosen.seed + chosen.trucks):
        path = file_of(chosen.folder, chosen.family, number)
        store(path, number, chosen.family, chosen.case or CASES, chosen.recorded or tuple(LACKING), chosen.variant)


if __name__ == "__main__":
    main()
