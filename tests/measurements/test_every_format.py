"""Laws of all formats: tables of any size are the whole, and a library that is missing is named."""

import sys

import numpy as np
import pytest

from clutchid.errors import MissingExtra
from clutchid.measurements.formats.opening import opened_here
from fixtures.sources import joined, tables_of


def opened(file):
    """The source of a file and its channel map."""
    path, channels = file
    return opened_here(path, channels.dbc if channels else ())


@pytest.mark.parametrize("kind", ["csv", "parquet", "mf4", "mat", "mat73", "blf", "asc", "trc"])
def test_tables_of_any_size_are_the_whole_in_pieces_that_count_on(fuzz, tmp_path, kind):
    source = opened(fuzz.good_file(kind, tmp_path))
    for index, raster in enumerate(source.rasters):
        (whole,) = tables_of(source, None, index)
        assert (whole.size, whole.places.number(0)) == (raster.size, 2 if kind == "csv" else 1)
        for rows in (1, 7, raster.size + 1):
            tables = tables_of(source, rows, index)
            assert [table.size for table in tables[:-1]] == [rows] * (len(tables) - 1)
            places = [table.places.number(row) for table in tables for row in range(table.size)]
            assert places == [whole.places.number(row) for row in range(whole.size)]
            for column, values in joined(tables).items():
                assert np.array_equal(values, whole.numbers[column], equal_nan=True)
        last = len(raster.headings) - 1
        (only,) = source.tables(index, [last])
        assert list(only.numbers) == [last]
        assert np.array_equal(only.numbers[last], whole.numbers[last], equal_nan=True)


@pytest.mark.parametrize(
    ("kind", "module", "requirement"),
    [
        ("mf4", "asammdf", "asammdf<9,>=8.8"), ("mat73", "h5py", "h5py>="), ("blf", "can", "python-can>="),
        ("asc", "cantools.database", "python-can>="),
    ],
)  # fmt: skip
def test_a_missing_library_is_named_with_the_command_that_installs_it(
    fuzz, tmp_path, monkeypatch, kind, module, requirement
):
    file = fuzz.good_file(kind, tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtra, match=rf"which is not installed; .* -m pip install .*\"{requirement}"):
        opened(file)
