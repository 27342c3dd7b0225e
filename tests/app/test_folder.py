"""The folder of a server: private, gone with it, and swept where a server was killed."""

import json
import os
import stat
from dataclasses import replace

import pytest

from clutchid.app.folder import end_folder, new_folder, opening_page, project_folder, sweep
from clutchid.app.project import read_project, write_project
from clutchid.app.records import Recording, Result
from clutchid.app.session import Session
from clutchid.errors import DataError, ExportError
from clutchid.verbs.options import RequestText


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


def project(folder):
    """A session of a project that begins no job, and the jobs that it would begin."""
    session = Session(project_folder(folder), folder, project=True)
    session.jobs.submit = lambda title, *_: begun.append(title)
    begun = []
    return session, begun


def test_a_project_comes_back_as_it_was_without_what_had_not_ended(tmp_path):
    (tmp_path / "run.csv").write_text("time [s],position [m]\n0,0\n")
    first, _ = project(tmp_path)
    recording = first.open(tmp_path / "run.csv")
    first.set_map(recording, {"position": {"channel": "Weg", "unit": "mm"}}, None, "1bar")
    first.board.update(recording, look={"checks": []}, status="ready")
    own = tmp_path / ".clutchid-app" / "results" / "result-2" / "map.toml"
    facts = {"options": RequestText(free="load"), "found": {"files": ["fit.toml"]}, "map": own}
    fit = Result("result-2", "calibrate", "calibrate run.csv (2)", "done", (recording,), **facts)
    first.board.put(fit)
    first.board.put(Result("result-3", "estimate", "estimate run.csv (3)", "running", (recording,)))
    end_folder(first.folder, keep=False, project=True)

    again, begun = project(tmp_path)
    same = again.board.get(Recording, recording)
    assert (same.map, same.ambient) == (first.board.get(Recording, recording).map, "1bar")
    assert again.board.all(Result) == [fit]
    again.resume()
    assert begun == ["open run.csv"]
    assert again.open(tmp_path / "run.csv") == "recording-3"
    with pytest.raises(ExportError, match="another clutchid app has this project open"):
        project_folder(tmp_path)


def test_a_project_is_written_when_what_it_keeps_changes_and_before_a_page_shows_it(tmp_path, monkeypatch):
    (tmp_path / "run.csv").write_text("time [s],position [m]\n0,0\n")
    session, _ = project(tmp_path)
    written = []
    monkeypatch.setattr(
        "clutchid.app.session.write_project", lambda *entries: (written.append(entries), write_project(*entries))
    )
    recording = session.open(tmp_path / "run.csv")
    assert len(written) == 1
    session.board.update(recording, look={"checking": True}, status="ready")
    session.board.update(recording, look={"checking": False}, status="ready")
    fit = Result("result-2", "calibrate", "calibrate run.csv (2)")
    for status in ("waiting", "running"):
        session.board.put(replace(fit, status=status))
    assert len(written) == 1
    session.board.put(replace(fit, status="done", found={"files": []}))
    assert [item.status for item in read_project(session.folder) if isinstance(item, Result)] == ["done"]
    session.board.remove(recording)
    assert [item.id for item in read_project(session.folder)] == ["result-2"]
    assert len(written) == 3


@pytest.mark.parametrize("text", ["{", "{}", '{"items 1": [{"kind": "Recording", "id": "../x"}]}'])
def test_a_damaged_project_is_said_and_left_alone(tmp_path, text):
    board = project_folder(tmp_path) / "board.json"
    board.write_text(text)
    with pytest.raises(DataError, match="is damaged, or of another version, and is left as it is"):
        Session(board.parent, tmp_path, project=True)
    assert board.read_text() == text
