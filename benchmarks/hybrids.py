"""What families A and B hide: ``python benchmarks/hybrids.py --out FOLDER --hybrids 48``; ``--table`` prints it.

Hybrids have parts of both families (`clutchid drive --family h:SEED`). Each is calibrated once with pressure; its worn
clutch is then read from position alone, unchanged and under four of the other cases of `widening.py`, which the hybrids
take in turn. Errors as there. A result is stored as soon as a hybrid is read, so the same command goes on after an
interruption. The table has a row a part: median / worst error over all readings of the hybrids with that part, and in
brackets those of unchanged ones.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from widening import LATE, calibrated, reading, worn_clutch

from clutchid.errors import ClutchidError
from clutchid.truck import Vehicle, truck
from clutchid.truck.parts import PARTS

#: Columns that the recordings lack.
CONDITIONS = ("temperature_ambient", "pressure_supply")

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
    found = {slot: getattr(kind.parts, slot).name for slot in kind.parts._fields}
    found |= {slot: name(kind) for slot, name in VARIANTS.items()}
    return {**found, "zero": kind.zero}


def one_hybrid(seed: int) -> dict[str, Any]:
    """Calibration and readings of a hybrid as plain values."""
    family = f"h:{seed}"
    kind = truck(0, family)
    result: dict[str, Any] = {"hybrid": seed, "letters": kind.parts.letters, "parts": names(kind), "readings": {}}
    try:
        once = calibrated(0, family, CONDITIONS, "shooting")
    except ClutchidError as error:
        return {**result, "failed": f"calibration: {error}"}
    result["trust"] = once.verdict.trust
    for case in cases(seed):
        found = reading(worn_clutch(0, family, case), CONDITIONS, once, {})
        result["readings"][case] = None if found is None else found._asdict()
    return result


def run(seeds: Sequence[int], out: Path) -> None:
    """Read those hybrids that are not stored yet."""
    out.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        path = out / f"hybrid_{seed:03d}.json"
        if path.exists():
            continue
        result = one_hybrid(seed)
        part = path.with_suffix(".part")
        part.write_text(json.dumps(result), encoding="utf-8")
        part.replace(path)
        errors = {case: one and round(one["error"], 2) for case, one in result["readings"].items()}
        print(f"h:{seed} {result['letters']} {errors} {result.get('failed', '')}", flush=True)


def stored(out: Path, seeds: Sequence[int]) -> list[dict[str, Any]]:
    """Results of those hybrids that are there."""
    paths = [out / f"hybrid_{seed:03d}.json" for seed in seeds]
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths if path.exists()]


def readings(results: Sequence[Mapping[str, Any]], *wanted: str) -> list[Mapping[str, Any]]:
    """Readings that were not refused, of some cases or of all."""
    both = ((case, one) for result in results for case, one in result["readings"].items())
    return [one for case, one in both if one and (not wanted or case in wanted)]


def cells(found: Sequence[Mapping[str, Any]]) -> str:
    """Number, median and worst error, share covered and width of some readings."""
    if not found:
        return "0 | - | - | -"
    error, covered, width = (np.array([one[key] for one in found]) for key in ("error", "covered", "width"))
    errors = f"{np.median(error):.2f} / {error.max():.2f}"
    return f"{len(found)} | {errors} | {100 * covered.mean():.0f} % | {np.median(width):.1f}"


def by_part(results: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str, list[Mapping[str, Any]]]]:
    """Slot, part and the hybrids that have it."""
    for slot in (*PARTS["A"]._fields, "zero"):
        for part in sorted({result["parts"][slot] for result in results}):
            yield slot, part, [result for result in results if result["parts"][slot] == part]


def of_cases(results: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A row a case."""
    yield "| case | readings | error | covered | width |\n|---|---|---|---|---|"
    for case in (UNCHANGED, *OTHERS):
        yield f"| {case} | {cells(readings(results, case))} |"
    yield f"| all | {cells(readings(results))} |\n"


def of_parts(results: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """A row a part, and the part with the largest median."""
    head = "readings | error | covered | width"
    yield f"| slot | part | hybrids | unchanged: {head} | all: {head} |\n|{'---|' * 11}"
    worst = (0.0, "", "")
    for slot, part, some in by_part(results):
        found = readings(some)
        yield f"| {slot} | {part} | {len(some)} | {cells(readings(some, UNCHANGED))} | {cells(found)} |"
        if found and len(some) >= LEAST:
            worst = max(worst, (float(np.median([one["error"] for one in found])), part, slot))
    yield f"\nLargest median of a part of {LEAST} hybrids or more: {worst[1]} ({worst[2]}), {worst[0]:.2f} %.\n"


def worst_reading(result: Mapping[str, Any]) -> tuple[float, str]:
    """Error and case of the worst reading of a hybrid."""
    return max(((one["error"], case) for case, one in result["readings"].items() if one), default=(0.0, "none"))


def of_worst(results: Sequence[Mapping[str, Any]], number: int = 8) -> Iterator[str]:
    """The hybrids with the worst readings, and what was refused."""
    yield "| hybrid | parts | calibration | worst case | error | unchanged |\n|---|---|---|---|---|---|"
    for result in sorted(results, key=worst_reading, reverse=True)[:number]:
        error, case = worst_reading(result)
        same = result["readings"].get(UNCHANGED)
        words = (f"h:{result['hybrid']}", result["letters"], result.get("trust", "failed"), case, f"{error:.2f}")
        yield f"| {' | '.join(words)} | {'refused' if same is None else round(same['error'], 2)} |"
    refused = sum(one is None for result in results for one in result["readings"].values())
    failed = sum("failed" in result for result in results)
    yield f"\n{len(results)} hybrids; {failed} calibrations failed, {refused} readings were refused."


def main() -> None:
    """Read hybrids, or print the tables of those that are stored."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--hybrids", type=int, default=48)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--table", action="store_true", help="print the tables only")
    chosen = options.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    seeds = range(chosen.seed, chosen.seed + chosen.hybrids)
    if not chosen.table:
        run(seeds, chosen.out)
    results = stored(chosen.out, seeds)
    print("\n".join((*of_cases(results), *of_parts(results), *of_worst(results))))


if __name__ == "__main__":
    main()
