"""A fit of the bundled recording, kept as numbers: a change of numerics is seen.

Where the change is meant, write the numbers anew and look at the difference before keeping them:

    CLUTCHID_WRITE_GOLDEN=1 python -m pytest tests/golden && git diff tests/golden
"""

import json
import os
from pathlib import Path

import pytest

from clutchid.estimate import fit
from clutchid.io import read
from clutchid.simulation import Partition

FILE = Path(__file__).with_name("truck1_calibration.json")
FITS = {
    "ballistic": {},
    "every 200, q": {"partition": Partition(every=200, carry="q")},
    "both measured": {"measure": ("position", "pressure_a"), "free": ("load", "P_S")},
}


@pytest.fixture(scope="module")
def recording(source):
    return read(source / "recordings" / "truck1_calibration.csv")


def numbers(result) -> dict:
    return {
        "status": result.status,
        "parameters": {
            name: {"value": e.value, "std": e.std, "low": e.low, "high": e.high}
            for name, e in result.parameters.items()
        },
        "position_rms": result.errors.position_rms,
        "pressure_a_rms": result.errors.pressure_a_rms,
    }


@pytest.mark.parametrize("name", FITS)
def test_a_fit_of_the_bundled_recording_is_what_it_was(recording, name):
    found = numbers(fit(recording, **FITS[name]))
    if os.environ.get("CLUTCHID_WRITE_GOLDEN"):
        kept = json.loads(FILE.read_text()) if FILE.exists() else {}
        FILE.write_text(json.dumps({**kept, name: found}, indent=2) + "\n")
    kept = json.loads(FILE.read_text())[name]
    assert found["status"] == kept["status"]
    assert list(found["parameters"]) == list(kept["parameters"])
    for parameter, expected in kept["parameters"].items():
        # compilers and processors round differently, 1e-10 after 30000 steps; the search ends where the cost has
        # settled to 1e-9, which is half the digits of a weight: 3e-5
        size = max(abs(expected["value"]), 1e-3 * 9e5 if parameter.startswith("theta") else 0.0)
        assert found["parameters"][parameter]["value"] == pytest.approx(expected["value"], abs=1e-4 * size)
        # a bandwidth is a whole number: one more or less of some thirty
        assert found["parameters"][parameter]["std"] == pytest.approx(expected["std"], rel=0.05)
    assert found["position_rms"] == pytest.approx(kept["position_rms"], rel=1e-5)
    assert found["pressure_a_rms"] == pytest.approx(kept["pressure_a_rms"], rel=1e-3)
