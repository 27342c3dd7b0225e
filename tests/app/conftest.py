"""A server in a thread of its own, asked without a network."""

import asyncio
import json
import pickle
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest

from clutchid import write
from clutchid.app.guard import Access
from clutchid.app.records import content
from clutchid.app.server import application
from clutchid.app.session import Session
from clutchid.app.tasks import TASKS
from clutchid.app.worker import do_task
from clutchid.documents.json_text import json_text
from clutchid.truck import Truck, drive
from clutchid.verbs.progress import when_compiling
from fixtures.commands import wait_for
from fixtures.once import fits_once
from fixtures.pages import blank_figures

PORT = 8123


@dataclass
class Answer:
    """An answer of the server."""

    status: int
    headers: dict
    body: bytes

    @property
    def json(self):
        return json.loads(self.body)

    @property
    def message(self):
        return self.json["message"]


@dataclass
class Served:
    """A server, and a browser that has opened it: `cookie` None is one that has not."""

    session: Session
    access: Access
    loop: asyncio.AbstractEventLoop = field(default_factory=asyncio.new_event_loop)

    def __post_init__(self):
        self.app = application(self.session, self.access)

    def ask(self, method, path, content=None, *, host=None, cookie=True, origin=True, ours=True, body=None, **headers):
        """An answer; `content` is sent as JSON, `body` are parts of an upload, of which None is a lost connection."""
        sent = {"host": host if host is not None else f"127.0.0.1:{PORT}"}
        if cookie:
            sent["cookie"] = f"{self.access.name}={self.access.cookie}" if cookie is True else cookie
        if origin:
            sent["origin"] = f"http://{sent['host']}" if origin is True else origin
        if ours:
            sent["x-clutchid"] = "1"
        parts = body if body is not None else [b"" if content is None else json.dumps(content).encode()]
        if "content_length" not in headers:
            headers["content_length"] = str(sum(len(part) for part in parts if part))
        sent |= {name.replace("_", "-"): value for name, value in headers.items() if value is not None}
        return self.run(self._ask(method, path, sent, parts))

    def run(self, work):
        """Do work in the loop of the server."""
        if self.loop.is_running():
            return asyncio.run_coroutine_threadsafe(work, self.loop).result(120)
        return self.loop.run_until_complete(work)

    async def _ask(self, method, path, headers, parts):
        path, _, query = path.partition("?")
        scope = {
            "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": method, "path": path,
            "raw_path": path.encode(), "query_string": query.encode(), "root_path": "", "scheme": "http",
            "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
            "client": ("127.0.0.1", 5000), "server": ("127.0.0.1", PORT),
        }  # fmt: skip
        waiting, got = [*parts], []

        async def receive():
            if not waiting:
                await asyncio.Event().wait()
            part = waiting.pop(0)
            if part is None:
                return {"type": "http.disconnect"}
            return {"type": "http.request", "body": part, "more_body": bool(waiting)}

        async def send(message):
            got.append(message)

        await self.app(scope, receive, send)
        start = next((event for event in got if event["type"] == "http.response.start"), None)
        assert start is not None
        body = b"".join(event.get("body", b"") for event in got if event["type"] == "http.response.body")
        return Answer(start["status"], {name.decode(): value.decode() for name, value in start["headers"]}, body)

    def get(self, id_):
        """The JSON object of a record, None where there is none."""
        item = self.session.board.item(id_)
        return None if item is None else content(item)

    def all(self, kind):
        """The JSON objects of all records of a kind."""
        return [content(item) for item in self.session.board.all(kind)]

    def wait(self, id_, *states, seconds=120.0):
        """The JSON object of a record once it has one of these states."""
        wait_for(lambda: self.get(id_)["status"] in states, seconds)
        return self.get(id_)

    def upload(self, path):
        """The id of an uploaded file."""
        return self.ask("PUT", f"/api/recordings?name={path.name}", body=[path.read_bytes()]).json["id"]

    def checked(self, path):
        """The id of an uploaded recording that was checked."""
        id_ = self.upload(path)
        wait_for(lambda: self.get(id_)["look"] and not self.get(id_)["look"]["checking"])
        return id_


@pytest.fixture
def idle(tmp_path):
    """A server that starts no job: for what it refuses, and what it answers at once."""
    (tmp_path / "below").mkdir()
    served = Served(Session(tmp_path / "own", tmp_path / "below"), Access(PORT))
    served.session.folder.mkdir()
    served.session.jobs.submit = lambda *arguments: served.submitted.append(arguments)
    served.submitted = []
    yield served
    served.loop.close()


class JobInThread:
    """A thread that does one job, where answers of jobs are tested and not their processes."""

    pid = returncode = 0

    def __init__(self, limit):
        self.stdin, self.stdout, self.loop = self, asyncio.StreamReader(limit), asyncio.get_running_loop()

    def write(self, pickled):
        task = pickle.loads(pickled)
        threading.Thread(target=do_task, args=(task, TASKS[type(task)], self), daemon=True).start()

    async def drain(self):
        """Nothing is left to be sent."""

    async def wait(self):
        return self.returncode

    def say(self, event, **values):
        self.loop.call_soon_threadsafe(self.stdout.feed_data, f"{json_text({'event': event, **values})}\n".encode())

    def part(self, result):
        self.say("part", result=result)

    def progress(self, stage, share, words):
        self.say("progress", stage=stage, share=share, words=words)


@contextmanager
def serving(folder):
    """A server with its jobs, in a thread."""
    served = Served(Session(folder / "own", folder), Access(PORT))
    served.session.folder.mkdir()
    thread = threading.Thread(target=served.loop.run_forever)
    thread.start()
    yield served
    served.run(served.session.jobs.close())
    served.loop.call_soon_threadsafe(served.loop.stop)
    thread.join()
    served.loop.close()


@pytest.fixture(scope="module")
def working(tmp_path_factory):
    """A server that does its jobs in this process, and leaves figures empty."""

    async def started(*_, limit, **__):
        return JobInThread(limit)

    with (
        pytest.MonkeyPatch.context() as patched,
        blank_figures(),
        fits_once(),
        serving(tmp_path_factory.mktemp("app")) as served,
    ):
        patched.setattr("clutchid.app.jobs.asyncio.create_subprocess_exec", started)
        yield served
        when_compiling(lambda _: None)  # the jobs have no process of their own, with which their callbacks would end


@pytest.fixture(scope="module")
def spread(tmp_path_factory):
    """A server with a process for each job."""
    with serving(tmp_path_factory.mktemp("app")) as served:
        yield served


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """A folder with a recording of a new clutch with pressure, and one of a worn clutch without."""
    folder = tmp_path_factory.mktemp("recorded")
    write(drive(Truck(), seconds=3.0, seed=1).log, folder / "cal.csv")
    write(drive(Truck(), seconds=3.0, seed=2, pressure=False, wear=1e-3).log, folder / "worn.csv")
    text = (folder / "cal.csv").read_text()
    (folder / "german.csv").write_text(text.replace("position [m]", "Kupplungsweg [m]"))
    (folder / "german_worn.csv").write_text(
        (folder / "worn.csv").read_text().replace("position [m]", "Kupplungsweg [m]")
    )
    return folder
