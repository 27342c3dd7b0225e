"""Inputs that bug reports of other tools suggested: each is read right, or refused in one true sentence."""

from pathlib import Path

import numpy as np
import pytest

from clutchid.measurements import read


@pytest.fixture(scope="session")
def hunt(data) -> Path:
    """Folder of these inputs."""
    return data("hunt")


def on_bus(hunt, name, database="10_std.dbc", **options):
    return read(hunt / name, dbc=[hunt / database], **options)


@pytest.fixture(scope="module")
def trigger(hunt):
    """A drive of 3 s whose stamps begin 1 s before a trigger."""
    return on_bus(hunt, "10b_negative.asc")


def test_stamps_before_a_trigger_are_negative(hunt, trigger):
    """09c, 10b."""
    assert trigger.time[[0, -1]] == pytest.approx([-1.0, 1.998])
    assert trigger.time.size == 1500
    assert [samples[0].size for samples in trigger.edges.values()] == [1499, 1499], "but for the one behind the end"
    blf = on_bus(hunt, "09c_negative.blf")
    assert np.allclose(blf.time, trigger.time, rtol=0, atol=4e-6), "python-can has such stamps to 4 us"
    assert np.array_equal(blf["position"], trigger["position"])


def test_a_clock_that_restarts_moves_all_messages_by_one_shift(hunt, trigger):
    """10k."""
    log = on_bus(hunt, "10k_restart_rates.asc")
    assert np.array_equal(log["position"], trigger["position"])
    restart = int(np.argmax(np.diff(log.time))) + 1
    assert log.time[restart] - log.time[restart - 1] == pytest.approx(1.0)
    stamps, _ = log.edges["duty_supply"]
    later = stamps > log.time[restart - 1]
    assert stamps[later][0] - log.time[restart] == pytest.approx(1e-4), "the valves' frames are 0.1 ms later"
    assert np.allclose(np.diff(stamps[later]), 0.02, rtol=0, atol=1e-9)
    assert any("the clock restarts at frame 1101" in sentence for sentence in log.warnings)


def test_a_lone_stamp_ahead_is_left_out(hunt, trigger):
    """41."""
    log = on_bus(hunt, "41_one_stamp_ahead.asc")
    assert np.array_equal(log["position"], np.delete(trigger["position"], 500))
    assert log.time[-1] == pytest.approx(2.998)
    assert np.isfinite(log["duty_supply"][1:]).all()
    assert any("left out: frame 1001 (7 s after 0.9981 s)" in sentence for sentence in log.warnings)


def test_a_jump_ahead_and_back_makes_no_grid_of_a_hole(hunt, trigger):
    """10h."""
    log = on_bus(hunt, "10h_jump_forward_and_back.asc", channels=hunt / "map10h.toml")
    assert log.time.size == pytest.approx(3000, abs=2)
    assert np.array_equal(log["position"][::2], trigger["position"])
    assert any("jumps at frame 701" in sentence for sentence in log.warnings)


def test_a_time_of_day_goes_on_over_midnight(hunt):
    """07d."""
    log = read(hunt / "07d_midnight.csv")
    assert np.allclose(np.diff(log.time), 0.002, rtol=0, atol=1e-9)
    assert any("midnight" in sentence for sentence in log.warnings)


def test_stamps_in_bursts_get_the_mean_rate(hunt):
    """40."""
    log = read(hunt / "40_burst_stamps.parquet")
    assert np.allclose(np.diff(log.time), 1e-3, rtol=1e-4, atol=0)
    assert any("arrive in bursts of 16 every 0.0156 s" in sentence for sentence in log.warnings)


@pytest.mark.parametrize("mapped", [False, True])
def test_rows_that_hold_only_what_arrived_give_each_channel_its_own_samples(hunt, mapped):
    """28a, 28c."""
    channels = {"channels": hunt / "map28.toml"} if mapped else {}
    joined = read(hunt / "28c_outer_join.parquet", **channels)
    assert np.isfinite(joined["position"]).all()
    assert np.isfinite(joined["duty_supply"][1:]).all()
    assert joined.time.size == (1500 if mapped else 15000)
    sparse = read(hunt / "28a_sparse_position.parquet", **channels)
    assert np.isfinite(sparse["position"][: -10 if not mapped else None]).all()
    assert np.isfinite(sparse["duty_supply"]).all()
    assert sparse.warnings == ()


@pytest.mark.parametrize(
    ("name", "mapped"), [("03a_own_time_columns", "map03"), ("03d_own_times_same_length", "map03d")]
)
def test_a_value_belongs_to_the_time_column_before_it(hunt, name, mapped):
    """03a, 03d."""
    whole = read(hunt / "07d_midnight.csv")
    for channels in ({}, {"channels": hunt / f"{mapped}.toml"}):
        log = read(hunt / f"{name}.csv", **channels)
        assert np.allclose(log["position"], whole["position"], rtol=0, atol=1e-9)
        late = 0.13 if name.startswith("03d") else 0.0
        stamps, values = log.edges["duty_supply"] if log.edges else (log.time, log["duty_supply"])
        edge = stamps[np.argmax(values > 0.5)]
        assert edge == pytest.approx(whole.time[np.argmax(whole["duty_supply"] > 0.5)] + late, abs=0.011)
        assert np.isfinite(log["duty_supply"][log.time >= 0.14]).mean() > 0.95


def test_a_duty_cycle_or_time_without_a_unit_under_its_standard_name_is_guessed_with_a_remark(hunt):
    """17, 24b."""
    log = read(hunt / "17_virtual_master.mf4")
    assert "duty_supply: 'duty_supply' has no unit; [1] is guessed from its range." in log.warnings
    assert log["duty_supply"].max() == 1.0
    row = read(hunt / "24b_row_int16.mat")
    assert np.allclose(np.diff(row.time), 0.002, rtol=0, atol=1e-6)
    assert any(sentence.startswith("time: 'time' has no unit; [s] is guessed.") for sentence in row.warnings)


def test_timetables_of_a_file_share_one_zero(hunt):
    """23: the second starts 0.13 s later."""
    pytest.importorskip("matio")
    log = read(hunt / "23_two_timetables_v7.mat")
    assert log.time[0] == 0.0
    assert np.array_equal(np.isnan(log["duty_supply"]), log.time < 0.13 - 1e-6)
    assert log.edges["duty_supply"][0][0] == pytest.approx(0.13, abs=1e-6)
