"""Inputs that bug reports of other tools suggested: each is read right, or refused in one true sentence."""

import gzip
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from clutchid import Actuator
from clutchid.errors import DataError
from clutchid.measurements import read
from clutchid.measurements.columns import REQUIRED
from clutchid.measurements.live.text import text_blocks
from clutchid.measurements.map.channel_map import Channel, ChannelMap
from clutchid.preparation.inspection import inspect
from clutchid.strokes.values import values_of
from fixtures.cases import cases

sys.path.insert(0, str(Path(__file__).parent))

from forms import Form, write, wrong_in


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


@pytest.fixture(scope="module")
def drive(hunt):
    """Another drive, of 5 s, as a table."""
    return read(hunt / "07d_midnight.csv")


@pytest.mark.parametrize("case", cases(__file__, "hunt"))
def test_an_input_is_read_right_or_refused_in_a_true_sentence(hunt, trigger, drive, case):
    dbc = [hunt / case["dbc"]] if "dbc" in case else ()
    if "refused" in case:
        with pytest.raises(DataError, match=re.escape(case["refused"])):
            read(hunt / case["file"], dbc=dbc)
        return
    log = read(hunt / case["file"], dbc=dbc)
    if "like" in case:
        position = {"trigger": trigger, "drive": drive}[case["like"]]["position"][: case.get("first")]
        assert np.allclose(log["position"], np.delete(position, case.get("without", [])), rtol=0, atol=1e-9)
    if "interval" in case:
        assert np.allclose(np.diff(log.time), case["interval"], rtol=0, atol=case.get("slack", 1e-9))
    assert log.time.size == case.get("samples", log.time.size)
    assert np.count_nonzero(np.isnan(log["position"])) == case.get("missing", 0)
    assert np.nanmax(log["duty_supply"]) == 1.0
    assert any(case.get("warning", "") in sentence for sentence in (*log.warnings, ""))


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


def test_a_jump_ahead_and_back_makes_no_grid_of_a_hole(hunt, trigger):
    """10h."""
    log = on_bus(hunt, "10h_jump_forward_and_back.asc", channels=hunt / "map10h.toml")
    assert log.time.size == pytest.approx(3000, abs=2)
    assert np.array_equal(log["position"][::2], trigger["position"])
    assert any("jumps at frame 701" in sentence for sentence in log.warnings)


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
def test_a_value_belongs_to_the_time_column_before_it(hunt, drive, name, mapped):
    """03a, 03d."""
    for channels in ({}, {"channels": hunt / f"{mapped}.toml"}):
        log = read(hunt / f"{name}.csv", **channels)
        assert np.allclose(log["position"], drive["position"], rtol=0, atol=1e-9)
        late = 0.13 if name.startswith("03d") else 0.0
        stamps, values = log.edges["duty_supply"] if log.edges else (log.time, log["duty_supply"])
        edge = stamps[np.argmax(values > 0.5)]
        assert edge == pytest.approx(drive.time[np.argmax(drive["duty_supply"] > 0.5)] + late, abs=0.011)
        assert np.isfinite(log["duty_supply"][log.time >= 0.14]).mean() > 0.95


def test_a_signal_has_the_time_before_it_where_labview_writes_one_for_each(hunt):
    """50: the valves begin 0.5 s later."""
    log = read(hunt / "50_multi_x.lvm")
    assert log.time[np.argmax(log["duty_supply"] > 0)] == pytest.approx(0.8, abs=0.009)
    assert np.array_equal(np.isnan(log["duty_supply"]), log.time < 0.5 - 1e-6)


def test_timetables_of_a_file_share_one_zero(hunt):
    """23: the second starts 0.13 s later."""
    pytest.importorskip("matio")
    log = read(hunt / "23_two_timetables_v7.mat")
    assert log.time[0] == 0.0
    assert np.array_equal(np.isnan(log["duty_supply"]), log.time < 0.13 - 1e-6)


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("51_groups", ["DG0_position", "DG1_duty_supply", "DG1_duty_exhaust"]),
        ("52_time_value", ["position(:,2)", "duty_supply(:,2)", "duty_exhaust(:,2)"]),
    ],
)
def test_each_signal_of_a_matlab_file_has_its_own_time(hunt, name, columns):
    """51, 52: the valves at half the rate, 8 ms later."""
    units = {"position": "mm", "duty_supply": "%", "duty_exhaust": "%"}
    channels = {name: Channel(text, unit=units[name]) for name, text in zip(units, columns, strict=True)}
    log = read(hunt / f"{name}.mat", channels=ChannelMap(channels))
    assert np.allclose(np.diff(log.time), 0.008, rtol=0, atol=1e-9)
    assert 0.022 < log["position"].max() < 0.023
    assert log.time[np.argmax(log["duty_supply"] > 0.5)] == pytest.approx(0.312, abs=1e-9)


def test_a_bracket_that_is_an_index_is_no_unit_where_a_row_of_units_stands(hunt, drive):
    """26g."""
    names = {"time": "Time", "position": "POS[1]", "duty_supply": "PWM[0]", "duty_exhaust": "PWM[1]"}
    log = read(hunt / "26g_index_names.csv", channels=ChannelMap({name: Channel(text) for name, text in names.items()}))
    size = log.time.size
    assert np.allclose(log["position"], drive["position"][:size], rtol=0, atol=1e-9)
    assert np.allclose(log["duty_supply"], drive["duty_supply"][:size], rtol=0, atol=1e-9)


def test_objects_with_keys_missing_give_each_channel_its_own_samples(hunt):
    """27f, as a file and as it arrives."""
    log = read(hunt / "27f_missing_key.jsonl.gz")
    assert np.isfinite(log["position"][:-9]).all()
    assert log.warnings == ()
    text = gzip.decompress((hunt / "27f_missing_key.jsonl.gz").read_bytes())
    for size in (1 << 12, 1 << 20):
        pieces = (text[i : i + size] for i in range(0, len(text), size))
        blocks = [block.log for block in text_blocks(pieces, "live", None, 1.013e5, REQUIRED)]
        time = np.concatenate([block.time for block in blocks])
        assert np.allclose(np.diff(time), 0.01, rtol=0, atol=1e-9), "the position's own samples"
        assert np.array_equal(np.concatenate([block["position"] for block in blocks]), log["position"][::10])
        assert np.array_equal(np.concatenate([block["duty_supply"] for block in blocks]), log["duty_supply"][::10])
        assert sum(block.left_out.unreadable for block in text_blocks(iter([text]), "live", None, 1e5, REQUIRED)) == 0


def test_groups_in_rows_that_hold_only_what_arrived_restart_together(tmp_path):
    """As 28c, by a logger that starts again."""
    form = Form(clock="restart", layout="sparse")
    path, _ = write(form, tmp_path)
    assert wrong_in(form, read(path)) == ""


def test_a_recorded_supply_that_falls_is_said(hunt):
    """30."""
    checks = {check.name: check for check in inspect(read(hunt / "30_supply_step.parquet"), Actuator()).checks}
    check = checks["recorded supply pressure"]
    assert check.grade == "suspect"
    assert check.sentence.startswith("the recorded supply falls from 9.6 to 7.5 bar at 20 s")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("25r_spikes.parquet", "30 samples beyond the stops, the first at 0.038 s (65.5 mm), treated as missing"),
        (
            "25j_rezero_mid.parquet",
            ("position jumps by +1.06 mm at 15.000 s, faster than a piston moves, and stays there"),
        ),
    ],
)
def test_what_is_no_value_of_the_position_is_said(hunt, name, said):
    """25r, 25j."""
    assert said in values_of(read(hunt / name), Actuator()).warnings[0]
