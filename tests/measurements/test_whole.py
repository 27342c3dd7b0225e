"""What a file says of its own size decides whether it is read as a whole; in pieces any size is read."""

import numpy as np
import polars as pl
import pytest

from clutchid.errors import DataError
from clutchid.log import Log
from clutchid.measurements import opening as guard
from clutchid.measurements import read, read_pieces, write
from clutchid.measurements.conversion import pieces
from clutchid.measurements.look import look
from clutchid.measurements.map.channel_map import Channel, ChannelMap

ROWS = 4_000_000


@pytest.fixture
def small_limit(monkeypatch):
    """At most 120 MB of values are read as a whole, by a reader process that no other file has made larger."""
    monkeypatch.setattr(guard, "_current", [])
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", "300MB")


@pytest.fixture
def compact(tmp_path):
    """A Parquet file of little size on the disk, whose rows take 128 MB."""
    path = tmp_path / "compact.parquet"
    columns = {f"{name} [1]": pl.zeros(ROWS, eager=True) for name in ("duty_supply", "duty_exhaust")}
    time = pl.arange(ROWS, eager=True, dtype=pl.Int64)
    pl.DataFrame({"time [ms]": time, "position [m]": columns["duty_supply [1]"], **columns}).write_parquet(path)
    return path


@pytest.mark.usefixtures("small_limit")
def test_a_file_is_refused_by_its_own_description_before_a_sample_is_read(compact, monkeypatch):
    ask = guard.ReaderProcess.ask
    questions = []
    monkeypatch.setattr(
        guard.ReaderProcess, "ask", lambda *arguments: questions.append(arguments[1]["do"]) or ask(*arguments)
    )
    with pytest.raises(DataError) as caught:
        read(compact)
    assert str(caught.value) == (
        f"{compact}: its 4,000,000 samples of 4 channels take 0.128 GB in memory, more than the 0.12 GB that "
        "clutchid reads as a whole; cut out the part that you need with `clutchid cut`, or allow more with the "
        "environment variable CLUTCHID_READER_MEMORY=1GB."
    )
    assert questions == ["open"]


@pytest.mark.usefixtures("small_limit")
def test_in_pieces_a_file_of_any_size_is_read_and_looked_at(compact):
    assert sum(map(len, read_pieces(compact, rows=1 << 19))) == ROWS
    assert look(compact).rasters[0].samples == ROWS


def test_what_the_message_advises_is_enough(compact, monkeypatch):
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", "1GB")
    assert len(read(compact)) == ROWS


def test_a_large_file_of_many_bytes_is_no_exception(tmp_path, monkeypatch):
    path = tmp_path / "noise.csv"
    noise = np.random.default_rng(1).uniform(0.0, 1.0, 20_000)
    write(Log(np.arange(noise.size) * 1e-3, dict.fromkeys(("position", "duty_supply", "duty_exhaust"), noise)), path)
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", "1MB")
    with pytest.raises(DataError, match=r"20,000 samples of 4 channels take 0\.00064 GB .* reads as a whole"):
        read(path)


def test_only_the_time_grids_that_the_map_selects_count(source, monkeypatch):
    fast, slow = np.arange(100_000) / 1e5, np.arange(100) / 100
    made = source({"t": ("s", fast), "Ton": ("1", fast)}, {"t": ("s", slow), "Weg": ("mm", slow)})
    monkeypatch.setenv("CLUTCHID_READER_MEMORY", "1MB")
    (log,) = pieces(made, ChannelMap({"position": Channel("Weg")}), 1e5, ("position",), None)
    assert len(log) == 100
    with pytest.raises(DataError, match=r"100,000 samples of 2 channels take 0\.0016 GB"):
        list(pieces(made, ChannelMap({"position": Channel("Ton", unit="mm")}), 1e5, ("position",), None))
