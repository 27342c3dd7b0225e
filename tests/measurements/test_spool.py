"""A recording that is written while it grows."""

import resource
import shutil
from contextlib import contextmanager
from itertools import chain, repeat
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from clutchid.errors import ExportError
from clutchid.log import Log
from clutchid.measurements import read, write
from clutchid.measurements import spool as module
from clutchid.measurements.spool import recovered, spooled


@pytest.fixture
def log():
    rng = np.random.default_rng(2)
    position = rng.standard_normal(1000)
    position[5] = np.nan
    duty = {name: np.zeros(1000) for name in ("duty_supply", "duty_exhaust")}
    return Log(np.arange(1000) * 1e-3, {"position": position, **duty}, "run", {"source": "here"})


@pytest.fixture(params=[".parquet", ".csv"])
def suffix(request):
    return request.param


def read_frame(path):
    return pl.read_csv(path) if path.suffix == ".csv" else pl.read_parquet(path)


@pytest.mark.parametrize(("piece", "blocks"), [(100, 64), (1 << 16, 64), (1 << 16, 2), (1600, 3)])
def test_it_is_the_file_that_is_written_at_once(tmp_path, log, suffix, piece, blocks, monkeypatch):
    monkeypatch.setattr(module, "PIECE", piece)
    monkeypatch.setattr(module, "_BLOCKS", blocks)
    write(log, tmp_path / f"whole{suffix}")
    with spooled(tmp_path / f"live{suffix}") as add:
        for begin, end in ((0, 0), (0, 333), (333, 333), (333, 420), (420, 1000)):
            add(log.slice(begin, end))
            assert not (tmp_path / f"live{suffix}").exists()
    if suffix == ".csv":
        assert (tmp_path / "live.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    frames = [read_frame(tmp_path / f"{name}{suffix}") for name in ("live", "whole")]
    assert frames[0].equals(frames[1], null_equal=True)
    assert len(list(tmp_path.iterdir())) == 2
    if suffix == ".parquet":
        assert read(tmp_path / "live.parquet").metadata["source"] == "live.parquet"
        assert pl.read_parquet_metadata(tmp_path / "live.parquet")["clutchid"] == '{"source": "here"}'


def test_a_recording_without_samples_has_its_columns(tmp_path, log):
    with spooled(tmp_path / "none.parquet") as add:
        add(log.slice(0, 0))
    assert pl.read_parquet(tmp_path / "none.parquet").columns[0] == "time [s]"


def torn(content):
    """The pieces of a file of which the last is not whole: it is cut, holds what was never written, or other bytes."""
    return [content[:-1], content[:-9] + bytes(9), content[:-9] + b"clutch is", content + bytes(4096)]


@pytest.mark.parametrize("number", [None, 0, 1, 2, 3])
def test_what_a_killed_run_left_is_recovered_once_in_a_file_of_its_own(tmp_path, log, suffix, number, monkeypatch):
    monkeypatch.setattr(module, "PIECE", 600)
    (tmp_path / "killed").mkdir()
    path = tmp_path / "killed" / f"live{suffix}"
    with spooled(tmp_path / f"live{suffix}") as add:
        for begin in range(0, 900, 150):
            add(log.slice(begin, begin + 150), now=begin in (300, 750))
        assert recovered(tmp_path / f"live{suffix}") == []  # it still runs
        (folder,) = tmp_path.glob(".clutchid-live-*")
        shutil.copytree(folder, tmp_path / "killed" / folder.name)
    left = tmp_path / "killed" / folder.name / "data"
    if number is not None:
        left.write_bytes(torn(left.read_bytes())[number])
    assert recovered(tmp_path / "killed" / f"other{suffix}") == []
    (file,) = recovered(path)
    assert file.name == f"live.recovered{suffix}"
    frame = read_frame(file)
    assert frame["time [s]"].to_list() == log.time[: 900 if number in (None, 3) else 750].tolist()
    assert recovered(path) == []
    assert [entry.name for entry in path.parent.iterdir()] == [file.name]


@pytest.mark.parametrize("content", [b"", b"\0" * 4096], ids=["nothing", "zeros"])
def test_what_holds_no_piece_is_removed(tmp_path, log, content):
    with spooled(tmp_path / "live.parquet") as add:
        add(log.slice(0, 100), now=True)
        (folder,) = tmp_path.glob(".clutchid-live-*")
        shutil.copytree(folder, tmp_path / "killed" / folder.name)
    (tmp_path / "killed" / folder.name / "data").write_bytes(content)
    assert recovered(tmp_path / "killed" / "live.parquet") == []
    assert list((tmp_path / "killed").iterdir()) == []


@contextmanager
def little_room(size):
    """No file can grow beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def filled(path, log):
    """Written until the disk is full: at a piece, or at the end."""
    with spooled(path) as add:
        for begin in range(0, 1000, 100):
            with little_room(24_000):
                try:
                    add(log.slice(begin, begin + 100))
                except ExportError as error:
                    return str(error)
    return ""


def test_a_full_disk_costs_what_comes_later(tmp_path, log, suffix, monkeypatch):
    monkeypatch.setattr(module, "PIECE", 400)
    noise = {name: np.random.default_rng(1).standard_normal(1000) for name in log.columns}
    log = Log(log.time, noise, "run")
    path = tmp_path / f"live{suffix}"
    assert filled(path, log) == f"{path}: can no longer be written (File too large)."
    frame = read_frame(path)
    assert 200 <= frame.height < 1000
    assert frame["time [s]"].to_list() == log.time[: frame.height].tolist()
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_an_empty_folder_that_could_not_be_removed_is_removed_by_the_next_run(tmp_path):
    (tmp_path / ".clutchid-live-0").mkdir()
    assert recovered(tmp_path / "live.parquet") == []
    assert list(tmp_path.iterdir()) == []


def nowhere(path, _parts, _folder):
    raise ExportError(f"{path}: cannot be written.")


def test_what_can_be_written_nowhere_is_made_a_file_by_the_next_run(tmp_path, log, suffix, monkeypatch):
    path = tmp_path / f"live{suffix}"
    with monkeypatch.context() as patch:
        patch.setattr(module, "_join", nowhere)
        with pytest.raises(ExportError, match=r"written\. Its samples are in .*live-"), spooled(path, print) as add:
            add(log)
    (file,) = recovered(path)
    assert read_frame(file)["time [s]"].to_list() == log.time.tolist()
    assert [entry.name for entry in tmp_path.iterdir()] == [file.name]


def test_a_folder_that_is_removed_costs_only_the_place_of_the_file(tmp_path, log):
    (tmp_path / "out").mkdir()
    places = []
    with spooled(tmp_path / "out" / "live.parquet", places.append) as add:
        add(log.slice(0, 500))
        shutil.rmtree(tmp_path / "out")
        add(log.slice(500, 1000))
    (place,) = places
    assert pl.read_parquet(place).height == 1000
    shutil.rmtree(place.parent)


def stopped(path, log, error):
    with spooled(path) as add:
        add(log)
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_after_an_error_what_was_there_is_unchanged_and_nothing_is_left(tmp_path, log, suffix, error):
    (tmp_path / f"live{suffix}").write_text("before")
    with pytest.raises(error):
        stopped(tmp_path / f"live{suffix}", log, error)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(f"live{suffix}", "before")]


def test_memory_is_given_back_after_each_piece_where_the_system_can(tmp_path, log, monkeypatch):
    calls = []
    libraries = chain([SimpleNamespace(malloc_trim=calls.append)], repeat(SimpleNamespace()))
    monkeypatch.setattr("ctypes.CDLL", lambda _: next(libraries))
    with spooled(tmp_path / "a.parquet") as add:
        add(log.slice(0, 50), now=True)
        add(log.slice(50, 100), now=True)
    assert calls == [0]
    assert len(read(tmp_path / "a.parquet")) == 100


def test_other_formats_are_refused(tmp_path):
    with pytest.raises(ExportError, match=r"written as \.parquet or \.csv"), spooled(tmp_path / "live.mf4"):
        pass
