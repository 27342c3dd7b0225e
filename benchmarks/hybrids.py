"""What families A and B hide: ``python benchmarks/hybrids.py --out FOLDER --hybrids 48``; ``--table`` prints it.

Hybrids have parts of both families (`clutchid drive --family h:SEED`). Each is calibrated once with pressure; its worn
clutch is then read from position alone, unchanged and under four of the other cases of `widening.py`, which the hybrids
take in turn, with the supply pressure recorded and without, and stored as by `readings.py`. The same command goes on
after an interruption. Bands, errors and scores are those of `bands.py`; the table of parts has a row a part, over all
hybrids with that part.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from bands import BANDS, USED, Score, Stored, area, by_expected_error, of_file, score
from readings import WITHOUT_AIR, store
from widening import LATE

from clutchid.errors import ClutchidError
from clutchid.estimation.parameter_file import read_parameters
from clutchid.truck import Vehicle, truck
from clutchid.truck.parts import PARTS

UNCHANGED = "nothing"

#: The other cases, of which a hybrid has four; eight hybrids have each of them four times.
OTHERS = ("supply", "cold", "warm", "valves", "seals", "supply and cold", "supply and warm", LATE)


def driving(t: Any) -> str:
    """How a truck drives its valves: on/off valves with continuous duty cycles are a row of their own."""
    kind = "spool" if getattr(t, "valve", "") == "spool" else "on/off"
    return f"{kind}, {'bang-bang' if getattr(t, 'drive', '') == 'bang-bang' else getattr(t, 'duty', 'latched')}"


#: Fewest hybrids with a part that is named as the worst: the median of fewer is that of their other parts.
LEAST = 3

#: Slots whose part has variants that a hybrid names, and how.
VARIANTS: Mapping[str, Callable[[Any], str]] = {
    "valves": lambda t: getattr(t, "valve", "magnets"),
    "driving": driving,
    "friction": lambda t: getattr(t, "friction", "LuGre and Dahl"),
    "clutch": lambda t: t.load,
}


def cases(seed: int) -> tuple[str, ...]:
    """The cases of a hybrid."""
    return (UNCHANGED, *(OTHERS[(3 * seed + 2 * k + seed // len(OTHERS)) % len(OTHERS)] for k in range(4)))


def names(kind: Vehicle) -> dict[str, str]:
    """The parts of a truck by their slots, with their variants."""
    parts = {slot: getattr(kind.parts, slot).name for slot in kind.parts._fields}
    parts |= {slot: name(kind) for slot, name in VARIANTS.items()}
    return {**parts, "zero": kind.zero}


def path_of(seed: int, out: Path) -> Path:
    """The file of a hybrid's readings, as `readings.py` writes it; beside it lies its calibration, `.toml`."""
    return out / f"h_{seed:05d}.npz"


class Read(NamedTuple):
    """A reading of a hybrid: its band as before and as it is used, against the truth."""

    hybrid: int
    stored: Stored
    before: Score
    used: Score


def read(seeds: Sequence[int], out: Path, recorded: str) -> list[Read]:
    """The readings of those hybrids that are stored, with the position alone or with the supply recorded."""
    before, used = (BANDS[recorded][name] for name in ("standard deviations x 1", USED))
    return [
        Read(seed, stored, score(stored, before(stored)), score(stored, used(stored)))
        for seed in seeds
        if path_of(seed, out).exists()
        for stored in of_file(path_of(seed, out), recorded)
    ]


def of(readings: Sequence[Read], *wanted: str) -> list[Read]:
    """The readings of some cases."""
    return [reading for reading in readings if reading.stored.case in wanted]


def cells(scores: Sequence[Score]) -> str:
    """Median and worst error, share covered, median width and mean interval score of some readings."""
    if not scores:
        return "- | - | - | -"
    error, covered, width, interval, _ = np.transpose(scores)
    return (
        f"{np.median(error):.2f} / {error.max():.2f} | {covered.mean():.0f} | {np.median(width):.1f} | "
        f"{interval.mean():.1f}"
    )


def used(readings: Sequence[Read]) -> str:
    """Cells of some readings as they are used."""
    return cells([reading.used for reading in readings])


HEAD = "error | covered | width | score"


def of_cases(readings: Sequence[Read]) -> Iterator[str]:
    """A row a case, as before and as used."""
    yield f"| case | readings | before: {HEAD} | now: {HEAD} |\n|{'---|' * 10}"
    for case in (UNCHANGED, *OTHERS, "all"):
        some = readings if case == "all" else of(readings, case)
        yield f"| {case} | {len(some)} | {cells([reading.before for reading in some])} | {used(some)} |"
    areas = [
        area([r.stored for r in readings], scores)
        for scores in ([r.before for r in readings], [r.used for r in readings])
    ]
    trucks = [
        np.mean([r.used.covered for r in readings if r.hybrid == hybrid]) for hybrid in {r.hybrid for r in readings}
    ]
    yield (
        f"\nArea {areas[0]:.2f} before, {areas[1]:.2f} now. Covered by hybrid {np.mean(trucks):.1f} ± "
        f"{np.std(trucks, ddof=1) / np.sqrt(len(trucks)):.1f} %, {min(trucks):.0f} % at worst. By expected error: "
        f"{by_expected_error([r.used for r in readings])}.\n"
    )


def by_part(seeds: Sequence[int]) -> Iterator[tuple[str, str, list[int]]]:
    """Slot, part and the hybrids that have it."""
    parts = {seed: names(truck(0, f"h:{seed}")) for seed in seeds}
    for slot in (*PARTS["A"]._fields, "zero"):
        for part in sorted({own[slot] for own in parts.values()}):
            yield slot, part, [seed for seed in seeds if parts[seed][slot] == part]


def of_parts(seeds: Sequence[int], alone: Sequence[Read], supply: Sequence[Read]) -> Iterator[str]:
    """A row a part, and the part with the largest median."""
    yield (
        f"| slot | part | hybrids | unchanged, position: {HEAD} | all, position: {HEAD} | all, with supply: {HEAD} |\n"
        f"|{'---|' * 15}"
    )
    worst = (0.0, "", "")
    for slot, part, some in by_part(seeds):
        own, with_supply = ([reading for reading in readings if reading.hybrid in some] for readings in (alone, supply))
        yield f"| {slot} | {part} | {len(some)} | {used(of(own, UNCHANGED))} | {used(own)} | {used(with_supply)} |"
        if own and len(some) >= LEAST:
            worst = max(worst, (float(np.median([reading.used.error for reading in own])), part, slot))
    yield f"\nLargest median of a part of {LEAST} hybrids or more: {worst[1]} ({worst[2]}), {worst[0]:.2f} %.\n"


def of_worst(readings: Sequence[Read], out: Path, number: int = 8) -> Iterator[str]:
    """The hybrids with the worst readings."""
    yield "| hybrid | parts | calibration | worst case | error | unchanged |\n|---|---|---|---|---|---|"
    worst: dict[int, Read] = {}
    for reading in sorted(readings, key=lambda reading: reading.used.error, reverse=True):
        worst.setdefault(reading.hybrid, reading)
    same = {reading.hybrid: f"{reading.used.error:.2f}" for reading in of(readings, UNCHANGED)}
    for reading in list(worst.values())[:number]:
        trust = read_parameters(path_of(reading.hybrid, out).with_suffix(".toml")).origin.trust
        letters = truck(0, f"h:{reading.hybrid}").parts.letters
        words = (f"h:{reading.hybrid}", letters, trust, reading.stored.case, f"{reading.used.error:.2f}")
        yield f"| {' | '.join(words)} | {same.get(reading.hybrid, 'refused')} |"


def main() -> None:
    """Read hybrids, or print the tables of those that are stored."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--hybrids", type=int, default=48)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--table", action="store_true", help="print the tables only")
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    wanted, failed = range(chosen.seed, chosen.seed + chosen.hybrids), 0
    for seed in wanted if not chosen.table else ():
        try:
            store(path_of(seed, chosen.out), 0, f"h:{seed}", cases(seed), WITHOUT_AIR)
        except ClutchidError as error:
            failed += 1
            print(f"h:{seed}: {error}", flush=True)
    seeds = [seed for seed in wanted if path_of(seed, chosen.out).exists()]
    alone, supply = (read(seeds, chosen.out, recorded) for recorded in WITHOUT_AIR)
    print("Position alone:\n", *of_cases(alone), "Supply recorded:\n", *of_cases(supply), sep="\n")
    print(*of_parts(seeds, alone, supply), *of_worst(alone, chosen.out), sep="\n")
    refused = sum(len(cases(seed)) for seed in seeds) - len(alone)
    print(f"\n{len(seeds)} hybrids; {failed} calibrations failed, {refused} readings were refused.")


if __name__ == "__main__":
    main()
