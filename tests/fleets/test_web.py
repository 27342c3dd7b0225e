"""Fleets whose recordings are files of a web server, which are named by a table."""

import functools
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.errors import DataError, ParameterError
from clutchid.fleets.storage import Objects
from clutchid.log import Log
from clutchid.verbs import wear_reading
from fixtures.commands import without_workers
from fixtures.lives import reading

pytest.importorskip("obstore", reason="obstore is not installed")


class Served(SimpleHTTPRequestHandler):
    """Files of a folder, some of them refused, with the ETags of one size and time or without; it sends no parts."""

    asked, etags = [], True

    def end_headers(self):
        if self.etags:
            self.send_header("ETag", '"size-and-time"')
        super().end_headers()

    def send_head(self):
        self.asked.append((self.command, self.path))
        if "secret" in self.path:
            return self.send_error(403)
        return super().send_head()

    def log_message(self, *_):
        pass


@pytest.fixture
def web(tmp_path, monkeypatch):
    """The address of a server of a folder with the recordings of two vehicles, of one size."""
    folder = tmp_path / "web"
    for vehicle, name, slope in (("V1", "a b", 1), ("V1", "b", 2), ("V2", "a b", 3)):
        time, path = np.arange(0.0, 0.5, 0.001), folder / vehicle / f"{name}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        columns = {"position": 1e-4 * time * slope, "duty_supply": np.zeros(500), "duty_exhaust": np.ones(500)}
        clutchid.write(Log(time, columns, metadata={"start": f"2026-01-{slope:02d}"}), path)
    rows = ["V1/a b.parquet,V1", "V1/b.parquet,V1", "V2/a b.parquet,V2", "V2/gone.csv,V2", "secret.csv,V2", "../x,V2"]
    (folder / "recordings.csv").write_text("\n".join(["recording,vehicle", *rows]) + "\n")
    (tmp_path / "cal.toml").write_text("[parameters]\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(wear_reading, "_fitted", lambda log, *_: reading(5e-6 * int(log.metadata["start"][8:10])))
    with ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Served, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        Served.asked.clear()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def run(source, out="out", **options):
    with without_workers():
        return clutchid.fleet(source, "cal.toml", out, verb="track", fail_share=1.0, **options)


@pytest.mark.parametrize("etags", [True, False])
def test_a_table_names_the_files_of_a_web_server_and_what_has_not_changed_is_not_read_again(
    web, tmp_path, monkeypatch, etags
):
    monkeypatch.setattr(Served, "etags", etags)
    tracked = run(f"{web}/recordings.csv")
    assert (tracked.read, tracked.statuses) == (5, {"ok": 3, "bad_input": 3})
    rows = pl.read_parquet(tmp_path / "out" / "results.parquet")
    assert [round(1e3 * shift) if shift else None for shift in rows["shift_mm"]] == [5, 10, 15, None, None, None]
    refused = "secret.csv: access is refused"
    for k, sentence in (
        (5, "../x' leads out of the folder of the table"),
        (3, "gone.csv: there is no such object"),
        (4, refused),
    ):
        assert sentence in rows["message"][k]
    Served.asked.clear()
    assert run(f"{web}/recordings.csv").read == 0
    assert [path for command, path in Served.asked if command == "GET"] == ["/recordings.csv"]
    (tmp_path / "web" / "V1" / "b.parquet").write_bytes(
        (tmp_path / "web" / "V2" / "a b.parquet").read_bytes() + b"PAR1"
    )
    assert run(f"{web}/recordings.csv").read == 1
    (tmp_path / "web" / "V1" / "b.parquet").unlink()
    tracked = run(f"{web}/recordings.csv")
    assert "1 of 6 recordings: the file is gone" in tracked.warnings[0]


def test_an_event_names_a_file_of_a_web_server(web, tmp_path):
    event = f"{web}/V1/a%20b.parquet", "cal.toml", "out"
    row = clutchid.fleet_once(*event, source=f"{web}/recordings.csv")
    assert (row["vehicle"], row["recording"], row["status"]) == ("V1", "a b", "ok")
    assert run(f"{web}/recordings.csv").read == 4, "the next run takes the row in"
    with pytest.raises(DataError, match=r"V1/gone.csv: there is no such object"):
        clutchid.fleet_once(f"{web}/V1/gone.csv", *event[1:])


def test_what_a_web_server_cannot_do_is_one_sentence(web, tmp_path):
    with pytest.raises(
        DataError, match=r"cannot be listed; name the table of its recordings, such as .*/recordings.csv"
    ):
        run(web)
    with pytest.raises(DataError, match=r"/none.csv: there is no such object"):
        run(f"{web}/none.csv")
    for write in (lambda: run(tmp_path / "web", web), lambda: clutchid.fleet_once("web/V1/b.parquet", "cal.toml", web)):
        with pytest.raises(ParameterError, match=r"--out .*: a web server can only be read; name a folder, or objects"):
            write()
    for address in (f"{web}/recordings.csv?key=1", "https://me:word@host/recordings.csv"):
        with pytest.raises(DataError, match=r"address: has a query .* name one without them") as error:
            run(address)
        assert "word@" not in str(error.value)


def test_a_file_that_has_changed_since_it_was_asked_for_is_not_read(web):
    objects = Objects(web)
    with pytest.raises(DataError, match="has changed or was deleted"), objects.staged("V1/b.parquet", "1 x"):
        pass
