"""What a search reports while it goes on."""

import numpy as np
import pytest

from clutchid import FitRequest, calibrate, fit
from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.truck import Truck, drive

EXACT = Calibration((), np.zeros((0, 0)))
METHODS = ["simulation", "shooting", pytest.param("prediction-error", marks=pytest.mark.slow)]


@pytest.mark.parametrize("method", METHODS)
def test_evaluations_are_counted_and_stages_follow_each_other(plant, worn_log, method):
    reported, request = [], FitRequest(calibration=None if method == "simulation" else EXACT)
    result = fit(
        worn_log.slice(0, 1500), plant, request, free="load", method=method, force=True,
        progress=reported.append,
    )  # fmt: skip
    searched = [step for step in reported if step.evaluations]
    stages, counts, costs, most = zip(*searched, strict=True)
    assert counts == tuple(sorted({*counts}))
    assert counts[-1] <= max(most)
    last = [step for step in searched if step.stage != "changes"][-1]  # of the search that the result is of
    assert last.evaluations <= result.evaluations
    # shooting evaluates single windows between what it reports
    assert method == "shooting" or counts == tuple(range(1, result.evaluations + 1))
    assert list(dict.fromkeys(stages)) == [
        stage for stage in ("coarse search", "fine search", "changes") if stage in stages
    ]
    assert set(stages) <= {"coarse search", "fine search", *(["changes"] if method == "shooting" else [])}
    assert np.isfinite(last.cost)
    assert last.cost <= np.nanmax(costs)


@pytest.mark.slow
def test_a_calibration_names_every_stage_in_the_order_of_its_work():
    reported = []
    calibrate(drive(Truck(), seconds=2.5, seed=1).log, progress=reported.append)
    stages = list(dict.fromkeys(step.stage for step in reported))
    assert stages == [
        "reading", "checks", "preparation", "coarse search", "fine search", "evidence", "position alone", "innovations",
        "verification",
    ]  # fmt: skip
