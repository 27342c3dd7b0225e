"""Results of every method, kept as text: evaluated where a search has ended, they are the same on every machine.

Where a change is meant, write them anew and look at the difference before keeping it:

    CLUTCHID_WRITE_GOLDEN=1 python -m pytest tests/golden && git diff tests/golden

With `CLUTCHID_WRITE_GOLDEN=results` nothing is searched: the results are written that the kept ends have now.
"""

import gzip
import json
import math
import os
import subprocess
import sys
from functools import cache, partial
from pathlib import Path

import pytest

from clutchid.estimation.checks import ROOT_TOLERANCE
from clutchid.estimation.prediction_error import CONVERGED_MOVE
from clutchid.inference.smoother.search import CONVERGED_GAIN
from golden import results
from golden.comparison import differences

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
WRITE = os.environ.get("CLUTCHID_WRITE_GOLDEN", "")

#: Share by which a result of a fit, a simulation, and what is computed without one may differ. Rounding comes to 1e-9,
#: 1e-14 and nothing by processors from x86-64-v2 on and libraries for them: CONTRIBUTING.md has the commands.
FITTED, SIMULATED, EXACT = 1e-6, 1e-9, 1e-12

GROUPS = ("simulation", "paper", "shooting", "automatic", "prediction_error", "trucks")

#: Searches that are done again, by their number: one of each method, a profile, and drives in a closed loop.
AGAIN = {"paper": [0, 2], "shooting": [0, 1], "automatic": [5], "prediction_error": [2], "trucks": range(0, 70, 7)}

#: Cost of a search by simulation: half a sum of squares, which ends where a step gains this share of it.
SIMULATION_GAIN = 1e-9


#: Environment of the results: the order of sums does not depend on the machine.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


def program(group, *arguments, text=""):
    """What `results.py` prints: with one thread, so that it may need a process of its own."""
    if not arguments and ONE_THREAD.items() <= os.environ.items():
        return json.loads(results.evaluated(group, text))
    process = subprocess.run(
        [sys.executable, "-m", "golden.results", group, *arguments],
        cwd=HERE.parent, env={**os.environ, **ONE_THREAD}, input=text, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


def ends_of(group):
    path = HERE / f"{group}.ends.json.gz"
    if WRITE == "1":
        path.write_bytes(gzip.compress(json.dumps(program(group, "search")).encode(), mtime=0))
    return json.loads(gzip.decompress(path.read_bytes()))


@cache
def evaluated(group):
    """Results of a group where its searches have ended, and what searching again comes to."""
    asked = {"ends": ends_of(group), "again": [*AGAIN.get(group, ())]}
    now = program(group, text=json.dumps(asked))
    if WRITE:
        rows = [
            f"{json.dumps(name)}: {json.dumps(written(value, tolerance(group, name)), ensure_ascii=False)}"
            for name, value in now["results"].items()
        ]
        (HERE / f"{group}.json").write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")
    return now


def tolerance(group, name):
    if group == "trucks" and name.split("/")[2] in ("type", "changes", "loads"):
        return EXACT
    return SIMULATED if group in ("simulation", "trucks") else FITTED


def written(value, share):
    """Numbers with four digits more than are compared: a column may be large beside its range."""
    if isinstance(value, list):
        return [written(inner, share) for inner in value]
    digits = 4 - round(math.log10(share))
    return float(f"{value:.{digits}g}") if isinstance(value, float) and math.isfinite(value) else value


@pytest.mark.parametrize("group", GROUPS)
def test_results_are_what_they_were(group):
    now = evaluated(group)["results"]
    content = json.loads((HERE / f"{group}.json").read_text(encoding="utf-8"))
    lines = differences(content, now, partial(tolerance, group))
    assert not lines, f"{len(lines)} of {len(content)} results are different:\n" + "\n".join(lines)


@pytest.mark.parametrize("group", AGAIN)
def test_a_search_ends_where_it_did(group):
    searched = evaluated(group)["searched"]
    assert len(searched) == len(AGAIN[group])
    if group == "trucks":
        # rounding may turn a reading of a quantised sensor, after which a closed loop takes another course
        assert sum(end["other samples"] > 0 for end in searched.values()) <= 1, searched
        return
    for name, end in searched.items():
        if "profile" in name:
            assert end["half widths"] <= 2 * ROOT_TOLERANCE, (name, end)
            continue
        gain, distance = allowed(group, end["cost"])
        assert end["gain"] <= gain, (name, end)
        assert end["distance"] <= distance, (name, end)


def allowed(group, cost):
    """Cost by which a search may end higher, and distance in standard deviations, by the gain at which it ends.

    Both ends may lie off the minimum of a quadratic cost by what this gain allows.
    """
    if group == "paper":
        return SIMULATION_GAIN * cost, 2 * math.sqrt(2 * SIMULATION_GAIN * cost)
    if group == "prediction_error":
        return CONVERGED_MOVE**2, 2 * CONVERGED_MOVE
    return CONVERGED_GAIN, 2 * math.sqrt(CONVERGED_GAIN)
