"""``clutchid observe can:CHANNEL``: a virtual truck on a virtual bus, with the numbers of its log file bit by bit."""

import json
import os
import random
import re
import signal
import sys
import threading

import can
import polars as pl
import pytest

from clutchid.estimation.parameter_file import ParameterFile, write_parameters
from clutchid.measurements.formats.can.file import frame_log
from clutchid.observer.health import LIVE_FLAGS
from clutchid.truck import drive, truck
from fixtures.bus import CLUTCH, DBC, MAP, frames_of, message, sending, write_log
from fixtures.commands import called


@pytest.fixture(scope="module")
def folder(tmp_path_factory, plant):
    """A calibration, DBC and map, a bus log of a virtual truck, and what is observed in the log."""
    made = tmp_path_factory.mktemp("bus")
    write_parameters(ParameterFile(plant), made / "cal.toml")
    (made / "bus.dbc").write_text(DBC)
    (made / "map.toml").write_text(MAP)
    log = drive(truck(7), seconds=6.0, seed=3).log
    write_log(made / "truck.blf", frames_of(log))
    assert observed(made, str(made / "truck.blf"), "--out", str(made / "file.parquet")) == 0
    return made


def observed(folder, log, *options):
    words = ("--start", folder / "cal.toml", "--dbc", folder / "bus.dbc", "--map", folder / "map.toml")
    return called("observe", log, *words, *options)


@pytest.fixture
def messages(folder):
    """The frames of the log as messages with the stamps of the file."""
    frames = []
    for block in frame_log(folder / "truck.blf").blocks():
        rows = zip(block.stamp.tolist(), block.identifier.tolist(), block.data, block.length.tolist(), strict=True)
        frames += [message(stamp, identifier, bytes(data[:length])) for stamp, identifier, data, length in rows]
    return frames


@pytest.fixture
def call(folder, tmp_path, monkeypatch, capsys):
    """Observe what is sent on a virtual bus; exit code, output and errors."""
    monkeypatch.chdir(tmp_path)

    def run(sent, *options, bus="can:virtual:truck"):
        sender = sending("truck", sent, lambda: os.kill(os.getpid(), signal.SIGTERM))
        code = observed(folder, bus, "--out", "est.parquet", *options)
        sender.join()
        said, errors = capsys.readouterr()
        return code, said, " ".join(errors.split())

    return run


def same(folder, tmp_path):
    for live, file in (("est.parquet", "file.parquet"), ("est.load.parquet", "file.load.parquet")):
        assert pl.read_parquet(tmp_path / live).equals(pl.read_parquet(folder / file), null_equal=True), file


@pytest.mark.slow
def test_a_truck_on_a_bus_gives_the_numbers_of_its_log_bit_for_bit(call, folder, tmp_path, messages):
    code, said, errors = call(messages)
    assert (code, errors) == (0, "")
    assert said.startswith("observed truck: load at 12.5 mm ")
    assert "no flags" in said.splitlines()[0]
    assert pl.read_parquet(tmp_path / "est.parquet").height == 6000
    same(folder, tmp_path)


@pytest.mark.slow
def test_frames_that_come_out_of_order_are_put_in_their_place(call, folder, tmp_path, messages):
    order = random.Random(1)
    mixed = sorted(messages, key=lambda frame: frame.timestamp + order.uniform(0.0, 0.02))
    first = min(range(len(mixed)), key=lambda i: mixed[i].timestamp)
    mixed.insert(0, mixed.pop(first))  # the first frame is the origin of time
    assert [frame.timestamp for frame in mixed] != [frame.timestamp for frame in messages]
    code, _, errors = call(mixed)
    assert (code, errors) == (0, "")
    same(folder, tmp_path)


def test_lost_late_and_damaged_frames_are_flags(call, folder, tmp_path, messages):
    clutch = [i for i, message in enumerate(messages) if message.arbitration_id == CLUTCH]
    sent = [message for i, message in enumerate(messages) if i not in {clutch[2000], clutch[3000]}]
    sent.insert(clutch[3200], messages[clutch[3000]])
    sent.insert(500, can.Message(timestamp=messages[500].timestamp, is_error_frame=True))
    sent.insert(clutch[4000], messages[clutch[4000]])
    code, said, _ = call(sent, "--json")
    health = json.loads(said)["health"]
    assert code == 0
    raised = {name: health[name] for name in (*LIVE_FLAGS, "repeated") if health[name] > 0.0}
    assert raised == pytest.approx({"lost": 2e-3, "late": 1e-3, "unreadable": 1e-3, "repeated": 1e-3})
    assert pl.read_parquet(tmp_path / "est.parquet").height == 5998


@pytest.mark.slow
def test_a_bus_is_followed_on_from_a_state_with_its_own_clock(call, folder, tmp_path, messages):
    assert call(messages, "--save", "whole.toml")[0] == 0
    assert call(messages[:5000], "--save", "state.toml")[0] == 0
    first = [pl.read_parquet(tmp_path / name) for name in ("est.parquet", "est.load.parquet")]
    half = first[0].height
    clutch = [i for i, message in enumerate(messages) if message.arbitration_id == CLUTCH]
    rest = messages[clutch[half - 1] + 1 :]
    valves = [message for message in messages[: clutch[half]] if message.arbitration_id != CLUTCH][-1]
    code, _, errors = call([valves, *rest], "--save", "state.toml", "--resume", "state.toml")
    assert (code, errors) == (0, "")
    for rows, suffix in zip(first, (".parquet", ".load.parquet"), strict=True):
        both = [rows, pl.read_parquet(tmp_path / f"est{suffix}")]
        assert pl.concat(both).equals(pl.read_parquet(folder / f"file{suffix}"), null_equal=True)
    assert (tmp_path / "state.toml").read_text() == (tmp_path / "whole.toml").read_text()


@pytest.mark.slow
def test_a_bus_that_fails_ends_the_recording_and_what_came_before_is_written(
    call, folder, tmp_path, messages, monkeypatch
):
    receive, left = can.BusABC.recv, len(messages)

    def fail(bus, timeout=None):
        nonlocal left
        if not left:  # a sender that is held up is not the end: only the count of the frames is
            raise can.CanOperationError("Network is down")
        if (frame := receive(bus, timeout)) is not None:
            left -= 1
        return frame

    monkeypatch.setattr(can.BusABC, "recv", fail)
    monkeypatch.setattr(os, "kill", lambda *_: None)
    code, said, errors = call(messages)
    assert code == 2
    assert "can:virtual:truck: failed (Network is down)" in errors
    assert said.startswith("observed truck: ")
    same(folder, tmp_path)


@pytest.mark.parametrize(
    ("bus", "options", "words"),
    [
        ("can:nosuch:bus", (), r"can:nosuch:bus: cannot be opened.* such as can:can0"),
        ("can:nosuchcan9", (), r"can:socketcan:nosuchcan9: cannot be opened.* such as can:can0"),
        (
            "can:virtual:truck",
            ("--dbc", "missing.dbc"),
            r"clutchid: missing.dbc: there is no such file; check its name.$",
        ),
    ],
)
def test_a_bus_or_a_dbc_that_is_not_there_is_one_sentence(folder, tmp_path, monkeypatch, capsys, bus, options, words):
    monkeypatch.chdir(tmp_path)
    assert observed(folder, bus, "--out", "est.parquet", *options) == 2
    assert re.search(words, " ".join(capsys.readouterr().err.split()))
    assert list(tmp_path.iterdir()) == []


def test_without_a_dbc_or_with_another_one_there_is_one_sentence(call, folder, tmp_path, messages, capsys):
    before = set(threading.enumerate())  # other tests of this process may have left some
    assert called("observe", "can:virtual:truck", "--start", folder / "cal.toml", "--out", "est.parquet") == 2
    assert "give its DBC with --dbc FILE" in " ".join(capsys.readouterr().err.split())
    other = [message(frame.timestamp, 0x555, bytes(8)) for frame in messages]
    code, _, errors = call(other)
    assert code == 2
    assert "truck: no frame that the DBC defines has arrived" in errors
    assert list(tmp_path.iterdir()) == []
    assert not set(threading.enumerate()) - before
    assert "can" in sys.modules
