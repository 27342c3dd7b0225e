"""Thresholds of clocks and of rows that are sparse: ``python benchmarks/thresholds.py [NAME ...]``.

Every form of one recording that has a single feature (`tests/measurements/forms.py`) is read with each threshold at
half, and at twice, of what it is; printed are the forms that are wrong then, of none as it is. A threshold that may be
halved and doubled has a margin of two on either side; beside it stands the reason for its value.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "measurements"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from forms import forms, outcome

from clutchid.measurements import clock, columns, conversion, grids, sparse

#: Module, name, unit, and where the value comes from.
THRESHOLDS: tuple[tuple[Any, str, str, str], ...] = (
    (clock, "WINDOW", "s", "devices that write to one log are tens of ms apart in public logs of buses"),
    (clock, "JUMP_AHEAD", "s", "twice the longest interval of a message that a fit needs, 10 Hz"),
    (clock, "_APART", "intervals", "four holes, which are five intervals"),
    (clock, "_APART_LEAST", "s", "twice the gap over which a step is judged, and five times what an observer bridges"),
    (clock, "_APART_SHARED", "s", "the interval of the slowest message of J1939-71 that is read, 1 Hz"),
    (clock, "LONE", "stamps", "spoiled stamps come alone or in twos in data/hunt (41)"),
    (clock, "_AHEAD", "runs", "a guess: runs that are looked at before a jump is taken for a restart"),
    (clock, "_NEAR", "", "a guess: groups of one logger stop within a tenth of their length"),
    (clock, "_SURE", "", "a period is recognised to five intervals: a fiftieth of the shortest, 65.5 ms, is 1.3 ms"),
    (clock, "_BURSTS", "bursts", "a guess: as many as give a rate to a percent"),
    (clock, "_LEAST", "samples", "between a pair, as of a repeated stamp, and the bursts of 16 of data/hunt (40)"),
    (clock, "_WITHIN", "", "bursts of data/hunt (40) take less than a hundredth of their period"),
    (conversion, "_PLACED", "", "a guess: whole seconds of a recording at 10 Hz leave a tenth"),
    (sparse, "_ENOUGH", "samples", "a guess"),
    (sparse, "_WITHOUT", "", "above the 10 % of dropouts of a bad sensor, below the half of two equal grids"),
    (sparse, "_BETWEEN", "rows", "rows of another grid lie between the samples"),
    (sparse, "_LEAST_ROWS", "rows", "a guess"),
    (sparse, "_FIRST_ROWS", "rows", "a guess"),
    (sparse, "_DIFFERENT", "", "what is written on change differs, but where a logger writes all of a group"),
    (sparse, "_REGULAR", "", "a guess: four of five intervals are alike where a message is sent at a rate"),
    (sparse, "_FEW", "samples", "a guess"),
    (columns, "_BEGINNING", "letters", "pos for position, the shortest beginning of a word in data/hunt (03a)"),
    (grids, "_SHOWN", "samples", "a guess"),
    (grids, "_FORWARD", "", "a guess: rows of an outer join repeat their stamps"),
    (grids, "_BACK", "", "a guess: some restarts and lone stamps"),
)  # fmt: skip


def patched(name: str, before: object, after: object) -> None:
    """Put another value into every module that has the threshold."""
    for module in list(sys.modules.values()):
        if (
            getattr(module, "__name__", "").startswith("clutchid.measurements")
            and getattr(module, name, None) is before
        ):
            setattr(module, name, after)


def wrong() -> int:
    """Number of forms that are read wrongly."""
    return sum(outcome(form)[0] == "wrong" for _, form in forms(1))


def main() -> None:
    """Print the table."""
    print(f"Forms with one feature: {sum(1 for _ in forms(1))}; wrong as it is: {wrong()}.\n")
    print("| threshold | value | wrong at half | at twice | reason |\n|---|---|---|---|---|")
    for module, name, unit, reason in THRESHOLDS:
        if sys.argv[1:] and name not in sys.argv[1:]:
            continue
        value = getattr(module, name)
        counts = []
        for factor in (0.5, 2.0):
            other = max(round(factor * value), 1) if isinstance(value, int) else factor * value
            patched(name, value, other)
            counts.append(str(wrong()))
            patched(name, other, value)
        file = module.__name__.rpartition(".")[2]
        print(f"| `{name}` of {file} | {value:g} {unit} | {' | '.join(counts)} | {reason} |", flush=True)


if __name__ == "__main__":
    main()
