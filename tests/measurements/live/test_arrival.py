"""Streams joined to blocks: other streams are held, and the blocks do not depend on how the samples come."""

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.measurements.columns import channel
from clutchid.measurements.live.arrival import live_blocks
from clutchid.measurements.live.order import ArrivedBatch, arrived, picked_streams
from clutchid.measurements.live.text import text_blocks
from clutchid.measurements.map.channel_map import Channel, ChannelMap
from clutchid.measurements.source import Raster, Table

NEEDED = ("time", "position", "duty_supply", "duty_exhaust")
RASTERS = (
    Raster((channel(0, "time", "s"), channel(1, "Supply", "1"), channel(2, "Exhaust", "1")), 0, "Valves", 0),
    Raster((channel(0, "time", "s"), channel(1, "Travel", "mm")), 0, "Clutch", 0),
)
MAP = ChannelMap({
    "position": Channel("Travel"), "duty_supply": Channel("Supply"), "duty_exhaust": Channel("Exhaust"),
})  # fmt: skip


def bus(seconds=1.0, valves=10e-3):
    """Stamps and values of two messages in the order in which they come: (stream, stamp, values)."""
    rows = [(0, t, (1e3 * t,)) for t in np.round(np.arange(0.0, seconds, 1e-3), 6)]
    rows += [(1, t, (t / 10.0, 0.5)) for t in np.round(np.arange(0.0, seconds, valves), 6)]
    return sorted(rows, key=lambda row: (row[1], row[0]))


def blocks_of(rows, size, channels=MAP):
    """Blocks, as they become whole, of samples that come `size` at a time."""
    picks = picked_streams("bus", RASTERS, channels, NEEDED)

    def pieces():
        for begin in range(0, len(rows), size):
            some = rows[begin : begin + size]
            arrived_samples = []
            for i, chosen in enumerate(picks):
                own = [(place, t, values) for place, (which, t, values) in enumerate(some) if which == i]
                count = len(RASTERS[chosen.raster].headings)
                table = np.array([[t, *values] for _, t, values in own]).reshape(len(own), count)
                numbers = dict(enumerate(table.T))
                at = np.array([place for place, *_ in own], dtype=np.int64)
                arrived_samples.append(
                    arrived(i, chosen, Table(RASTERS[chosen.raster].headings, numbers, len(own)), 1e5, at)
                )
            yield ArrivedBatch(np.array([t for _, t, _ in some]), arrived_samples)

    return live_blocks(pieces(), picks, "bus", {})


def whole(blocks):
    logs = [block.log for block in blocks if len(block.log)]
    time = np.concatenate([log.time for log in logs])
    return time, {name: np.concatenate([log[name] for log in logs]) for name in logs[0].columns}


def test_the_duty_cycles_of_another_message_are_held_until_the_next():
    time, columns = whole(blocks_of(bus(), 50))
    assert time == pytest.approx(np.arange(1000) * 1e-3)
    assert columns["position"] == pytest.approx(time)
    held = np.floor(time * 100 + 1e-6) / 100
    assert columns["duty_supply"] == pytest.approx(held / 10.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1, 7, 333])
@pytest.mark.parametrize("delay", [0.0, 0.012, -0.004])
def test_blocks_do_not_depend_on_how_the_samples_come(size, delay):
    channels = ChannelMap({**MAP.channels, "duty_supply": Channel("Supply", delay=delay)})
    rows = bus()
    del rows[400:420], rows[700]
    at_once, other = whole(blocks_of(rows, len(rows), channels)), whole(blocks_of(rows, size, channels))
    assert np.array_equal(at_once[0], other[0])
    for name, values in at_once[1].items():
        assert np.array_equal(values, other[1][name], equal_nan=True), name


def test_a_duty_cycle_that_stays_away_is_missing_after_five_intervals():
    rows = [row for row in bus() if not (row[0] == 1 and 0.5 < row[1] < 0.8)]
    time, columns = whole(blocks_of(rows, 20))
    missing = np.isnan(columns["duty_supply"])
    assert not missing[time < 0.549].any()
    assert missing[(time > 0.551) & (time < 0.799)].all()
    assert not missing[time > 0.801].any()


def test_the_first_block_waits_for_as_many_samples_as_give_the_interval():
    blocks = list(blocks_of(bus(), 3))
    assert len(blocks[0].log) >= 101
    assert max(len(block.log) for block in blocks[1:-1]) < 10


def text(rows):
    head = "time [ms],position [mm],duty_supply [%],duty_exhaust [1],pressure_a [bar]\n"
    return (head + "\n".join(rows) + "\n").encode()


def test_values_that_cannot_be_are_missing_and_counted():
    rows = [f"{i},1.0,50,0,3" for i in range(300)]
    rows[150], rows[160], rows[170] = "150,inf,50,0,3", "160,1.0,120,-0.5,3", ",1.0,50,0,3"
    blocks = list(text_blocks(iter([text(rows)]), "live", None, 1.1e5, NEEDED))
    time, columns = whole(blocks)
    assert time.size == 299
    assert np.flatnonzero(np.isnan(columns["position"])).tolist() == [150]
    assert np.flatnonzero(np.isnan(columns["duty_supply"])).tolist() == [160]
    assert columns["duty_supply"][0] == 0.5
    assert columns["pressure_a"][0] == 3e5
    left = np.sum([block.left_out for block in blocks], axis=0)
    assert left.tolist() == [0, 0, 1, 3]


def test_without_a_map_the_standard_names_are_needed_and_a_map_gives_others():
    other = text([f"{i},1.0,50,0,3" for i in range(200)]).replace(b"position", b"Weg")
    with pytest.raises(DataError, match=r"(?s)no column 'position'.*give a channel map with --map"):
        list(text_blocks(iter([other]), "live", None, 1.1e5, NEEDED))
    named = ("time", "duty_supply", "duty_exhaust")
    channels = ChannelMap({"position": Channel("Weg", sign=-1.0), **{name: Channel(name) for name in named}})
    _, columns = whole(text_blocks(iter([other]), "live", channels, 1.1e5, NEEDED))
    assert set(columns["position"]) == {-1e-3}


def test_only_lines_without_a_time_are_no_recording():
    with pytest.raises(DataError, match="ended before the first sample with a time"):
        list(text_blocks(iter([text([",1,0,0,3"] * 9)]), "live", None, 1.1e5, NEEDED))
