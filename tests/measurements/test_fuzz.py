"""Broken files of every format get a recording or one sentence; `benchmarks/fuzz.py` does the same at length."""

from __future__ import annotations

import random
from itertools import product

import numpy as np
import pytest

from clutchid.measurements.formats.csv.cells import plain_number
from clutchid.measurements.formats.csv.file import open_file

pytestmark = pytest.mark.slow


def unexpected(fuzz, answers):
    """Answers that are no words; the first case is an empty file."""
    assert answers[0] == "refused"
    return {seed: answer for seed, answer in answers.items() if answer not in ("read", "refused", *fuzz.ENDS)}


@pytest.mark.parametrize("kind", ["csv", "gz", "parquet", "mf4", "mat", "mat73", "blf", "asc"])
def test_a_file_is_read_and_answered_in_words_once_it_is_broken(fuzz, kind, tmp_path):
    path, channels = fuzz.good_file(kind, tmp_path)
    made, original = fuzz.read(path, channels=channels), fuzz.example()
    assert list(made.columns) == list(original.columns)
    if kind not in ("blf", "asc"):  # these have the resolution of their signals
        assert np.array_equal(made.time, original.time)
        for name, values in original.columns.items():
            assert np.array_equal(made[name], values, equal_nan=True)
    answers = {seed: fuzz.answered(path, channels) for seed, path, channels in fuzz.cases(kind, range(60), tmp_path)}
    assert unexpected(fuzz, answers) == {}


def test_a_log_of_can_with_a_broken_database_is_answered_in_words(fuzz, tmp_path):
    answers = {seed: fuzz.answered(path, channels) for seed, path, channels in fuzz.cases("dbc", range(120), tmp_path)}
    assert unexpected(fuzz, answers) == {}
    assert {"read", "refused"} <= set(answers.values())


def test_a_parquet_file_that_promises_samples_and_has_none_is_refused(fuzz, tmp_path):
    for _, path, channels in fuzz.cases("parquet", [7167, 7428], tmp_path):
        assert fuzz.answered(path, channels) == "refused"


#: Ways to write a table: separator and decimal mark, rows of units, and stamps at a time in s.
MARKS = [(",", "."), (";", ","), (";", "."), ("\t", ","), ("\t", "."), ("|", ".")]
UNITS = ["{} [{}]", "{} ({})", ""]
STAMPS = ["{:.3f}", "2024-05-01T12:00:{:06.3f}", "12:00:{:06.3f}", "01.05.2024 12:00:{:06.3f}", "ms"]
NAMES = ["time", "position", "duty_supply", "duty_exhaust", "pressure_a"]


def written(chance, marks, units, stamps):
    """The lines above the samples of a table of 80 rows, and its cells."""
    separator, decimal = marks
    names = list(zip(NAMES, ["ms" if stamps == "ms" else "s", "mm", "%", "%", "mbar"], strict=True))
    rows = [
        [
            f"{8 * i}" if stamps == "ms" else stamps.format(0.008 * i),
            f"{0.02 + 0.001 * i * chance.random():.3f}",
            str(chance.choice([0, 0, 50, 100])),
            str(chance.choice([0.0, 12.5, 100.0])),
            str(13 + chance.randint(0, 3000)),
        ]
        for i in range(80)
    ]
    first = 0 if stamps == "{:.3f}" else 1
    rows = [[*row[:first], *(cell.replace(".", decimal) for cell in row[first:])] for row in rows]
    head = [[units.format(*name) for name in names]] if units else [*map(list, zip(*names, strict=True))]
    return [separator.join(cells) for cells in head], rows


def ways_to_break(chance, rows, i, column):
    """The rows with row `i` broken in each way, or with its cell in a `column`; of a table as it is, first."""
    cut, group, cell = chance.randrange(1, 5), chance.choice(".,' "), rows[i][column]
    flipped = cell.replace(".", ",") if "." in cell else cell.replace(",", ".")
    cells = ["SNA", "", "1.234,5", "1,234.5", flipped, '"' + cell]
    instead = [[*rows[i][:column], text, *rows[i][column + 1 :]] for text in cells]
    instead += [rows[i][:cut], [*rows[i], "7"], [*rows[i][:4], f"1{group}013"], [rows[0][0] * (i == 0), *[""] * 4]]
    yield rows
    yield from ([*rows[:i], row, *rows[i + 1 :]] for row in instead)
    yield from ([*rows[:i], row, *rows[i:]] for row in (["# remark"], list("txyzw")))
    yield [[*row[:4], row[4] if len(row[4]) < 4 else f"{row[4][:-3]}{group}{row[4][-3:]}"] for row in rows]


def others(path, rows, i, broken, decimal):
    """Cells that are read from a broken table, not refused, and are not those of the table: row, column, value.

    A row that is broken may be missing, or have none of its values, or those that are written.
    """
    source = open_file(path)
    table = next(source.tables(0, range(5)), None)
    if table is None or source.problems or table.problems or source.unnamed:
        return None
    milliseconds = np.round(table.numbers[0] * (1000 if table.headings[0].unit == "s" else 1))
    wrong = []
    for row in range(80):
        places = np.flatnonzero(milliseconds == 8 * row)
        if len(places) != 1 and row != i:
            wrong.append((row, "rows", len(places)))
        for column in range(1, 5) if len(places) else ():
            value = table.numbers[column][places[0]]
            texts = [rows[row][column], *(broken[row][column : column + 1] if row == i else [])]
            true = [plain_number(text.replace(decimal, ".")) for text in texts]
            if value not in true and not (row == i and np.isnan(value)):
                wrong.append((row, column, value))
    return wrong


@pytest.mark.parametrize("marks", MARKS)
def test_a_broken_table_is_read_with_the_numbers_of_its_unbroken_rows_or_refused(tmp_path, marks):
    chance, path, answers = random.Random(7), tmp_path / "run.csv", []
    for units, stamps in product(UNITS, STAMPS):
        head, rows = written(chance, marks, units, stamps)
        i = chance.choice([0, 79, chance.randrange(1, 79)])
        column = chance.randrange(i == 0, 5)
        for way, broken in enumerate(ways_to_break(chance, rows, i, column)):
            above = [f"Rig 7{marks[0]}x"] * (chance.random() < 0.2)
            below = "\n" * (chance.random() < 0.9)
            path.write_text("\n".join([*above, *head, *map(marks[0].join, broken)]) + below)
            wrong = others(path, rows, i, broken, marks[1])
            assert not wrong, (units, stamps, way, i, column, path.read_text())
            answers.append(wrong is None)
            assert way > 0 or wrong is not None, "the table as it is"
    assert 0.3 < np.mean(answers) < 0.8
