"""The folder of a server: private, gone with it, and swept where a server was killed."""

import json
import os
import stat

import pytest

from clutchid.app.folder import end_folder, new_folder, opening_page, sweep
from clutchid.errors import ExportError


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def test_only_the_user_can_read_what_a_server_keeps(tmp_path):
    folder = new_folder(tmp_path / "app")
    page = opening_page(folder, "http://127.0.0.1:1/?token=secret")
    assert (mode(folder), mode(page), mode(folder / "lock.json")) == (0o700, 0o600, 0o600)
    assert "url=http://127.0.0.1:1/?token=secret" in page.read_text()


def test_a_folder_goes_with_its_server_unless_it_is_to_be_kept(tmp_path):
    gone, stays = new_folder(tmp_path), new_folder(tmp_path)
    end_folder(gone, keep=False)
    end_folder(stays, keep=True)
    assert (gone.exists(), stays.exists()) == (False, True)
    (stays / "lock.json").write_text(json.dumps({"pid": 2**22 + 1, "born": 0.0}))
    sweep(tmp_path)
    assert stays.exists()


@pytest.mark.parametrize(
    "lock",
    ['{"pid": 4194305, "born": 1.0}', "{}", "", json.dumps({"pid": os.getpid(), "born": 1.0})],
    ids=["no process", "empty", "no lock", "a later process of this number"],
)
def test_the_folder_of_a_server_that_was_killed_is_removed_by_the_next_one(tmp_path, lock):
    dead = tmp_path / "run-dead"
    dead.mkdir()
    (dead / "lock.json").write_text(lock)
    (dead / "big.csv").write_text("x")
    alive = new_folder(tmp_path)
    assert not dead.exists()
    assert new_folder(tmp_path) != alive
    assert alive.exists()


def test_a_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "app").write_text("a file")
    with pytest.raises(ExportError, match="CLUTCHID_CACHE"):
        new_folder(tmp_path / "app")
