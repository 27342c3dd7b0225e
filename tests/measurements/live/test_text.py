"""Rows of a text that arrives in pieces: the same however it is cut, and a spoiled line takes no other with it."""

import json

import numpy as np
import pytest

from clutchid.errors import DataError
from clutchid.measurements.live.text import HEAD_LINES, LONGEST, text_blocks, text_feed

HEADER = "time [s],position [mm],duty_supply [%],duty_exhaust [1],note\n"


def lines_of(count, spoil=None):
    rows = [f"{i / 1000},{i * 0.125:.3f},{i % 101},0.5,7" for i in range(count)]
    for at, line in (spoil or {}).items():
        rows[at] = line
    return (HEADER + "\n".join(rows) + "\n").encode()


def read(pieces, chosen=(0, 1, 2, 3)):
    feed = text_feed(iter(pieces), "live")
    rows = list(feed.rows(chosen))
    columns = [np.concatenate([part.table.numbers[i] for part in rows]) for i in chosen]
    return columns, sum(part.left_out + int(part.spoiled.sum()) for part in rows)


def cut(text, sizes):
    begin, pieces = 0, []
    for size in sizes:
        pieces.append(text[begin : begin + size])
        begin += size
    return [*pieces, text[begin:]]


@pytest.mark.parametrize("sizes", [[], [1] * 300, [len(HEADER) - 3, 5, 7000], [2000, 1, 1, 1, 9000]])
@pytest.mark.parametrize("spoil", [{}, {150: "0.15,1.0,0", 160: '0.16,"a",0,0.5,7', 170: '0.17,"1,0,0.5,7', 500: ""}])
def test_rows_do_not_depend_on_how_the_text_is_cut(sizes, spoil):
    text = lines_of(900, spoil)
    whole, spoiled = read([text])
    parts, counted = read(cut(text, sizes))
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(whole, parts, strict=True))
    assert counted == spoiled == (3 if spoil else 0)
    assert whole[0].size == 900 - (3 if spoil else 0)


def test_json_lines_have_the_numbers_of_csv():
    (time, position, *_), _ = read([lines_of(300)])
    text = "".join(
        json.dumps({"position [mm]": y, "time [s]": t, "gear": "R"}) + "\n" for t, y in zip(time, position, strict=True)
    )
    feed = text_feed(iter(cut(text.encode(), [7, 4000])), "live")
    assert [(h.name, h.unit) for h in feed.raster.headings[:2]] == [("position", "mm"), ("time", "s")]
    rows = [table.table for table in feed.rows([0, 1])]
    assert np.array_equal(np.concatenate([table.numbers[1] for table in rows]), time)
    assert np.array_equal(np.concatenate([table.numbers[0] for table in rows]), position)


def test_a_broken_line_of_json_is_left_out_and_a_value_that_is_no_number_is_missing():
    lines = ['{"time [s]": 0.0, "a": 1}', '{"time [s]": 0.1, "a"', "[1]", "null", '{"time [s]": 0.2, "a": [2]}']
    lines += ['{"time [s]": 0.3, "a": null}', '{"time [s]": 0.4, "a": NaN}', '{"time [s]": 0.5}, {"time [s]": 0.6}']
    (time, a), unreadable = read([("\n".join(lines) + "\n").encode()], (0, 1))
    assert time.tolist() == [0.0, 0.2, 0.3, 0.4]
    assert a[0] == 1.0
    assert np.isnan(a[1:]).all()
    assert unreadable == 5


@pytest.mark.parametrize("sizes", [[], [9000, LONGEST, LONGEST // 2, 7], [8000 + LONGEST, LONGEST]])
def test_a_line_that_is_too_long_takes_no_other_with_it(sizes):
    text = lines_of(400, {300: "x" * (2 * LONGEST), 350: "y"})
    (time, *_), unreadable = read(cut(text, sizes))
    assert (time.size, unreadable) == (398, 2)


@pytest.mark.parametrize("value", ["true", '"0,5"', "false", '"on"'])
def test_only_a_number_of_json_is_a_number(value):
    lines = ['{"time [s]": 0.0, "a": 1}', f'{{"time [s]": 0.1, "a": {value}}}', '{"time [s]": 0.2, "a": null}']
    (time, a), unreadable = read([("\n".join(lines) + "\n").encode()], (0, 1))
    assert time.tolist() == [0.0, 0.1, 0.2]
    assert a[0] == 1.0
    assert np.isnan(a[1:]).all()
    assert unreadable == 1


def test_a_number_of_json_may_be_written_as_text():
    lines = ['{"time [s]": "0.0", "a": 1}', '{"time [s]": "0.1", "a": "-2e-1"}', '{"time [s]": 0.2, "a": ""}']
    (time, a), unreadable = read([("\n".join(lines) + "\n").encode()], (0, 1))
    assert time.tolist() == [0.0, 0.1, 0.2]
    assert a[:2].tolist() == [1.0, -0.2]
    assert (np.isnan(a[2]), unreadable) == (True, 0)


@pytest.mark.parametrize(
    ("text", "sizes", "count"),
    [
        (lines_of(200)[:-4], [], 199),  # an unfinished line at the end is dropped
        (b"\xef\xbb\xbf" + lines_of(200).replace(b"note", b"L\xe4nge").replace(b"\n", b"\r\n"), [1, 1, 5000], 200),
    ],
)
def test_line_ends_a_mark_and_windows_characters_do_not_matter_and_only_whole_lines_count(text, sizes, count):
    (time, *_), unreadable = read(cut(text, sizes))
    assert (time.size, unreadable) == (count, 0)


def test_the_dialect_is_that_of_the_first_lines_whatever_comes_with_them():
    text = lines_of(400).replace(b",", b";").replace(b".", b",")
    (time, position, *_), _ = read(cut(text, [3]))
    assert time[-1] == 0.399
    assert position[1] == 0.125
    assert HEAD_LINES > 101


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "ended before the first sample"),
        (b"\n \n", "ended before the first sample"),
        (b"# only\n# remarks\n", "has no table"),
        ("time [s],position [m]\n".encode("utf-16"), "is not UTF-8 text"),
        (b"x" * (LONGEST + 1), "a line is longer than"),
        (b'{"a": \n{\n', "no line is a JSON object"),
    ],
)
def test_what_is_no_text_with_samples_is_refused_in_a_sentence(text, words):
    with pytest.raises(DataError, match=words):
        read([text])


@pytest.mark.parametrize(("later", "refused"), [(0.0, False), (0.5, True)])
def test_a_row_has_one_time_and_others_that_differ_from_it_are_refused(later, refused):
    rows = [f"{i / 1000},{i / 100},{i / 1000 + later},{i % 101},0,noon" for i in range(2 * HEAD_LINES)]
    header = "time [s],position [mm],time supply [s],duty_supply [%],duty_exhaust [%],time of day"
    rows[HEAD_LINES + 50] = rows[HEAD_LINES + 50].replace(f",{(HEAD_LINES + 50) / 1000 + later},", ",spoiled,")
    text = "\n".join([header, *rows, ""]).encode()

    def blocks():
        return list(text_blocks(iter([text]), "live", None, 1e5, ("position", "duty_supply", "duty_exhaust")))

    if refused:
        with pytest.raises(DataError, match=r"live: has a time for each of several channels: 'time \[s\]', 'time sup"):
            blocks()
    else:
        arrived = blocks()
        assert sum(len(block.log) for block in arrived) == pytest.approx(2 * HEAD_LINES, abs=100)
        assert not any(block.left_out.unreadable for block in arrived), "a cell that nothing reads is no problem"
