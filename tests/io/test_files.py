"""Files are written whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

from clutchid.errors import ExportError
from clutchid.io import atomic_write


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


@pytest.mark.parametrize(
    ("raised", "seen"), [(OSError(28, "No space left on device"), ExportError), (KeyError("x"), KeyError)]
)
def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path, raised, seen):
    path = tmp_path / "fit.toml"
    path.write_text("old")

    def fail(temporary):
        temporary.write_text("half")
        raise raised

    with pytest.raises(seen), atomic_write(path) as temporary:
        fail(temporary)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["fit.toml"]


def test_a_full_disk_is_one_sentence(tmp_path):
    with pytest.raises(ExportError) as caught, atomic_write(tmp_path / "fit.toml"):
        raise OSError(28, "No space left on device")
    assert (
        str(caught.value)
        == f"{tmp_path}/fit.toml: cannot be written (No space left on device); what was there is unchanged."
    )


def test_a_link_is_kept_and_its_file_replaced(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "fit.toml").write_text("old")
    link = tmp_path / "fit.toml"
    link.symlink_to(tmp_path / "real" / "fit.toml")
    with atomic_write(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink()
    assert (tmp_path / "real" / "fit.toml").read_text() == "new"


@pytest.mark.parametrize(
    ("path", "what"),
    [
        ("no/fit.toml", "the folder '.*no' does not exist; create it first"),
        ("file/fit.toml", "the folder '.*file' does not exist"),
        ("folder", "is a folder; name a file in it"),
        ("/dev/null", "is not a plain file; name another one"),
    ],
)
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
