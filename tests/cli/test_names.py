"""Names of files and channels, whatever is in them, never reach a terminal or a page raw."""

import os
import sys
from pathlib import Path

import pytest

from clutchid.cli import main
from clutchid.io import read, write
from clutchid.io.look.look import look
from clutchid.truck import drive, truck

ESCAPE, TURN = "\x1b[31m", "\u202e"


@pytest.fixture(scope="module")
def log():
    return drive(truck(3), seconds=2.0, seed=2).log


def ran(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, arguments)))
    said = capsys.readouterr()
    return ended.value.code, said.out + said.err


@pytest.mark.skipif(sys.platform != "linux", reason="names of files that are not UTF-8 are those of Linux")
def test_a_recording_whose_name_is_no_text_is_fitted_saved_and_reported(log, tmp_path, capsys):
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/w\xff\x1b[31mrn.csv"))
    write(log, tmp_path / "plain.csv")
    (tmp_path / "plain.csv").rename(path)
    files = tmp_path / "fit.toml", tmp_path / "page.html"
    code, said = ran(capsys, "fit", path, "--save", files[0], "--report", files[1])
    assert code == 0
    assert read(path).name == "w??[31mrn"
    assert "w??[31mrn" in files[0].read_text(encoding="utf-8")
    assert "\x1b" not in said + files[1].read_text(encoding="utf-8")


def test_a_name_that_turns_the_direction_of_writing_is_plain_in_the_page(log, tmp_path, capsys):
    path = tmp_path / f"run{TURN}gpj.parquet"
    write(log, path)
    code, _ = ran(capsys, "fit", path, "--report", tmp_path / "page.html")
    assert code == 0
    assert TURN not in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_control_characters_of_headings_units_and_file_names_are_not_printed(tmp_path, capsys):
    path = tmp_path / f"{ESCAPE}run\n7.csv"
    path.write_text(f"time [s],position [m],gear{ESCAPE} [\x07],duty_supply [1]\n0,0,1,0\n1,0,1,0\n")
    seen = look(path)
    assert "gear?[31m" in str(seen)
    code, said = ran(capsys, "look", path)
    assert code == 2
    assert not {"\x1b", "\x07"} & set(said)
    code, said = ran(capsys, "fit", tmp_path / f"no{ESCAPE}such.csv")
    assert code == 2
    assert "\x1b" not in said
