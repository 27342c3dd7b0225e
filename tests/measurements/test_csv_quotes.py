"""Quoted cells with separators, quotes and line breaks, against the csv module of Python; columns of one name."""

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from clutchid.measurements.columns import distinct, headings
from clutchid.measurements.conversion import pieces
from clutchid.measurements.formats.csv import file as csv_file
from clutchid.measurements.formats.csv.file import open_file
from clutchid.measurements.map.channel_map import Channel, ChannelMap
from fixtures.sources import everything


def columns_of(path, rows=None):
    """Headings, values by column, and lines of the samples."""
    source, tables, columns = everything(open_file(path), rows)
    texts = [heading.text for heading in source.rasters[0].headings]
    return texts, columns, [t.places.number(i) for t in tables for i in range(t.size)]


def number(cell):
    try:
        return float(cell)
    except ValueError:
        return np.nan


def test_the_files_of_csv_spectrum_are_read_as_the_csv_module_reads_them(data):
    for path in sorted(data("foreign_files/csv").glob("csv-spectrum_*.csv")):
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        texts, values, _ = columns_of(path)
        assert texts == [" ".join(cell.split()) for cell in header], path.name
        expected = [[number(cell) for cell in column] for column in zip(*rows, strict=True)]
        np.testing.assert_array_equal(values, expected, err_msg=path.name)


cells = st.text(alphabet='ab1.,;|"\n', max_size=6)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(
    notes=st.lists(cells, min_size=1, max_size=12),
    name=cells.map(lambda text: f"piston {text}"),
    separator=st.sampled_from([",", ";", "\t"]),
    rows=st.sampled_from([None, 1, 3]),
    small=st.booleans(),
)
def test_numbers_beside_any_quoted_text_are_read_exactly(tmp_path_factory, notes, name, separator, rows, small):
    path = tmp_path_factory.mktemp("quotes") / "run.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, delimiter=separator, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\n")
        writer.writerow(["time [s]", name, "position [mm]"])
        writer.writerows([i / 8, note, i + 0.5] for i, note in enumerate(notes))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(csv_file, "_SMALL", 1e9 * small)
        texts, values, _ = columns_of(path, rows)
    assert texts == ["time [s]", " ".join(name.split()), "position [mm]"]
    np.testing.assert_array_equal(values[0], np.arange(len(notes)) / 8)
    np.testing.assert_array_equal(values[2], np.arange(len(notes)) + 0.5)


def test_of_columns_of_one_name_a_map_selects_each(save):
    source = open_file(save("time [s],Weg [mm],Weg [mm],Weg [mm] (2)\n0,1,10,100\n1,2,20,200\n"))
    for text, last in zip(("Weg [mm]", "Weg [mm] (2)", "Weg [mm] (2) (2)"), (2e-3, 2e-2, 2e-1), strict=True):
        chosen = ChannelMap({"position": Channel(text, unit="mm")})
        (log,) = pieces(source, chosen, 1e5, ("time",), None)
        assert log["position"][-1] == pytest.approx(last)


def test_many_columns_of_one_name_are_told_apart_at_once():
    columns = distinct(headings(["x"] * 10_000))
    assert len({column.text for column in columns}) == 10_000
    assert columns[-1].text == "x (10000)"
