"""One law: however a recording is cut, live, and wherever its state passes through a file, the numbers are the same."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from clutchid.inference.uncertainty.calibration import Calibration
from clutchid.inference.uncertainty.conditions import RecordedConditions
from clutchid.log import Log
from clutchid.model import Actuator
from clutchid.observer import observe, observe_recording, observer, read_state, start, write_state
from clutchid.observer.flags import LIVE_FLAGS, REPEATED_TIME
from clutchid.observer.live import after_block, live_run
from clutchid.observer.methods import METHODS
from clutchid.observer.run import usual_nis
from clutchid.strokes.vented_rest import vented_rest
from fixtures.observing import assert_same

#: Supply and air temperature recorded, sensor moved, leak: every pair of answers.
CONDITIONS = {
    "plain": (False, False, False),
    "leak and moved sensor": (False, True, True),
    "leak and recorded supply and temperature": (True, False, True),
    "moved sensor and recorded supply and temperature": (True, True, False),
}


#: The sample from which on a recording is sound, and shows its vented rest.
SOUND = 3000


@pytest.fixture(scope="module")
def recordings(worn, recorded_by):
    """A recording of a sound and of a leaking actuator."""
    leaking = worn.replace({"C_A0": 1.5e-10})
    return {leaks: recorded_by(a, seconds=6.0, seed=5, driven=1) for leaks, a in ((False, worn), (True, leaking))}


def faulty(log: Log) -> Log:
    """With spikes, missing and impossible values, samples that are lost or repeated, and a hole; the end is sound."""
    rng = np.random.default_rng(11)
    columns = {name: values.copy() for name, values in log.columns.items()}
    time = log.time + 1e-5 * rng.uniform(-1.0, 1.0, len(log))
    columns["position"][rng.integers(100, SOUND, 20)] = 65.535e-3
    columns["position"][2100:2300] = columns["position"][2100]
    columns["duty_supply"][rng.integers(100, SOUND, 20)] = np.nan
    columns["duty_exhaust"][rng.integers(100, SOUND, 20)] = 1.0004
    time[2800:] += 0.4
    lost = np.isin(np.arange(len(log)), [*rng.integers(100, SOUND, 40), *range(1500, 1505), *range(2600, 2615)])
    time[2701] = time[2700] + 2e-5
    return Log(time[~lost], {name: values[~lost] for name, values in columns.items()}, log.name)


@pytest.fixture(scope="module")
def case(plant, recordings):
    """An observer of a method and a recording with all faults, under some conditions."""

    @cache
    def calibrated(actuator, conditions):
        supply, moved, leaks = CONDITIONS[conditions]
        log = recordings[leaks].without("pressure_a")
        P_S, shown = actuator.value("P_S"), 1.08
        recorded = RecordedConditions(290.0, shown * P_S, P_S) if supply else RecordedConditions()
        calibration = Calibration(
            (), np.zeros((0, 0)), conditions=recorded, rest=vented_rest(recordings[False].without("pressure_a"))
        )
        calibration = replace(calibration, nis=usual_nis(actuator, calibration, [log]))
        if supply:
            noise = 1e3 * np.random.default_rng(1).standard_normal(len(log))
            air = np.where(np.arange(len(log)) % 7, np.nan, 280.0 + log.time)
            log = log.with_columns(pressure_supply=0.97 * shown * P_S + noise, temperature_ambient=air)
        if moved:
            log = log.with_columns(position=log["position"] + 4.5e-4)
        return calibration, faulty(log)

    def made(method, conditions):
        actuator = Actuator() if method == "paper" else plant
        calibration, log = calibrated(actuator, conditions)
        return observer(actuator, method, calibration=calibration), log

    return made


def cuts_of(size: int, seed: int) -> list[int]:
    """Borders of blocks: of single samples, of few, of many, and of none."""
    rng = np.random.default_rng(seed)
    near = rng.integers(0, size - 30)
    return sorted([0, *range(near, near + 4), *rng.integers(0, size, 5), *[int(rng.integers(size))] * 2, size])


@pytest.mark.parametrize("conditions", CONDITIONS)
@pytest.mark.parametrize("method", METHODS)
def test_a_recording_gives_the_same_numbers_however_it_is_cut_and_resumed(case, tmp_path, method, conditions):
    joint, log = case(method, conditions)
    whole = observe_recording(joint, log)
    seed = list(METHODS).index(method) * len(CONDITIONS) + list(CONDITIONS).index(conditions)
    run, parts = live_run(joint, start(joint)), []
    repeated = int(np.argmin(np.diff(log.time))) + 1  # a block of its own
    for first, last in pairwise(sorted([*cuts_of(len(log), seed), repeated, repeated + 1])):
        run, part = after_block(run, log.slice(first, last), dict.fromkeys(LIVE_FLAGS, 0))
        write_state(joint, part.after, tmp_path / "state.toml")
        run = replace(run, after=read_state(joint, tmp_path / "state.toml"))
        assert_same(run.after, part.after)
        parts.append(part.samples)
    for name, values in whole.samples._asdict().items():
        together = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(together, values, name)
    np.testing.assert_array_equal(run.recent().samples.states, whole.samples.states)
    assert_same(run.after, whole.after)
    rows = [[(row.number, row.time, row.estimates) for row in strokes] for strokes in (run.strokes, whole.strokes)]
    assert rows[0] == rows[1]
    assert len(run.strokes) > 1
    assert {name: run.health[name] for name in whole.health} == pytest.approx(dict(whole.health))


def test_the_recordings_of_this_law_have_what_it_is_about(case):
    """Supply and temperature are used, the zero moves, a leak is seen, and the faults are flags."""
    runs = {conditions: observe_recording(*case("joint", conditions)) for conditions in CONDITIONS}
    for conditions, (supply, moved, leaks) in CONDITIONS.items():
        run = runs[conditions]
        assert run.assumes_supply != supply
        assert (run.after.temperature > 282.0) == supply
        assert np.unique(run.samples.rest).size > 1 or not moved
        assert run.after.leaking or not leaks
        raised = {name for name, seconds in run.health.items() if seconds > 0.0}
        assert {"position_none", "position_frozen", "duty_missing"} <= raised


def test_a_recording_with_as_many_samples_lost_as_repeated_has_nothing_at_those_that_repeat(joint, log):
    time = log.time.copy()
    time[511] = time[510] + 2e-5
    present = np.arange(len(log)) != 500
    torn = Log(time[present], {name: values[present] for name, values in log.columns.items()}, log.name)
    samples = observe_recording(joint, torn).samples
    assert np.flatnonzero(samples.flagged(REPEATED_TIME)).tolist() == [510]
    assert np.isnan(samples.states[510]).all()
    _, alone = observe(joint, start(joint), torn.slice(0, 505))
    np.testing.assert_array_equal(samples.states[:505], alone.states)
