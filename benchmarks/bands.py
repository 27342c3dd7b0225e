"""How certain a load from position alone may be called: ``python benchmarks/bands.py DIR --family A --seed 3700``.

Compares bands of the readings that `readings.py` has stored in DIR, without a fit. Columns: points from 0.5 to 20 mm in
the 95 % band, with their standard error by truck, and of pairs of changes with another supply; the median width of the
band from low to high and its interval score (Winkler 1972: width, and 40 times what is missed; smaller is better), in %
of the peak; error, rms, median / worst; area under the curve of the expected error for loads more than 2 % off, within
the cases, so that the mix of cases does not matter. For each case also the width that each part of the variance would
have alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from readings import CASES, family_name, file_of

from clutchid.estimation.assess.reasons import GOOD_ERROR, GREASE, POOR_ERROR
from clutchid.estimation.filtered_load import FILTER_WEIGHT
from clutchid.estimation.hypotheses import INTERVAL_SETTINGS, WITH_SUPPLY, IntervalSettings, flattened, softmax
from clutchid.inference.uncertainty.change_prior import HYPOTHESES
from clutchid.inference.uncertainty.mixture import Mixture
from clutchid.log import FloatArray
from clutchid.numerics.interval import QUANTILE
from clutchid.observer.mismatch import MISMATCHED

#: Bootstraps of the blocks.
BOOTSTRAPS = 100

#: Price of a point outside of a 95 % band, in distances from it.
MISSED = 40.0

PAIRS = ("supply and warm", "supply and cold")


class Stored(NamedTuple):
    """A stored reading: name of the truck, case, and its arrays by name."""

    truck: str
    case: str
    arrays: Mapping[str, Any]

    @property
    def peak(self) -> float:
        """Greatest true load in N."""
        return float(self.arrays["truth"].max())


class Band(NamedTuple):
    """A load with its band in N."""

    load: FloatArray
    low: FloatArray
    high: FloatArray


def stored(folder: Path, families: Sequence[str], numbers: Sequence[int], recorded: str) -> list[Stored]:
    """The readings in a folder with 'position' alone, with the 'supply', or with 'supply and air' recorded."""
    paths = [file_of(folder, family, number) for family in families for number in numbers]
    return [reading for path in paths if path.exists() for reading in of_file(path, recorded)]


def of_file(path: Path, recorded: str) -> list[Stored]:
    """The readings of a file, in the order in which they were made."""
    arrays, by_reading = np.load(path), dict[str, dict[str, Any]]()
    for key in arrays.files:
        case, columns, name = key.split("/")
        if columns == recorded:
            by_reading.setdefault(case, {})[name] = arrays[key]
    return [Stored(path.stem, case, own) for case, own in by_reading.items()]


class Weights(NamedTuple):
    """Weights of all hypotheses, (h,), for the mean and for the band."""

    mean: FloatArray
    spread: FloatArray


def weights(reading: Stored, part: float = INTERVAL_SETTINGS.evidence) -> Weights:
    """The mean over the hypotheses that were searched, and a part of the logarithm of the evidence for the band."""
    searched = np.where(reading.arrays["searched"], reading.arrays["score"], -np.inf)
    return Weights(softmax(searched), flattened(reading.arrays["score"], part))


def contested(reading: Stored) -> float:
    """Share of the bootstraps of the blocks in which another hypothesis is the most probable one.

    A block that is drawn twice adds its cost at the solution again (Kishino, Miyata and Hasegawa 1990).
    """
    score, costs = reading.arrays["score"], reading.arrays["costs"]
    blocks = costs.shape[1]
    times = np.random.default_rng(0).multinomial(blocks, np.full(blocks, 1.0 / blocks), size=BOOTSTRAPS)
    return float(np.mean(np.argmax(score - 0.5 * (times - 1) @ costs.T, axis=1) != np.argmax(score)))


class Variances(NamedTuple):
    """Variances of the load at the points of the grid by part, in N², each (h, points).

    `data` is what the data leave open under a hypothesis, `grease` and `least` are those of `IntervalSettings`.
    """

    data: FloatArray
    grease: FloatArray
    least: FloatArray


def variances(reading: Stored, settings: IntervalSettings) -> Variances:
    """The variances of a load under each hypothesis."""
    a = reading.arrays
    misfit = np.fmax(1.0, a["misfit"])
    least = settings.least * a["load"].max(axis=1, keepdims=True) * np.ones_like(a["load"])
    return Variances(misfit * (settings.scale * a["std"]) ** 2, misfit * (settings.missed * a["grease"]) ** 2, least**2)


def band(reading: Stored, settings: IntervalSettings, filtered: float = 0.0) -> Band:
    """The load with the quantiles of its mixture, moved by a share `filtered` to the joint filter's.

    The points of the grid count as independent numbers: only their own intervals are used.
    """
    loads, rows = reading.arrays["load"], sum(variances(reading, settings))
    mixture = Mixture(HYPOTHESES, *weights(reading, settings.evidence), loads, np.array([np.diag(row) for row in rows]))
    low, high = mixture.interval(np.eye(mixture.x.size))
    trusted = reading.arrays.get("mismatch", 0.0) <= MISMATCHED
    share = filtered * (1.0 - mixture.of_group("valves")) * trusted
    step = share * (reading.arrays["joint"] - mixture.x)
    return Band(mixture.x + step, low + step, high + step)


#: Name of the bands as they are used.
USED = "as used"

#: Error in % of the peak that is bad.
BAD_ERROR = 2.0


def compared(used: IntervalSettings, filtered: float) -> dict[str, Callable[[Stored], Band]]:
    """Bands as they are used, and with one setting changed at a time."""
    others = {
        "all of the evidence": used._replace(evidence=1.0),
        "2 % for grease": used._replace(missed=0.02),
        "none for grease": used._replace(missed=0.0),
        "no least": used._replace(least=0.0),
        **{f"standard deviations x {scale:g}": used._replace(scale=scale) for scale in (1.0, 0.85, 0.7, 0.55)},
    }
    bands = {name: partial(band, settings=settings, filtered=filtered) for name, settings in others.items()}
    shares = {f"{share:g} of the joint filter": partial(band, settings=used, filtered=share) for share in (0.0, 0.5)}
    return {USED: partial(band, settings=used, filtered=filtered), **bands, **shares}


#: Settings and share of the joint filter as they are used, by what is recorded.
SETTINGS = {
    "position": (INTERVAL_SETTINGS, 0.0), "supply": (WITH_SUPPLY, FILTER_WEIGHT),
    "supply and air": (WITH_SUPPLY, FILTER_WEIGHT),
}  # fmt: skip

#: Bands that are compared, by what is recorded.
BANDS: Mapping[str, Mapping[str, Callable[[Stored], Band]]] = {
    recorded: compared(*used) for recorded, used in SETTINGS.items()
}


def by_part(readings: Sequence[Stored], settings: IntervalSettings) -> str:
    """Widths in % of the peak that the parts of the variance would have alone, medians; their squares add up."""
    rows = []
    for reading in readings:
        spread, loads = weights(reading, settings.evidence), reading.arrays["load"]
        between = (loads - spread.mean @ loads) ** 2
        parts = [*variances(reading, settings), between]
        rows.append([np.median(np.sqrt(spread.spread @ part)) / reading.peak for part in parts])
    widths = 2 * QUANTILE * 100 * np.median(rows, axis=0)
    return "  ".join(f"{name} {w:4.1f}" for name, w in zip((*Variances._fields, "hypotheses"), widths, strict=True))


def rms(values: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


class Score(NamedTuple):
    """A band against the truth: error and width in % of the peak, share covered, interval score, expected error."""

    error: float
    covered: float
    width: float
    interval: float
    expected: float


def score(reading: Stored, band: Band) -> Score:
    """Score of a band."""
    truth, width = reading.arrays["truth"], band.high - band.low
    missed = np.maximum(band.low - truth, 0.0) + np.maximum(truth - band.high, 0.0)
    return Score(
        100 * rms(band.load - truth) / reading.peak,
        100 * float(np.mean(missed == 0.0)),
        100 * float(np.median(width)) / reading.peak,
        100 * float(np.mean(width + MISSED * missed)) / reading.peak,
        100 * rms(width / (2 * QUANTILE)) / reading.peak,
    )


def area(readings: Sequence[Stored], scores: Sequence[Score]) -> float:
    """Area under the curve of the expected error for bad loads, within the cases; NaN where none or all are bad."""
    ordered = pairs = 0.0
    for case in {reading.case for reading in readings}:
        own = [s for reading, s in zip(readings, scores, strict=True) if reading.case == case]
        wrong, right = ([s.expected for s in own if (s.error > BAD_ERROR) is which] for which in (True, False))
        apart = np.sign(np.subtract.outer(wrong, right))
        ordered, pairs = ordered + float(np.sum(0.5 + 0.5 * apart)), pairs + apart.size
    return ordered / pairs if pairs else float("nan")


def line(readings: Sequence[Stored], scores: Sequence[Score]) -> str:
    """A row of the table."""
    table = np.array(scores)
    by_truck = [np.mean([s.covered for reading, s in zip(readings, scores, strict=True) if reading.truck == truck])
                for truck in {reading.truck for reading in readings}]  # fmt: skip
    error = np.std(by_truck, ddof=1) / np.sqrt(len(by_truck)) if len(by_truck) > 1 else np.nan
    pairs = [s.covered for reading, s in zip(readings, scores, strict=True) if reading.case in PAIRS]
    return (
        f"{table[:, 1].mean():6.1f} ± {error:.1f}, {min(by_truck):.0f} %{np.mean(pairs) if pairs else np.nan:7.0f} %"
        f"{np.median(table[:, 2]):8.1f}{table[:, 3].mean():8.1f}"
        f"{np.median(table[:, 0]):9.2f} /{table[:, 0].max():6.2f}{area(readings, scores):8.2f}"
    )


def graded(scores: Sequence[Score]) -> str:
    """How many readings have each grade by their expected error, and how many of them are bad."""
    grades = {"good": (0.0, GOOD_ERROR), "with care": (GOOD_ERROR, POOR_ERROR), "none": (POOR_ERROR, np.inf)}
    return "; ".join(f"{name}: {bad(scores, *limits)}" for name, limits in grades.items())


def good(readings: Sequence[Stored], scores: Sequence[Score]) -> str:
    """Readings that the verdict calls good by expected error and change of the grease, and how many of them are bad."""
    few = [s for reading, s in zip(readings, scores, strict=True) if grease_change(reading) <= GREASE]
    return f"good, the grease as calibrated: {bad(few, 0.0, GOOD_ERROR)}, of {len(scores)}"


def grease_change(reading: Stored) -> float:
    """Change of the logarithm of the viscous friction since the calibration, mean over the hypotheses."""
    a = reading.arrays
    return float(weights(reading).mean @ np.median(a["grease"] / np.maximum(a["load"], 1.0), axis=1))


def by_expected_error(scores: Sequence[Score]) -> str:
    """How many readings are bad, by their expected error."""
    limits = [0.0, GOOD_ERROR, 2.5, POOR_ERROR, np.inf]
    return "; ".join(f"up to {high:g}: {bad(scores, low, high)}" for low, high in pairwise(limits))


def bad(scores: Sequence[Score], low: float, high: float) -> str:
    """How many readings expect an error between two limits in % of the peak, and how many of them are bad."""
    errors = np.array([s.error for s in scores if low < s.expected <= high])
    share = f"{100 * np.mean(errors > BAD_ERROR):.0f} %" if errors.size else "-"
    return f"{errors.size}, {share} beyond {BAD_ERROR:g} %"


def correlation(readings: Sequence[Stored]) -> float:
    """Correlation of the mean errors of the fit and of the joint filter."""
    fits = [weights(reading).mean @ reading.arrays["load"] for reading in readings]
    errors = [
        [np.mean(load - reading.arrays["truth"]) / reading.peak for load in (fit, reading.arrays["joint"])]
        for reading, fit in zip(readings, fits, strict=True)
    ]
    return float(np.corrcoef(np.transpose(errors))[0, 1])


def per_supply(readings: Sequence[Stored]) -> str:
    """By how many % the load changes for 1 % of the supply: smallest, median and largest of the readings."""
    shares = []
    for reading in readings:
        load, by = (weights(reading).mean @ reading.arrays[name] for name in ("load", "per_supply"))
        shares.append(float(load @ by / (load @ load)))
    return " / ".join(f"{share:.2f}" for share in np.quantile(shares, [0.0, 0.5, 1.0]))


def main() -> None:
    """Print a table for each thing that is recorded, and the cases of the bands as before and as used."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("folder", type=Path)
    options.add_argument("--family", nargs="+", default=["A"], type=family_name, help="A, B, h:SEED or own")
    options.add_argument("--trucks", type=int, default=24)
    options.add_argument("--seed", type=int, default=0)
    chosen = options.parse_args()
    numbers, both = range(chosen.seed, chosen.seed + chosen.trucks), list[Score]()
    for recorded, bands in BANDS.items():
        readings = stored(chosen.folder, chosen.family, numbers, recorded)
        if not readings:
            continue
        trucks = len({reading.truck for reading in readings})
        print(f"\nfamily {', '.join(chosen.family)}, {trucks} trucks, recorded: {recorded}")
        print(f"{'':<40}{'covered':>14}{'pairs':>9}{'width':>8}{'score':>8}{'error':>17}{'area':>8}")
        by_band = {name: [score(reading, band(reading)) for reading in readings] for name, band in bands.items()}
        for name, scores in by_band.items():
            print(f"{name:<40}{line(readings, scores)}")
        used = by_band[USED]
        raised = [
            s._replace(expected=s.expected * (1.0 + contested(reading)))
            for reading, s in zip(readings, used, strict=True)
        ]
        print(
            f"  area of the expected error times 1 + the share of bootstraps for another: {area(readings, raised):.2f}"
        )
        print(f"  {graded(used)}; {good(readings, used)}")
        both += used
        print(f"  correlation of the mean errors of fit and joint filter: {correlation(readings):.2f}")
        print(f"  1 % of the supply moves the load by {per_supply(readings)} %")
        settings, _ = SETTINGS[recorded]
        for case in CASES:
            at = [i for i, reading in enumerate(readings) if reading.case == case]
            if at:
                own = [readings[i] for i in at]
                print(f"  {case:<38}{line(own, [used[i] for i in at])}  width by part: {by_part(own, settings)}")
    print(f"\nall readings as used: {graded(both)}\nby expected error: {by_expected_error(both)}")


if __name__ == "__main__":
    main()
