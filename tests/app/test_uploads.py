"""Files that a page sends, or names by their path."""

import pytest

from clutchid.app import uploads
from clutchid.app.records import Recording
from clutchid.app.uploads import allowed_path, folder_listing, safe_name
from clutchid.errors import DataError


def upload(served, name, *parts, **options):
    return served.ask("PUT", f"/api/recordings?name={name}", body=list(parts), **options)


def left(served):
    """Files in the folder of the server."""
    return [path for path in served.session.folder.rglob("*") if path.is_file()]


def test_an_upload_is_kept_in_the_folder_of_the_server_and_opened(idle):
    answer = upload(idle, "Messung.csv", b"time [s],", b"position [m]\n")
    assert (answer.status, answer.json) == (200, {"id": "recording-1"})
    (path,) = left(idle)
    assert path.read_bytes() == b"time [s],position [m]\n"
    assert idle.get("recording-1")["name"] == "Messung.csv"


@pytest.mark.parametrize("name", ["../../evil.csv", "/etc/evil.csv", "..%5C..%5Cevil.csv", "a/../../evil.csv", "...."])
def test_an_upload_stays_below_the_folder_whatever_its_name_is(idle, name):
    assert upload(idle, name, b"x").status == 200
    (path,) = left(idle)
    assert path.parent == idle.session.folder / "uploads" / "recording-1"


def test_a_name_with_markup_is_text_and_has_no_control_characters():
    assert safe_name("<img src=x onerror=alert(1)>.csv") == "_img src=x onerror=alert(1)_.csv"
    assert safe_name("a\x1b[31m\n.csv") == "a__31m_.csv"
    assert len(safe_name("x" * 500 + ".parquet")) <= 120
    assert safe_name("x" * 500 + ".parquet").endswith(".parquet")


def test_an_upload_that_breaks_off_leaves_nothing(idle):
    answer = upload(idle, "a.csv", b"time", None, content_length="100")
    assert answer.status == 400
    assert left(idle) == []
    assert idle.all(Recording) == []


@pytest.mark.parametrize(("parts", "said"), [([b"12345"], "10 bytes arrived"), ([b"1" * 30], "10 bytes arrived")])
def test_an_upload_of_another_size_than_it_said_is_refused(idle, parts, said):
    answer = upload(idle, "a.csv", *parts, content_length="10")
    assert answer.status == 422
    assert said in answer.message
    assert left(idle) == []


def test_an_upload_without_a_size_is_refused(idle):
    assert "open it by its path" in upload(idle, "a.csv", b"x", content_length=None).message


def test_an_upload_that_is_too_large_is_refused_before_it_is_sent(idle):
    answer = upload(idle, "a.csv", content_length=str(uploads.LARGEST_UPLOAD + 1))
    assert "open it by its path, which copies nothing" in answer.message


def test_a_full_disk_refuses_an_upload_before_it_is_sent(idle, monkeypatch):
    monkeypatch.setattr("clutchid.app.uploads.free_bytes", lambda _: uploads.SPARE + 10)
    answer = upload(idle, "a.csv", b"123456")
    assert answer.status == 422
    assert "make room" in answer.message
    assert left(idle) == []


def test_a_disk_that_is_full_while_a_file_arrives_is_said(idle, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.open", full)
    assert "No space left on device" in upload(idle, "a.csv", b"123").message


@pytest.fixture
def tree(tmp_path):
    """A folder that is open to the page, with links, and a file beside it."""
    below = tmp_path / "below"
    (below / "day").mkdir(parents=True)
    (below / "day" / "run.csv").write_text("x")
    (below / ".hidden.csv").write_text("x")
    (below / "notes.docx").write_text("x")
    (tmp_path / "secret.csv").write_text("x")
    (below / "link.csv").symlink_to(tmp_path / "secret.csv")
    (below / "inner.csv").symlink_to(below / "day" / "run.csv")
    return below.resolve()


@pytest.mark.parametrize("path", ["day/run.csv", "inner.csv", "./day/../day/run.csv"])
def test_a_file_below_the_folder_can_be_opened_by_its_path(tree, path):
    assert allowed_path(path, tree, ()) == tree / "day" / "run.csv"


@pytest.mark.parametrize(
    "path", ["../secret.csv", "link.csv", "/etc/passwd", "day/../../secret.csv", "a\x00b", "day", "no.csv"]
)
def test_another_path_is_refused(tree, path):
    with pytest.raises(DataError):
        allowed_path(path, tree, ())


def test_a_file_of_the_command_line_can_be_opened_wherever_it_lies(tree):
    secret = tree.parent / "secret.csv"
    assert allowed_path(str(secret), tree, [secret]) == secret.resolve()


def test_a_folder_lists_recordings_and_folders_below_it(tree):
    listing = folder_listing("", tree)
    assert [folder["name"] for folder in listing["folders"]] == ["day"]
    assert [folder["name"] for folder in listing["files"]] == ["inner.csv", "link.csv"]
    assert listing["up"] is None
    assert folder_listing("day", tree)["up"] == "."


@pytest.mark.parametrize("path", ["..", "/etc", "day/../..", "no"])
def test_no_other_folder_is_listed(tree, path):
    with pytest.raises(DataError, match="there is no such folder below"):
        folder_listing(path, tree)
