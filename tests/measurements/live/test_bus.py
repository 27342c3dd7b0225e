"""A bus while its frames arrive: which messages there are, and nothing lost between two looks at it."""

import time
from threading import Event

import can
import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.log import Log
from clutchid.measurements.live import bus as module
from clutchid.measurements.live.bus import bus_blocks, from_bus
from clutchid.measurements.live.bus_name import BusName
from clutchid.measurements.map.channel_map import Channel, ChannelMap
from fixtures.bus import CLUTCH, DBC, frames_of, message, sending
from fixtures.commands import wait_for

NAME = BusName("virtual", "test")
NEEDED = ("time", "position", "duty_supply", "duty_exhaust")
MAP = ChannelMap({
    "position": Channel("Travel"), "duty_supply": Channel("Supply", unit="1"),
    "duty_exhaust": Channel("Exhaust", unit="1"),
})  # fmt: skip


@pytest.fixture(autouse=True)
def _everybody_has_left():
    """The bus is closed when the next test begins, which would send to who is about to leave and wait for ever."""
    yield
    wait_for(lambda: "test" not in can.interfaces.virtual.channels, 10.0)


def ramp(seconds):
    time = np.arange(round(1e3 * seconds)) * 1e-3
    return Log(time, {"position": 1e-3 * time, "duty_supply": 0.1 + 0.0 * time, "duty_exhaust": 0.0 * time})


def received(messages):
    stop = Event()
    thread = sending("test", messages, stop.set)
    blocks = list(from_bus(NAME, stop.is_set))
    thread.join()
    return blocks


def recorded(frames, tmp_path, channels=MAP):
    (tmp_path / "bus.dbc").write_text(DBC)
    blocks = bus_blocks(iter(frames), "test", [tmp_path / "bus.dbc"], channels, 1e5, NEEDED)
    logs = [block.log for block in blocks]
    return {name: np.concatenate([log[name] for log in logs]) for name in logs[0].columns}


def test_all_frames_arrive_in_order_and_the_bus_is_closed():
    sent = [message(*frame) for frame in frames_of(ramp(2.0))]
    blocks = received(sent)
    assert np.concatenate([block.stamp for block in blocks]).tolist() == [block.timestamp for block in sent]
    payloads = [bytes(row) for block in blocks for row in block.data]
    assert payloads == [bytes(block.data).ljust(8, b"\0") for block in sent]
    assert "test" not in can.interfaces.virtual.channels


def test_a_silent_bus_ends_when_it_is_stopped():
    stop = Event()
    frames = from_bus(NAME, stop.is_set)
    stop.set()
    assert list(frames) == []


@pytest.mark.slow
def test_more_frames_than_can_wait_stay_with_the_bus(monkeypatch):
    monkeypatch.setattr(module, "MOST_WAITING", 50)
    stop = Event()
    frames = from_bus(NAME, stop.is_set)
    sent = [message(*frame) for frame in frames_of(ramp(1.0))]
    thread = sending("test", sent[:1])
    first = next(frames)
    thread.join()
    with can.Bus("test", interface="virtual", preserve_timestamps=True) as other:
        for block in sent[1:]:
            other.send(block)
        time.sleep(0.5)  # nobody takes them
        stop.set()
        rest = list(frames)
    assert len(first) == 1
    assert len(rest[0]) == 50
    assert np.concatenate([block.stamp for block in rest]).tolist() == [block.timestamp for block in sent[1:]]


def test_a_message_that_begins_late_is_waited_for_and_its_samples_before_are_missing(tmp_path):
    frames = [frame for frame in frames_of(ramp(4.0)) if frame[1] == CLUTCH or frame[0] > 3.0]
    columns = recorded(received([message(*frame) for frame in frames]), tmp_path)
    assert columns["position"].size == 4000
    missing = np.isnan(columns["duty_supply"])
    assert missing[:1990].all()
    assert not missing[2010:].any()


def test_a_message_that_does_not_come_is_said_after_ten_seconds(tmp_path):
    frames = [frame for frame in frames_of(ramp(12.0)) if frame[1] == CLUTCH][::10]
    blocks = received([message(*frame) for frame in frames])
    with pytest.raises(DataError, match="duty_supply: there is no channel 'Supply'"):
        recorded(blocks, tmp_path)


def test_a_pressure_of_the_map_that_does_not_come_is_done_without(tmp_path):
    blocks = received([message(*frame) for frame in frames_of(ramp(4.0))[::4]])
    with_pressure = ChannelMap({**MAP.channels, "pressure_a": Channel("Druck", unit="bar")})
    columns = recorded(blocks, tmp_path, with_pressure)
    assert sorted(columns) == sorted(NEEDED[1:])
    assert columns["position"].size == recorded(blocks, tmp_path)["position"].size


def test_without_a_map_the_signals_need_standard_names(tmp_path):
    blocks = received([message(*frame) for frame in frames_of(ramp(1.5))])
    with pytest.raises(DataError, match=r"(?s)no channel is assigned to position.*give a channel map with --map"):
        recorded(blocks, tmp_path, None)


def test_a_bus_is_closed_when_nobody_wants_its_frames_any_more(monkeypatch):
    monkeypatch.setattr(module, "MOST_WAITING", 5)
    frames = from_bus(NAME, lambda: False)
    thread = sending("test", [message(*frame) for frame in frames_of(ramp(0.5))])
    next(frames)
    thread.join()
    frames.close()
    assert "test" not in can.interfaces.virtual.channels
