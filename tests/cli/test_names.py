"""Names of files and channels, whatever is in them, never reach a terminal or a page raw."""

import os
import sys
from pathlib import Path
from xml.sax.saxutils import escape

import pytest

from clutchid.estimation.parameter_file import read_parameters
from clutchid.measurements import read, write
from clutchid.measurements.look import look
from clutchid.parameters import Parameters
from clutchid.truck import drive, truck
from fixtures.commands import called

ESCAPE, TURN = "\x1b[31m", "\u202e"

#: What a file with [actuator] must have.
OF_DRAWING = ("A_A", "A_B", "V_0A", "V_0B", "M", "y_max")


@pytest.fixture(scope="module")
def log():
    return drive(truck(3), seconds=2.0, seed=2).log


def ran(capsys, *arguments):
    code, said = called(*arguments), capsys.readouterr()
    return code, said.out + said.err


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_name_that_turns_the_direction_of_writing_is_plain_in_the_page(log, tmp_path, capsys):
    path = tmp_path / f"run{TURN}gpj.parquet"
    write(log, path)
    reported(capsys, tmp_path, path)


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


HOSTILE = f'<script>alert(1)</script> & "x" {TURN}gpj'


def reported(capsys, tmp_path, *arguments):
    """Fit with a page, in which as on the terminal nothing from a file is markup or a control character."""
    code, said = ran(capsys, "fit", *arguments, "--report", tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert code == 0
    assert not {"\x1b", "\x07", TURN} & set(said + page)
    assert "<script>alert" not in page


@pytest.mark.slow
def test_comments_of_an_mdf_file_reach_neither_terminal_nor_page_as_markup(log, tmp_path, capsys):
    asammdf = pytest.importorskip("asammdf")
    heading = f"<HDcomment><TX>{escape(HOSTILE)}</TX></HDcomment>"
    units = {"position": "m", "duty_supply": "1", "duty_exhaust": "1", f"gear{ESCAPE}": f"<b>{TURN}"}
    with asammdf.MDF(version="4.10") as mdf:
        signals = [
            asammdf.Signal(log.columns.get(name, log.time), log.time, name=name, unit=unit, comment=HOSTILE + ESCAPE)
            for name, unit in units.items()
        ]
        mdf.append(signals, comment=HOSTILE + ESCAPE, acq_name=f"<b>{ESCAPE}")
        mdf.header.comment = heading
        mdf.save(tmp_path / "run.mf4")
    assert not {"\x1b", "\x07", TURN} & set(ran(capsys, "look", tmp_path / "run.mf4")[1])
    reported(capsys, tmp_path, tmp_path / "run.mf4")


@pytest.mark.slow
def test_comments_and_texts_of_a_start_file_reach_neither_terminal_nor_page_as_markup(log, tmp_path, capsys):
    write(log, tmp_path / "run.csv")
    drawing = "\n".join(f"{name} = {getattr(Parameters(), name)}" for name in OF_DRAWING)
    texts = f"name = '<script>alert(2)</script>'\ndescription = '''{HOSTILE}'''\n"
    other = f"[recording.'{HOSTILE}']\nP_S = 8e5\n"
    (tmp_path / "start.toml").write_text(
        f"# {HOSTILE}\n[actuator]\n{texts}[parameters]\n{drawing}  # {HOSTILE}\n{other}", encoding="utf-8"
    )
    saved = tmp_path / "fit.toml"
    reported(capsys, tmp_path, tmp_path / "run.csv", "--start", tmp_path / "start.toml", "--save", saved)
    assert read_parameters(saved).actuator.equipment.description == HOSTILE  # what is saved is what was read
