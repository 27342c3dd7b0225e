"""Fleets whose recordings and tables are objects of a storage: a local server that speaks S3."""

import base64
import hmac
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from email.utils import formatdate
from hashlib import sha256
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import clutchid
from clutchid.errors import DataError, ExportError, ParameterError
from clutchid.fleets.storage import Objects, _store, scratch_of
from clutchid.log import Log
from clutchid.verbs import wear_reading
from fixtures.commands import without_workers
from fixtures.lives import reading
from fixtures.programs import path_of

obstore = pytest.importorskip("obstore", reason="obstore is not installed")
pytest.importorskip("moto.server", reason="moto is not installed")

pytestmark = pytest.mark.slow


#: Account of the local server for Azure, which is public, and a command that makes a container.
ACCOUNT = "devstoreaccount1"
KEY = "Eby8vdM02xNOcqFlqUwJPLlmEtlCDXJ1OUzFT50uSRZ6IFsuFq2UVErCz4I6tq/K1SZFPTOtr/KBHBeksoGMGw=="


@pytest.fixture(scope="module", params=["s3", "az"])
def server(request, tmp_path_factory):
    """The scheme and the address of a storage: moto for S3, Azurite for Azure."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    address, folder = f"http://127.0.0.1:{port}", str(tmp_path_factory.mktemp("storage"))
    command = [sys.executable, "-m", "moto.server", "-p", port, "-H", "127.0.0.1"]
    if request.param == "az":
        program = path_of("azurite-blob")
        command = [program, "--blobPort", port, "--location", folder, "--silent", "--skipApiVersionCheck"]
        command.append("--disableTelemetry")
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for _ in range(300):
        try:
            socket.create_connection(("127.0.0.1", int(port)), 1.0).close()
            break
        except OSError:
            time.sleep(0.1)
    make_container(request.param, address)
    yield request.param, address
    process.terminate()
    process.wait()


def make_container(scheme, address):
    """Make the bucket or container `lake`."""
    asked = urllib.request.Request(f"{address}/lake", method="PUT")
    if scheme == "az":
        date, path = formatdate(usegmt=True), f"/{ACCOUNT}/{ACCOUNT}/lake"
        signed = "PUT" + 12 * "\n" + f"x-ms-date:{date}\nx-ms-version:2021-08-06\n{path}\nrestype:container"
        digest = base64.b64encode(hmac.digest(base64.b64decode(KEY), signed.encode(), "sha256")).decode()
        headers = {
            "x-ms-date": date, "x-ms-version": "2021-08-06", "Authorization": f"SharedKey {ACCOUNT}:{digest}",
            "Content-Length": "0",
        }  # fmt: skip
        asked = urllib.request.Request(f"{address}/{ACCOUNT}/lake?restype=container", method="PUT", headers=headers)
    urllib.request.urlopen(asked).close()


@pytest.fixture
def lake(server, monkeypatch, tmp_path, request):
    """An empty place in the storage, which the environment knows."""
    scheme, address = server
    set_up(monkeypatch, address)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return Objects(f"{scheme}://lake/{sha256(request.node.name.encode()).hexdigest()[:8]}")


def set_up(monkeypatch, endpoint):
    for name, value in {
        "AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": endpoint, "AWS_ALLOW_HTTP": "true", "AZURE_STORAGE_ACCOUNT_NAME": ACCOUNT,
        "AZURE_STORAGE_ACCOUNT_KEY": KEY, "AZURE_STORAGE_ENDPOINT": f"{endpoint}/{ACCOUNT}", "AZURE_ALLOW_HTTP": "true",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    _store.cache_clear()


def recording(day):
    """Bytes of a recording of a day."""
    time_, path = np.arange(0.0, 0.5, 0.001), f"run_{day}.parquet"
    columns = {"position": 1e-4 * time_ * day, "duty_supply": np.zeros(500), "duty_exhaust": np.ones(500)}
    clutchid.write(Log(time_, columns, metadata={"start": f"2026-01-{day:02d}"}), path)
    return Path(path).read_bytes()


@pytest.fixture
def fleet(lake, monkeypatch, tmp_path):
    """A fleet of two vehicles, whose readings are known by the time in their files."""
    monkeypatch.setattr(wear_reading, "_fitted", lambda log, *_: reading(5e-6 * int(log.metadata["start"][8:10])))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cal.toml").write_text("[parameters]\n")
    source = Objects(f"{lake.address}/fleet")
    for day in range(1, 5):
        source.write(f"V{day % 2}/r{day}.parquet", recording(day))
    return source


def run(source, out, **options):
    with without_workers():
        return clutchid.fleet(source, "cal.toml", out, verb="track", **options)


def test_a_fleet_of_objects_has_the_tables_of_the_same_fleet_of_files(fleet, lake, tmp_path):
    out = Objects(f"{lake.address}/wear")
    tracked = run(fleet.address, out.address)
    assert (tracked.read, tracked.statuses, tracked.out) == (4, {"ok": 4}, out.address)
    for name in fleet.stamps():
        (tmp_path / "files" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "files" / name).write_bytes(fleet.read(name))
    run(tmp_path / "files", tmp_path / "out")
    for name in ("results.parquet", "vehicles.parquet", "vehicles/V1.parquet", "vehicles/V1.load.parquet"):
        costs = ("read_at", "written_at")
        there, here = (
            pl.read_parquet(content).drop(costs, strict=False) for content in (out.read(name), tmp_path / "out" / name)
        )
        assert there.equals(here), name
    assert len(list(out.names("recordings/"))) == 4
    assert {"index.html", "vehicles/V0.html"} <= {*out.names("")}
    assert not [name for name in out.names("") if "sqlite" in name]


def test_nothing_is_read_again_also_under_another_name_or_where_the_index_was_lost(fleet, lake, tmp_path):
    out = f"{lake.address}/wear"
    run(fleet.address, out)
    assert run(fleet.address, out).read == 0
    fleet.write("V1/again.parquet", fleet.read("V1/r1.parquet"))
    fleet.delete(["V1/r1.parquet"])
    tracked = run(fleet.address, out)
    if fleet.address.startswith("az"):  # where an ETag is that of a write, not of its content
        assert tracked.read == 1
        tracked = run(fleet.address, out)
    assert (tracked.read, tracked.warnings) == (0, ())
    for path in scratch_of(Objects(out)).iterdir():
        path.rename(tmp_path / path.name)
    assert run(fleet.address, out).read == 0
    fleet.delete(["V0/r2.parquet"])
    tracked = run(fleet.address, out)
    assert tracked.statuses == {"ok": 4}
    assert "1 of 4 recordings: the file is gone, and the reading is kept" in tracked.warnings[0]


def test_a_table_beside_the_objects_says_what_they_are(fleet, lake):
    rows = ["recording,vehicle,type,strokes,depot", "r1,V1,T1,1000,Ulm", "r2,V1,T1,2000,Ulm", "r9,V1,T1,3000,Ulm"]
    fleet.write("recordings.csv", "\n".join([*rows, "V0/r4.parquet,V1,T1,4000,Ulm", ""]).encode())
    for source in (fleet.address, f"{fleet.address}/recordings.csv"):
        out = Objects(f"{lake.address}/{source[-3:]}")
        tracked = run(source, out.address)
        assert tracked.statuses == {"ok": 3, "bad_input": 1}
        results = pl.read_parquet(out.read("results.parquet"))
        assert results.select("vehicle", "recording", "strokes", "tag_depot").rows()[:2] == [
            ("V1", "r1", 1000.0, "Ulm"), ("V1", "r2", 2000.0, "Ulm"),
        ]  # fmt: skip


def test_an_event_reads_its_object_and_the_table_and_lists_nothing(fleet, lake, monkeypatch):
    monkeypatch.delattr(Objects, "stamps")
    event = f"{fleet.address}/V1/r1.parquet", "cal.toml", f"{lake.address}/wear"
    assert clutchid.fleet_once(*event, source=fleet.address)["strokes"] is None
    fleet.write("recordings.csv", b"recording,vehicle,type,strokes\nr1,V1,T1,1000\n")
    for source in (fleet.address, f"{fleet.address}/recordings.csv"):
        row = clutchid.fleet_once(*event, source=source)
        assert (row["status"], row["type"], row["strokes"]) == ("ok", "T1", 1000.0)
    with pytest.raises(DataError, match=r"V1/gone.parquet: there is no such object"):
        clutchid.fleet_once(f"{fleet.address}/V1/gone.parquet", *event[1:])


def test_an_object_that_goes_or_changes_is_a_row_and_the_rest_goes_on(fleet, lake, monkeypatch):
    stamps = Objects.stamps

    def stale(objects, under=""):
        """What was listed before one object was deleted and another one changed."""
        listed = stamps(objects, under)
        if under or "fleet" not in objects.address or "V1/r1.parquet" not in listed:
            return listed
        objects.delete(["V1/r1.parquet"])
        objects.write("V0/r2.parquet", b"changed")
        return listed

    monkeypatch.setattr(Objects, "stamps", stale)
    out = Objects(f"{lake.address}/wear")
    assert run(fleet.address, out.address).statuses == {"ok": 2, "bad_input": 2}
    messages = pl.read_parquet(out.read("results.parquet"))["message"].to_list()
    stale = "has changed or was deleted since it was listed; run the same command again."
    assert messages[0] == f"{fleet.address}/V0/r2.parquet: {stale}"
    assert messages[2] in {f"{fleet.address}/V1/r1.parquet: {words}" for words in (stale, "there is no such object.")}


def test_what_cannot_be_reached_is_one_sentence(fleet, lake, monkeypatch):
    scheme, code = lake.address[:2], {"s3": "NoSuchBucket", "az": "ContainerNotFound"}[lake.address[:2]]
    with pytest.raises(DataError, match=rf"{scheme}://nowhere/fleet: cannot be reached \({code}\); credentials"):
        run(f"{scheme}://nowhere/fleet", "out")
    with pytest.raises(DataError, match=r"/empty: there are no objects"):
        run(f"{lake.address}/empty", "out")
    with pytest.raises(ParameterError, match=r"is the fleet itself; name a folder of its own"):
        run(fleet.address, fleet.address)
    monkeypatch.delenv("AZURE_STORAGE_ACCOUNT_NAME")
    _store.cache_clear()
    with pytest.raises(DataError, match=r"az://container/fleet: cannot be used .*credentials and endpoint are those"):
        run("az://container/fleet", "out")


class Faulty(BaseHTTPRequestHandler):
    """A storage that sends half of what it was asked for, refuses a writer, and refuses a reader."""

    protocol_version, sent = "HTTP/1.1", []
    content = bytes(range(256)) * 400

    def do_GET(self):
        if "secret" in self.path:
            self.send_error(403)
            return
        begin = int(self.headers.get("Range", "bytes=0-").removeprefix("bytes=").partition("-")[0])
        part = self.content[begin:]
        self.sent.append(begin)
        self.send_response(206 if "Range" in self.headers else 200)
        self.send_header("Content-Length", str(len(part)))
        self.send_header("Content-Range", f"bytes {begin}-{len(self.content) - 1}/{len(self.content)}")
        self.send_header("ETag", '"whole"')
        self.send_header("Last-Modified", "Mon, 30 Nov 2026 00:00:00 GMT")
        self.end_headers()
        self.wfile.write(part[: max(len(part) // 2, 20_000)])
        self.wfile.flush()
        self.close_connection = True

    def do_HEAD(self):
        self.send_response(200)
        self.send_header("Content-Length", str(len(self.content)))
        self.send_header("ETag", '"whole"')
        self.send_header("Last-Modified", "Mon, 30 Nov 2026 00:00:00 GMT")
        self.end_headers()

    def do_PUT(self):
        self.send_error(403)

    def log_message(self, *_):
        pass


@pytest.fixture(params=["s3://lake/fleet", "web"])
def faulty(monkeypatch, request):
    with ThreadingHTTPServer(("127.0.0.1", 0), Faulty) as storage:
        threading.Thread(target=storage.serve_forever, daemon=True).start()
        set_up(monkeypatch, f"http://127.0.0.1:{storage.server_port}")
        Faulty.sent.clear()
        yield Objects(request.param.replace("web", f"http://127.0.0.1:{storage.server_port}/fleet"))
        storage.shutdown()


def test_an_object_that_ends_in_the_middle_is_asked_for_the_rest_only(faulty):
    with faulty.staged("r.parquet", faulty.stamp("r.parquet")) as path:
        assert path.read_bytes() == Faulty.content
        assert path.name == "r.parquet"
    assert not path.exists()
    assert Faulty.sent == sorted(set(Faulty.sent))
    assert len(Faulty.sent) > 1


def test_rights_that_are_missing_are_one_sentence(faulty):
    with pytest.raises(DataError, match=r"fleet/secret.parquet: access is refused"):
        faulty.read("secret.parquet")
    with pytest.raises(ExportError, match=r"fleet/results.parquet: (access is refused|cannot be reached)"):
        faulty.write("results.parquet", b"x")


def test_an_object_is_written_once_by_two_writers(lake):
    lake.write("part.parquet", b"first", once=True)
    lake.write("part.parquet", b"second", once=True)
    assert lake.read("part.parquet") == b"first"
    lake.write("part.parquet", b"third")
    assert lake.read("part.parquet") == b"third"
