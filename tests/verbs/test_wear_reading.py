"""The change since the calibration as `observe` and `estimate` read it from one recording."""

import numpy as np
import pytest

import clutchid
from clutchid.estimation.assess.comparison import half_load
from clutchid.truck import truck
from clutchid.verbs.reading import Reading
from clutchid.verbs.virtual_fleet import LOAD_POSITIONS, engaging, load_at_positions
from clutchid.verbs.wear_reading import later_calibrations, read_recording
from clutchid.wear.history import RecordingJob

WEAR = 1.5e-3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A calibration of truck 1, and recordings of it when worn: with the supply pressure, and without."""
    where, new = tmp_path_factory.mktemp("readings"), truck(1)
    cal = clutchid.calibrate(clutchid.drive(new, seconds=15.0, seed=1, conditions=True).log)
    clutchid.write_parameters(clutchid.parameter_file(cal), where / "cal.toml")
    log = clutchid.drive(new, seconds=15.0, seed=2, wear=WEAR, pressure=False, conditions=True).log
    clutchid.write(log, where / "worn.parquet")
    return where


def read(folder, by, name="worn"):
    return read_recording(Reading(), by, RecordingJob(name, path=folder / f"{name}.parquet", start=folder / "cal.toml"))


def true_change():
    before, after = (
        load_at_positions(new_or_worn) for new_or_worn in (truck(1), clutchid.truck.aged(truck(1), WEAR, 0))
    )
    shift = half_load(LOAD_POSITIONS, after) - half_load(LOAD_POSITIONS, before)
    return shift, engaging(after) / engaging(before) - 1.0


@pytest.mark.slow
@pytest.mark.parametrize("by", ["observe", "estimate"])
def test_both_measure_the_change_of_a_worn_clutch_with_an_error_that_they_state(folder, by):
    reading = read(folder, by)
    assert (reading.by, reading.measurement.by, reading.reason) == (by, by, "")
    change, (shift, load) = reading.measurement, true_change()
    assert abs(change.shift - shift) < 2 * change.shift_std < 0.25e-3
    assert abs(change.load - load) < 2 * change.load_std < 0.06
    assert change.temperature == pytest.approx(truck(1).T_0, abs=2.0)
    half = reading.half_load
    assert change.shift_std == pytest.approx((half.high - half.low) / 3.92, rel=1e-3)


@pytest.mark.slow
def test_what_is_observed_but_not_determined_says_why(folder):
    log = clutchid.read(folder / "worn.parquet")
    clutchid.write(log.slice(0, 600), folder / "short.parquet")
    reading = read(folder, "observe", "short")
    assert reading.measurement is None
    assert "ended" in reading.reason
    assert np.isfinite(reading.curve.force).all()


@pytest.mark.slow
def test_a_leak_that_the_observer_flags_is_one_of_the_reading(folder):
    leaking = truck(1).replace({"C_A0": truck(1).C_A0 + 1e-10})
    clutchid.write(clutchid.drive(leaking, seconds=15.0, seed=3, conditions=True).log, folder / "leaking.parquet")
    assert read(folder, "observe").leak is None
    leak = read(folder, "observe", "leaking").leak
    assert 5e-11 < leak.conductance < 2e-10
    assert leak.probability > 0.999


@pytest.mark.slow
def test_auto_observes_what_records_its_supply_and_shows_no_fault_and_estimates_the_rest(folder):
    log = clutchid.read(folder / "worn.parquet")
    clutchid.write(log.without("pressure_supply"), folder / "no_supply.parquet")
    clutchid.write(log.slice(0, 4000), folder / "few_strokes.parquet")
    slow = clutchid.drive(truck(1), seconds=15.0, seed=2, wear=WEAR, recorder="bus", conditions=True).log
    clutchid.write(slow, folder / "slow.parquet")
    for name, by in (("worn", "observe"), ("no_supply", "estimate"), ("few_strokes", "estimate")):
        auto, alone = read(folder, "auto", name), read(folder, by, name)
        assert auto.by == by, name
        assert auto._replace(curve=None) == alone._replace(curve=None), name
    assert read(folder, "auto", "slow").message == read(folder, "estimate", "slow").message
    assert "cannot wait for the next sample" in read(folder, "observe", "slow").message


@pytest.mark.slow
def test_a_later_calibration_of_a_worn_clutch_lies_from_the_first_by_its_wear(folder):
    worn = clutchid.drive(truck(1), seconds=15.0, seed=3, wear=WEAR, conditions=True).log
    later = clutchid.parameter_file(clutchid.calibrate(worn))
    clutchid.write_parameters(later, folder / "cal@2026-05-01.toml")
    (folder / "none@2026-06-01.toml").write_text("[parameters]\n")
    starts = [folder / name for name in ("cal.toml", "cal@2026-05-01.toml", "none@2026-06-01.toml")]
    offsets = later_calibrations(starts)
    assert [*offsets] == starts[1:]
    change, (shift, load) = offsets[starts[1]], true_change()
    both = 3.0 * np.sqrt(2.0)  # the first calibration has as large an error as the later one
    assert abs(change.shift - shift) < both * change.shift_std < 0.3e-3
    assert abs(change.load - load) < both * change.load_std < 0.1
    assert offsets[starts[2]].shift_std > 1e-3, "without a load its offset is not known"
