"""A recording that is written while it grows."""

import numpy as np
import polars as pl
import pytest

from clutchid.errors import ExportError
from clutchid.io import read, write
from clutchid.io import spool as module
from clutchid.io.spool import spooled
from clutchid.log import Log


@pytest.fixture
def log():
    rng = np.random.default_rng(2)
    position = rng.standard_normal(1000)
    position[5] = np.nan
    duty = {name: np.zeros(1000) for name in ("duty_supply", "duty_exhaust")}
    return Log(np.arange(1000) * 1e-3, {"position": position, **duty}, "run", {"source": "here"})


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
@pytest.mark.parametrize(("piece", "blocks"), [(100, 64), (1 << 16, 64), (1 << 16, 2), (1600, 3)])
def test_it_is_the_file_that_is_written_at_once(tmp_path, log, suffix, piece, blocks, monkeypatch):
    monkeypatch.setattr(module, "PIECE", piece)
    monkeypatch.setattr(module, "BLOCKS", blocks)
    write(log, tmp_path / f"whole{suffix}")
    with spooled(tmp_path / f"live{suffix}") as add:
        for begin, end in ((0, 0), (0, 333), (333, 333), (333, 420), (420, 1000)):
            add(log.slice(begin, end))
            assert not (tmp_path / f"live{suffix}").exists()
    if suffix == ".csv":
        assert (tmp_path / "live.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    frames = [getattr(pl, f"read_{suffix[1:]}")(tmp_path / f"{name}{suffix}") for name in ("live", "whole")]
    assert frames[0].equals(frames[1], null_equal=True)
    assert len(list(tmp_path.iterdir())) == 2
    if suffix == ".parquet":
        assert read(tmp_path / "live.parquet").metadata["source"] == "live.parquet"
        assert pl.read_parquet_metadata(tmp_path / "live.parquet")["clutchid"] == '{"source": "here"}'


def test_a_recording_without_samples_has_its_columns(tmp_path, log):
    with spooled(tmp_path / "none.parquet") as add:
        add(log.slice(0, 0))
    assert pl.read_parquet(tmp_path / "none.parquet").columns[0] == "time [s]"


def stopped(path, log, error):
    with spooled(path) as add:
        add(log)
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_after_an_error_what_was_there_is_unchanged_and_nothing_is_left(tmp_path, log, suffix, error):
    (tmp_path / f"live{suffix}").write_text("before")
    with pytest.raises(error):
        stopped(tmp_path / f"live{suffix}", log, error)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(f"live{suffix}", "before")]


def test_other_formats_are_refused(tmp_path):
    with pytest.raises(ExportError, match=r"written as \.parquet or \.csv"), spooled(tmp_path / "live.mf4"):
        pass
