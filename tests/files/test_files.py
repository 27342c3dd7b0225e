"""What a user names is opened in one way, and files are written whole or not at all."""

import os
import stat
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from clutchid.errors import DataError, ExportError
from clutchid.files import atomic_write, digest, opened_file, small_file, write_frame
from clutchid.log import Log
from clutchid.measurements import read, write
from fixtures.cases import case_tables

CASES = case_tables(__file__, "refusals")

NO_TEXT = os.fsdecode(b"\xff\xfe")


def test_a_file_appears_whole_under_the_rights_of_a_new_file(tmp_path):
    path = tmp_path / "fit.toml"
    with atomic_write(path) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".toml"
        temporary.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    (tmp_path / "other").touch()
    assert path.stat().st_mode == (tmp_path / "other").stat().st_mode
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["fit.toml", "other"]


def test_a_replaced_file_keeps_its_rights(tmp_path):
    path = tmp_path / "fit.toml"
    path.write_text("old")
    path.chmod(0o640)
    with atomic_write(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == "new"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


FULL = r"fit\.toml: cannot be written \(No space left on device\); no file was changed\.$"


@pytest.mark.parametrize(
    ("raised", "seen", "words"),
    [(OSError(28, "No space left on device"), ExportError, FULL), (KeyError("x"), KeyError, "x")],
)
def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path, raised, seen, words):
    path = tmp_path / "fit.toml"
    path.write_text("old")

    def fail(temporary):
        temporary.write_text("half")
        raise raised

    with pytest.raises(seen, match=words), atomic_write(path) as temporary:
        fail(temporary)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["fit.toml"]


def test_a_link_is_kept_and_its_file_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "fit.toml").write_text("old")
    link = tmp_path / "fit.toml"
    link.symlink_to(tmp_path / "real" / "fit.toml")
    with atomic_write(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert (tmp_path / "real" / "fit.toml").read_text() == "new"


@pytest.mark.parametrize(("path", "what"), CASES["writing"])
def test_what_cannot_be_written_is_refused_before_the_work(tmp_path, path, what):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(ExportError, match=what), atomic_write(tmp_path / path):
        pytest.fail("the block must not run")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["file", "folder"]
    assert Path("/dev/null").is_char_device()


def test_a_write_protected_file_is_kept(tmp_path, monkeypatch):
    path = tmp_path / "fit.toml"
    path.write_text("old")
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(ExportError, match="is write-protected; allow writing or name another file"), atomic_write(path):
        pytest.fail("the block must not run")
    assert path.read_text() == "old"


def test_a_folder_that_cannot_be_written(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(ExportError, match=r"cannot be written \(Permission denied\)"), atomic_write(tmp_path / "a.csv"):
        pytest.fail("the block must not run")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mf4", ".mat"])
@pytest.mark.parametrize("name", [f"{NO_TEXT}/run", NO_TEXT])
@pytest.mark.skipif(sys.platform != "linux", reason="names are bytes on Linux only")
def test_a_name_that_is_no_text_is_written_and_read_like_any_other(tmp_path, suffix, name):
    path = tmp_path / f"{name}{suffix}"
    path.parent.mkdir(exist_ok=True)
    values = np.linspace(0.0, 1e-3, 30)
    write(Log(np.arange(30) * 1e-3, {"position": values, "duty_supply": 0 * values, "duty_exhaust": 0 * values}), path)
    assert read(path)["position"].tolist() == values.tolist()


@pytest.mark.parametrize("open_", [opened_file, digest, lambda path: small_file(path, "recording", 10)])
def test_what_is_not_there_or_no_plain_file_is_one_sentence(tmp_path, open_):
    (tmp_path / "gone").symlink_to(tmp_path / "nowhere.csv")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    os.mkfifo(tmp_path / "pipe")
    for name, what in {
        "gone": rf"gone: is a link to '{tmp_path}/nowhere\.csv', which does not exist\.",
        "loop": r"loop: cannot be read \(Too many levels of symbolic links\)\.",
        "lop": "lop: there is no such file; did you mean 'loop'?",
        "pipe": "pipe: is not a plain file; save the (recording|file) to a file first",
        ".": "is a folder; name one (recording|file) in it",
    }.items():
        with pytest.raises(DataError, match=what):
            open_(tmp_path / name)


def test_what_polars_cannot_write_is_the_same_sentence(tmp_path):
    path = tmp_path / "table.parquet"
    path.write_text("old")
    with pytest.raises(ExportError, match=r"table\.parquet: cannot be written \(.*\); no file was changed"):
        write_frame(pl.DataFrame({"a": [object()]}), path)
    assert path.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_an_error_of_another_file_is_not_said_of_the_one_that_is_written(tmp_path):
    with pytest.raises(FileNotFoundError, match="other"), atomic_write(tmp_path / "table.csv"):
        (tmp_path / "other").read_bytes()
    assert list(tmp_path.iterdir()) == []
