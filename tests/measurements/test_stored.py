"""A source copied to columns: what is read from the copy is what the file has."""

import numpy as np
import pytest

from clutchid.measurements import read_pieces, source_pieces
from clutchid.measurements.look import look, overview_of
from clutchid.measurements.opening import open_source
from clutchid.measurements.stored import BIN, column_of, extremes_of, store, stored, write_column

#: Samples of a block.
BLOCK = 1000


@pytest.mark.parametrize("cells", [{}, {(1, 4): "", (2, 1): "x", (900, 2): "7"}], ids=["good", "with problems"])
def test_look_says_the_same_of_the_copy_as_of_the_file(recording, save, tmp_path, cells):
    path = save(recording(1000, cells))
    copied = store(open_source(path), tmp_path / "columns", BLOCK)
    assert overview_of(copied, None, (), None) == look(path)
    assert overview_of(stored(tmp_path / "columns"), None, (), None) == look(path)


def test_a_log_of_the_copy_has_the_numbers_of_the_file_however_it_is_cut(recording, save, tmp_path):
    path = save(recording(700, {(5, 4): ""}))
    copied = store(open_source(path), tmp_path / "columns", BLOCK)
    for rows in (None, 256):
        logs = zip(source_pieces(copied, rows=rows), read_pieces(path, rows=rows), strict=True)
        for log, other in logs:
            assert np.array_equal(log.time, other.time)
            assert log.warnings == other.warnings
            assert all(np.array_equal(log[name], other[name], equal_nan=True) for name in other.columns)


def test_a_large_time_grid_is_copied_in_blocks_and_says_how_far_it_is(source, tmp_path, monkeypatch):
    monkeypatch.setattr("clutchid.measurements.stored.WHOLE", 0)
    time, values, counts = np.arange(2500) / 1e3, np.sin(np.arange(2500)), []
    store(
        source({"t": ("s", time), "x": ("mm", values)}), tmp_path, BLOCK,
        progress=lambda samples, size: counts.append((samples, size)),
    )  # fmt: skip
    assert counts == [(1000, 2500), (2000, 2500), (2500, 2500)]
    assert np.array_equal(column_of(tmp_path, 0, 1).read(0, 2500), values)


def test_the_least_and_greatest_values_of_a_bin_lie_beside_the_column(tmp_path):
    values = np.random.default_rng(1).standard_normal(BIN * 5 + 3)
    values[BIN : 2 * BIN], values[7] = np.nan, np.inf
    write_column(tmp_path, 0, 3, values)
    column = column_of(tmp_path, 0, 3)
    extremes = column.extremes(0, 6)
    assert column.size == values.size
    assert extremes.shape == (6, 2)
    assert np.isnan(extremes[1]).all()
    finite = [
        part[np.isfinite(part)] for part in np.split(values, range(BIN, values.size, BIN)) if np.isfinite(part).any()
    ]
    assert extremes[[0, 2, 3, 4, 5]] == pytest.approx(np.array([[part.min(), part.max()] for part in finite]))
    assert np.array_equal(column.extremes(2, 4), extremes[2:4])


def test_no_values_have_no_extremes():
    assert extremes_of(np.empty(0), 4).shape == (0, 2)
