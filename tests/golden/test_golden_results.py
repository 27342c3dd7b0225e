"""Results of every method, kept as numbers: a change is seen, to the last bit on the machine that kept them.

Where a change is meant, write the numbers anew and look at the difference before keeping them:

    CLUTCHID_WRITE_GOLDEN=1 python -m pytest tests/golden && git diff --stat tests/golden
"""

import gzip
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
GROUPS = ("simulation", "paper", "shooting", "automatic", "prediction_error", "trucks")

#: Elsewhere another compiler or processor rounds differently. A simulation multiplies that by 1e6 at most.
SIMULATED = 1e-9

#: A search ends where a whole step would gain less than 0.1 in the cost: the estimates are then within sqrt(0.1) of a
#: standard deviation of the minimum, on either machine.
SEARCHED = 2 * math.sqrt(0.1)


def kept(group):
    path = HERE / f"{group}.json.gz"
    return json.loads(gzip.decompress(path.read_bytes())) if path.exists() else None


def keep(group, found):
    text = json.dumps(found, indent=0).encode()
    (HERE / f"{group}.json.gz").write_bytes(gzip.compress(text, mtime=0))


@pytest.mark.parametrize("group", GROUPS)
def test_results_are_what_they_were(group):
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, str(HERE / "results.py"), group],
        env={**os.environ, **one_thread}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = json.loads(done.stdout)
    if os.environ.get("CLUTCHID_WRITE_GOLDEN"):
        keep(group, found)
    before = kept(group)
    assert list(found["results"]) == list(before["results"])
    changed = [name for name, value in found["results"].items() if repr(value) != repr(before["results"][name])]
    if found["machine"] != before["machine"]:
        changed = [name for name in changed if not alike(name, before["results"], found["results"])]
    assert not changed, f"{len(changed)} results have changed, the first are {changed[:8]}"


def alike(name, before, found):
    """Whether a number is the same but for the rounding of another machine."""
    old, new = before[name], found[name]
    if isinstance(old, str) or isinstance(new, str):
        # sentences hold rounded numbers, hashes all bits
        return True
    if name.endswith("samples") and "/log/" in name:
        return near(old, new, SIMULATED * largest(old))
    spread = deviation(name, before)
    if spread is not None:
        return near(old, new, SEARCHED * spread)
    # what follows from estimates: simulations, errors, bands, figures of the diagnosis
    return type(old) is type(new) and near(old, new, 0.2 * largest(old) + 1e-9)


def deviation(name, before):
    """The standard deviation of an estimate or of the load curve, in the same unit."""
    root = name.rpartition("/json/")[0]
    if name.endswith("/value") and f"{name.removesuffix('value')}std" in before:
        return before[f"{name.removesuffix('value')}std"]
    if name.endswith("/load_curve/force_N"):
        low, high = (np.array(before[f"{root}/json/load_curve/{side}_N"]) for side in ("low", "high"))
        return float(np.nanmax((high - low) / 4))
    return None


def near(old, new, tolerance):
    one, other = np.atleast_1d(np.array(old, dtype=float)), np.atleast_1d(np.array(new, dtype=float))
    return one.shape == other.shape and np.allclose(one, other, rtol=0.0, atol=tolerance, equal_nan=True)


def largest(values):
    size = np.abs(np.atleast_1d(np.array(values, dtype=float)))
    return float(np.nanmax(size, initial=0.0))
