"""Errors of calibrated loads, and how wide their bands should be: ``python benchmarks/calibration_bands.py``.

Prints its tables from `results/calibrations.jsonl`, without a fit. Each form of what the model misses is set on one
family and half of the hybrids, so that the interval score (Winkler 1972: width, and 40 times what is missed; smaller is
better) is smallest with 95 % of the points from 0.5 to 20 mm in the band; the other trucks confirm it. ``--store``
calibrates the trucks that the file lacks, and can be stopped and called again: 10 s with the conditions recorded, as in
the tutorial, and 30 s without. A line has the load, its error and the half width of its band by the data alone, at the
points of `GRID` within the reach, and the force of the autocorrelated part of the pressure's residual, all in N.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from bands import MISSED as PRICE
from widening import seeds

from clutchid import Fit, fit
from clutchid.errors import ClutchidError
from clutchid.estimation.assess.evidence import diagnosed, reach
from clutchid.inference.uncertainty.calibration import MODEL_MISSES
from clutchid.log import FloatArray
from clutchid.numerics.interval import QUANTILE
from clutchid.truck import GRID, Drive, Vehicle, drive, truck

#: Stored calibrations, a line each.
STORED = Path(__file__).parent / "results" / "calibrations.jsonl"

#: Numbers of the trucks of each family by which a form is set or confirmed, and of those that were run once, after it.
NUMBERS, HELD_OUT = range(3700, 3716), range(3716, 3720)

#: Seconds of a calibration, and whether supply pressure and temperature are recorded.
RECORDINGS = {"10 s": (10.0, True), "30 s": (30.0, False)}

#: Least share of the points in the band where a form is set.
LEAST = 0.95


class Stored(NamedTuple):
    """A stored calibration, at the points of the grid within its reach, in N."""

    truck: str
    recording: str
    load: FloatArray
    error: FloatArray
    half: FloatArray
    residual: float

    @property
    def held_out(self) -> bool:
        """Whether the form was set without it."""
        return int(self.truck.partition(":")[2]) in HELD_OUT

    @property
    def peak(self) -> float:
        """The greatest load."""
        return float(self.load.max())

    @property
    def slope(self) -> FloatArray:
        """Derivative of the load in N/m."""
        return np.abs(np.gradient(self.load, GRID[: self.load.size]))


#: Variance of what the model misses, from a calibration and the settings of a form.
Form = Callable[..., Any]

#: Forms and the settings that are tried: a share of the peak, of the load, of the force of the residual, metres.
_SHARES, _FORCES, _METRES = np.arange(0, 105, 5) * 1e-4, np.arange(0, 21) * 0.1, np.arange(0, 11) * 2e-6
FORMS: Mapping[str, tuple[Form, tuple[FloatArray, ...]]] = {
    "the data alone": (lambda _: 0.0, ()),
    "data times": (lambda of, k: (k**2 - 1) * (of.half / QUANTILE) ** 2, (np.arange(10, 61) * 0.1,)),
    "peak": (lambda of, a: (a * of.peak) ** 2, (_SHARES,)),
    "load": (lambda of, b: (b * of.load) ** 2, (_SHARES,)),
    "peak, slope": (lambda of, a, d: (a * of.peak) ** 2 + (d * of.slope) ** 2, (_SHARES, _METRES)),
    "residual": (lambda of, c: (c * of.residual) ** 2, (_FORCES,)),
    "residual, slope": (lambda of, c, d: (c * of.residual) ** 2 + (d * of.slope) ** 2, (_FORCES, _METRES)),
    "peak, residual": (
        lambda of, a, c: (a * of.peak) ** 2 + (c * of.residual) ** 2, (np.arange(0, 21) * 1e-4, _FORCES),
    ),
}  # fmt: skip


def stored(path: Path) -> list[Stored]:
    """The calibrations of a file."""
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []
    return [
        Stored(
            line["truck"], line["recording"], *(np.array(line[n]) for n in ("load", "error", "half")), line["residual"]
        )
        for line in lines
    ]


def scores(some: Sequence[Stored], form: Form, setting: Sequence[float]) -> FloatArray:
    """Share covered, median width and interval score of every calibration, the latter two in % of the peak."""
    rows = []
    for of in some:
        half = np.sqrt(of.half**2 + QUANTILE**2 * form(of, *setting))
        beyond = np.maximum(np.abs(of.error) - half, 0.0)
        width, score = np.median(2 * half), np.mean(2 * half + PRICE * beyond)
        rows.append([np.mean(beyond == 0.0), 100 * width / of.peak, 100 * score / of.peak])
    return np.array(rows)


def best(some: Sequence[Stored], form: Form, grids: Sequence[FloatArray]) -> tuple[float, ...]:
    """The setting with the smallest mean interval score among those that cover enough."""
    tried = {setting: scores(some, form, setting).mean(axis=0) for setting in product(*(g.tolist() for g in grids))}
    enough = {setting: score for setting, (covered, _, score) in tried.items() if covered >= LEAST} or {
        setting: -covered for setting, (covered, _, _) in tried.items()
    }
    return min(enough, key=lambda setting: enough[setting])


def groups(some: Iterable[Stored]) -> dict[str, list[Stored]]:
    """Calibrations by family, hybrids of even and of odd numbers apart."""
    by_group: dict[str, list[Stored]] = {"A": [], "B": [], "even hybrids": [], "odd hybrids": []}
    for of in some:
        family, number = of.truck.split(":")
        by_group[family if family != "h" else f"{'odd' if int(number) % 2 else 'even'} hybrids"].append(of)
    return by_group


def cells(some: Sequence[Stored], form: Form, setting: Sequence[float]) -> str:
    """Points covered, of the worst calibration, median width and mean score."""
    table = scores(some, form, setting)
    covered, _, score = table.mean(axis=0)
    return f"{100 * covered:.0f} | {100 * table[:, 0].min():.0f} | {np.median(table[:, 1]):.2f} | {score:.2f}"


def tables(some: Sequence[Stored]) -> Iterator[str]:
    """A table for each half of the trucks that forms are set on, and one of the term as it is used."""
    by_group = groups(of for of in some if not of.held_out)
    head = f"| {{}} | setting | {' | '.join(f'{name}: covered | worst | width | score' for name in by_group)} |"
    rule = f"|{'---|' * (2 + 4 * len(by_group))}"

    def row(name: str, form: Form, setting: Sequence[float], of: Mapping[str, Sequence[Stored]]) -> str:
        values = " | ".join(cells(group, form, setting) if group else "- | - | - | -" for group in of.values())
        return f"| {name} | {', '.join(f'{value:.2g}' for value in setting)} | {values} |"

    for family, half in (("A", "even hybrids"), ("B", "odd hybrids")):
        yield f"{head.format(f'set on {family} and {half}')}\n{rule}"
        for name, (form, grids) in FORMS.items():
            yield row(name, form, best([*by_group[family], *by_group[half]], form, grids), by_group)
        yield ""
    yield f"{head.format('as used')}\n{rule}"
    used = FORMS["peak, residual"][0]
    for recording in RECORDINGS:
        yield row(
            recording, used, MODEL_MISSES, groups(of for of in some if of.recording == recording and not of.held_out)
        )
    yield row("both", used, MODEL_MISSES, by_group)
    yield row("both, held-out trucks", used, MODEL_MISSES, groups(of for of in some if of.held_out))


def recorded(name: str, recording: str) -> Drive:
    """The recording of a truck FAMILY:NUMBER, with pressure."""
    family, number = name.split(":")
    kind: Vehicle = truck(0, name) if family == "h" else truck(int(number), family)
    seconds, conditions = RECORDINGS[recording]
    return drive(kind, seconds=seconds, seed=seeds(int(number))[0], name="calibration", conditions=conditions)


def numbers(once: Fit, truth: FloatArray) -> dict[str, Any]:
    """Numbers of a calibration, for a line of the file."""
    assert once.calibration is not None, "a fit of all that recordings with pressure determine is a calibration"
    inside, load = reach(once) >= GRID, once.actuator.load
    force, phi = load.force(GRID[inside]), load.phi(GRID[inside])
    half = QUANTILE * np.sqrt(np.einsum("ni,ij,nj->n", phi, once.calibration.theta_covariance, phi))
    residual = diagnosed(once, "calibration").columns["pressure_a"].autocorrelated
    return {
        "residual": round(once.actuator.parameters.A_A * residual, 1),
        "load": force.round().astype(int).tolist(),
        "error": (force - truth[inside]).round(1).tolist(),
        "half": half.round(1).tolist(),
    }


def store(path: Path, method: Any) -> None:
    """Append the calibrations that a file lacks."""
    made = {(of.truck, of.recording) for of in stored(path)}
    for number, family, recording in product((*NUMBERS, *HELD_OUT), "ABh", RECORDINGS):
        name = f"{family}:{number}"
        if (name, recording) in made:
            continue
        driven = recorded(name, recording)
        try:
            once = fit(driven.log, measure=("position", "pressure_a"), free=("auto",), method=method)
        except ClutchidError as error:
            print(f"{name}, {recording}: {error}", flush=True)
            continue
        line = {"truck": name, "recording": recording, **numbers(once, driven.truth.load(GRID))}
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, separators=(",", ":")) + "\n")
        print(f"{name}, {recording}", flush=True)


def main() -> None:
    """Print the tables, after storing what lacks if that is wanted."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--store", action="store_true")
    options.add_argument("--file", type=Path, default=STORED)
    options.add_argument("--method", default="shooting", choices=("shooting", "prediction-error"))
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    if chosen.store:
        store(chosen.file, chosen.method)
    print("\n".join(tables(stored(chosen.file))))


if __name__ == "__main__":
    main()
