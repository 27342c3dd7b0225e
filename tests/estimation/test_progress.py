"""What a search reports while it goes on."""

import numpy as np
import pytest

from clutchid import fit
from clutchid.inference.uncertainty.calibration import Calibration

EXACT = Calibration((), np.zeros((0, 0)))
METHODS = ["simulation", "shooting", pytest.param("prediction-error", marks=pytest.mark.slow)]


@pytest.mark.parametrize("method", METHODS)
def test_evaluations_are_counted_and_stages_follow_each_other(plant, worn_log, method):
    reported, options = [], {} if method == "simulation" else {"calibration": EXACT}
    found = fit(
        worn_log.slice(0, 1500), plant, free="load", method=method,
        progress=lambda stage, count: reported.append((stage, count)), **options,
    )  # fmt: skip
    stages, counts = zip(*reported, strict=True)
    assert counts == tuple(sorted({*counts}))
    assert counts[-1] <= found.evaluations
    # shooting evaluates single windows between what it reports
    assert method == "shooting" or counts == tuple(range(1, found.evaluations + 1))
    assert list(stages) == sorted(stages)
    assert set(stages) <= {"coarse", "fine"}
