"""Trust falls with the faults of late, however long the drive was before, and comes back."""

import numpy as np
import pytest

from clutchid.codegen.kernels import kernels_in
from clutchid.estimation.assess.observed import FLAGGED, indicators, observed_verdict
from clutchid.log import Log
from clutchid.observer import observer
from clutchid.observer.flags import FLAGS
from clutchid.observer.health import faults_after
from clutchid.observer.run import observe_recording
from clutchid.observer.state import NO_FAULTS

SECOND = 1000


def shares(plant, name, fault, seconds=600, strokes=()):
    """Share of a flag as its limit counts it, each second; it is raised in a slice of samples, and strokes end."""
    n = seconds * SECOND
    flagged, ends = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    flagged[fault] = 1 << [*FLAGS].index(name)
    ends[list(strokes)] = 1
    of, faults, counted = observer(plant), NO_FAULTS, []

    for at in range(0, n, SECOND):
        faults = faults_after(faults, of, flagged[at : at + SECOND], ends[at : at + SECOND])
        at_flag = [*FLAGS].index(name)
        counted.append(kernels_in("clutchid.observer.faults_rule").recent(faults, at_flag, FLAGGED[name].care))
    return np.array(counted)


@pytest.mark.parametrize(("name", "heals"), [("position_missing", 3), ("supply_unlike", 30)])
@pytest.mark.parametrize("begin", [100, 500])
def test_five_seconds_of_a_fault_are_seen_in_a_long_drive_and_over_some_seconds_later(plant, name, heals, begin):
    share = shares(plant, name, slice(begin * SECOND, (begin + 5) * SECOND))
    above = np.flatnonzero(share > FLAGGED[name].care)
    assert begin <= above[0] < begin + 5
    assert above[-1] == pytest.approx(begin + 4 + heals, abs=1.0)


def test_in_the_first_seconds_the_share_is_that_of_all_time(plant):
    assert shares(plant, "position_missing", slice(0, 1500), seconds=3)[-1] == pytest.approx(0.5, abs=1e-3)


def test_a_fault_that_counts_however_short_is_over_after_two_strokes(plant):
    share = shares(plant, "diverged", slice(5500, 5501), seconds=20, strokes=(5600, 12_500))
    assert np.flatnonzero(share > 0.0).tolist() == list(range(5, 12))


def test_a_position_that_is_missing_at_the_end_of_a_long_recording_lowers_the_trust(plant, recorded_by):
    log = recorded_by(plant, seconds=6.0)
    resting = {name: np.concatenate([np.full(40 * SECOND, log[name][0]), log[name]]) for name in log.columns}
    noise = 1e-5 * np.random.default_rng(0).standard_normal(40 * SECOND + len(log))
    long = Log(1e-3 * np.arange(noise.size), {**resting, "position": resting["position"] + noise})
    late = long.with_columns(position=np.where(long.time > long.time[-1] - 5.5, np.nan, long["position"]))
    sound, lacking = (observed_verdict(indicators(observe_recording(observer(plant), part))) for part in (long, late))
    assert not any("is missing" in reason for reason in sound.reasons)
    assert "the position is missing (24 % of the last 20 s)" in " ".join(lacking.reasons)
