"""One recording with each trouble of a clock, read as a file and followed on line: the same stamps and samples."""

import re

import numpy as np
import pytest

from clutchid.log import Log
from clutchid.measurements import read
from clutchid.measurements.formats.can.frames import frame_of, in_blocks
from clutchid.measurements.live.arrival import ORIGIN
from clutchid.measurements.live.bus import bus_blocks
from clutchid.measurements.live.text import text_blocks
from clutchid.measurements.map.channel_map import Channel, ChannelMap
from fixtures.bus import DBC, frames_of, message

NEEDED = ("time", "position", "duty_supply", "duty_exhaust")
MAP = ChannelMap({
    "position": Channel("Travel"), "duty_supply": Channel("Supply", unit="1"),
    "duty_exhaust": Channel("Exhaust", unit="1"),
})  # fmt: skip

#: True stamps in s; position and duty cycles are ramps, so that each sample says when it was taken.
TIME = np.arange(3000) * 1e-3


def lone(stamps, *places, by):
    stamps = stamps.copy()
    stamps[list(places)] += by
    return stamps


def moved(stamps, begin, end, by):
    return stamps + by * ((stamps >= begin) & (stamps < end))


#: Stamps as they are written, by trouble, and what is said of the repair, empty where samples are only counted.
TROUBLES = {
    "counter of 16 bits": (lambda t: np.round((t + 64.0) % 65.536, 6), "16 bits wraps.* 65.536 s are corrected"),
    "counter of 32 bits": (lambda t: np.round((t + 4294.0) % 4294.967296, 6), "32 bits wraps.* 4294.967296 s are"),
    "midnight": (lambda t: np.round((t + 86399.0) % 86400.0, 6), "midnight passes"),
    "restart": (lambda t: np.where(t < 1.5, t + 7.0, t - 1.5), "restarts at .*each run becomes a separate segment"),
    "two restarts": (lambda t: np.round((t + 7.0) % 1.0, 6) + 5.0, "restarts at"),
    "jump ahead": (lambda t: moved(t, 1.5, 9.0, 3600.0), ""),
    "short jump ahead": (lambda t: moved(t, 1.5, 1.6, 3600.0), "jumps at .* is moved by -3[56]"),
    "short jump back": (lambda t: moved(t + 9.0, 10.5, 10.6, -4.0), "jumps at .* is moved by 4"),
    "lone ahead": (lambda t: lone(t, 500, 1501, by=60.0), ""),
    "two ahead": (lambda t: lone(t, 1500, 1501, by=0.5), ""),
    "lone behind": (lambda t: lone(t + 9.0, 1500, by=-5.0), ""),
    "jitter": (lambda t: t + np.round(np.random.default_rng(3).uniform(-4e-4, 4e-4, t.size), 6), ""),
}  # fmt: skip


RAMPS = Log(TIME, {"position": 1e-3 * TIME, "duty_supply": 0.2 * TIME, "duty_exhaust": 0.9 - 0.2 * TIME})


def joined(blocks):
    blocks = list(blocks)
    columns = {name: np.concatenate([block.log[name] for block in blocks]) for name in NEEDED[1:]}
    columns["time"] = np.concatenate([block.log.time for block in blocks])
    said = [sentence for block in blocks for sentence in block.log.warnings]
    return columns, said, np.sum([block.left_out for block in blocks], axis=0), blocks[-1].log.metadata


def check(log, columns, said, words):
    assert columns["time"] == pytest.approx(log.time, abs=1e-6)
    for name in NEEDED[1:]:
        assert np.array_equal(columns[name], log[name], equal_nan=True), name
    assert bool(words) == any("clock" in sentence for sentence in said)
    if words:
        assert any(re.search(words, sentence) for sentence in said), said


def lines_of(trouble):
    """Header and samples as lines of text."""
    rows = zip(TROUBLES[trouble][0](TIME), TIME, strict=True)
    samples = [f"{t:.6f},{1e-3 * y:.7f},{0.2 * y:.5f},{0.9 - 0.2 * y:.5f}\n".encode() for t, y in rows]
    return [b"time [s],position [m],duty_supply [1],duty_exhaust [1]\n", *samples]


def followed(lines, **options):
    return joined(text_blocks(iter([b"".join(lines)]), "run", None, 1e5, NEEDED, **options))


@pytest.mark.parametrize("size", [40, 3001])
@pytest.mark.parametrize("trouble", TROUBLES)
def test_a_text_has_the_stamps_of_the_file(trouble, size, tmp_path):
    _, words = TROUBLES[trouble]
    text = b"".join(lines_of(trouble))
    (tmp_path / "run.csv").write_bytes(text)
    pieces = (text[begin : begin + 33 * size] for begin in range(0, len(text), 33 * size))
    columns, said, _, _ = joined(text_blocks(pieces, "run", None, 1e5, NEEDED))
    check(read(tmp_path / "run.csv"), columns, said, words)


@pytest.mark.parametrize("count", [1100, 2200])
@pytest.mark.parametrize("trouble", TROUBLES)
def test_a_text_that_is_stopped_goes_on_from_the_origin_of_its_time(trouble, count):
    lines = lines_of(trouble)
    first, _, _, metadata = followed(lines[: count + 1])
    origin = float(metadata[ORIGIN]) if ORIGIN in metadata else None
    rest, _, _, _ = followed([lines[0], *lines[count + 1 :]], origin=origin)
    whole, _, _, _ = followed(lines)
    for name, values in whole.items():
        assert np.array_equal(np.append(first[name], rest[name]), values), name


@pytest.mark.parametrize("size", [40, 5000])
@pytest.mark.parametrize("trouble", TROUBLES)
def test_a_bus_has_the_stamps_of_the_log(trouble, size, tmp_path):
    stamped, words = TROUBLES[trouble]
    frames = frames_of(RAMPS)
    frames = sorted([*frames, *((1.0 + 9e-4 * i - 1e-4, 0x700, b"\1\2") for i in range(3300))])  # which no DBC knows
    stamps = np.array([stamp for stamp, *_ in frames]) - 1.0 + 3e-4
    frames = [(t, *rest) for t, (_, *rest) in zip(stamped(stamps).tolist(), frames, strict=True)]
    (tmp_path / "bus.dbc").write_text(DBC)
    path = tmp_path / "bus.log"
    path.write_text("".join(f"({1.7e9 + t:.6f}) can0 {name:03X}#{data.hex().upper()}\n" for t, name, data in frames))
    messages = [frame_of(message(1.7e9 + round(t, 6), name, data)) for t, name, data in frames]
    pieces = (block for begin in range(0, len(messages), size) for block in in_blocks(messages[begin : begin + size]))
    blocks = bus_blocks(pieces, "bus", [tmp_path / "bus.dbc"], MAP, 1e5, NEEDED)
    columns, said, _, metadata = joined(blocks)
    check(read(path, channels=MAP, dbc=[tmp_path / "bus.dbc"]), columns, said, words)
    last = columns["time"][-1] + float(metadata[ORIGIN])
    assert last == pytest.approx(1.7e9 + frames[-1][0], abs=1e-5)
    assert all("frame" in sentence and "sample" not in sentence for sentence in said if "clock" in sentence)
