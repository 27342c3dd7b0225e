"""The server: routes, the files of the page, and events; `serve` runs it until it is stopped."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import mimetypes
import socket
import webbrowser
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import uvicorn
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from clutchid.app import uploads
from clutchid.app.commands import METHOD_CHOICES, VERBS
from clutchid.app.folder import end_folder, new_folder, opening_page, project_folder
from clutchid.app.guard import LOOPBACK, REPORT_POLICY, Access, Guard
from clutchid.app.records import Observation, Recording, Result
from clutchid.app.session import Session
from clutchid.documents.json_text import json_text
from clutchid.errors import ClutchidError, DataError, ParameterError
from clutchid.files import not_an_address, reason_of
from clutchid.files.records import read_record, toml_of
from clutchid.log.units import UNITS
from clutchid.verbs.choosing import meanings
from clutchid.verbs.failures import failure
from clutchid.verbs.looking import QUANTITIES
from clutchid.verbs.stored import plotted

_STATIC = Path(__file__).parent / "static"

#: Time in s after which an event stream says that it is alive.
_PATIENCE = 15.0

#: Largest body of a request that is not an upload, in bytes.
_LARGEST_BODY = 1 << 20

Endpoint = Callable[[Request], Awaitable[Response]]


def application(session: Session, access: Access, begun: Callable[[], None] = lambda: None) -> Guard:
    """The guarded application of a session; `begun` is called once it is up."""

    @contextlib.asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        session.resume()
        begun()
        with contextlib.suppress(OSError):
            await session.jobs.warm_up()
        yield
        await session.jobs.close()

    mimetypes.add_type("text/javascript", ".js")  # Windows may have another one, and a browser runs no other
    routes = [
        Route("/", _index),
        Route("/api/about", _of(session, _about)),
        Route("/api/events", _of(session, _events)),
        Route("/api/files", _of(session, _files)),
        Route("/api/recordings", _of(session, _upload_recording), methods=["PUT"]),
        Route("/api/recordings", _of(session, _open_path), methods=["POST"]),
        Route("/api/recordings/{id}", _of(session, _forget), methods=["DELETE"]),
        Route("/api/recordings/{id}/plot", _of(session, partial(_plot, Recording))),
        Route("/api/recordings/{id}/map", _of(session, _set_map), methods=["PUT"]),
        Route("/api/recordings/{id}/map.toml", _of(session, _map_file)),
        Route("/api/recordings/{id}/cut", _of(session, _cut), methods=["POST"]),
        Route("/api/calibrations", _of(session, _upload_calibration), methods=["PUT"]),
        Route("/api/fits", _of(session, _fit), methods=["POST"]),
        Route("/api/choices", _of(session, _choices), methods=["POST"]),
        Route("/api/observations", _of(session, _observe), methods=["POST"]),
        Route("/api/observations/{id}", _of(session, _forget), methods=["DELETE"]),
        Route("/api/observations/{id}/plot", _of(session, partial(_plot, Observation))),
        Route("/api/jobs/{id}", _of(session, _cancel), methods=["DELETE"]),
        Route("/api/results/{id}", _of(session, _forget), methods=["DELETE"]),
        Route("/api/results/{id}/plot", _of(session, partial(_plot, Result))),
        Route("/api/results/{id}/export", _of(session, _export), methods=["POST"]),
        Route("/api/results/{id}/map.toml", _of(session, _map_file)),
        Route("/api/results/{id}/files/{name}", _of(session, _result_file)),
        Mount("/static", StaticFiles(directory=_STATIC)),
    ]
    return Guard(Starlette(routes=routes, lifespan=lifespan), access)


def _of(session: Session, handle: Callable[[Session, Request], Awaitable[Response]]) -> Endpoint:
    """An endpoint of a session, whose errors are a sentence beside the input that caused them."""

    async def endpoint(request: Request) -> Response:
        try:
            return await handle(session, request)
        except ClientDisconnect:
            return Response(status_code=400)
        except (ClutchidError, OSError) as error:
            sentence = reason_of(error) if type(error) is OSError else failure(error, debug=False)[0]
            return JSONResponse({"message": sentence}, 422)

    return endpoint


async def _index(_request: Request) -> Response:
    return FileResponse(_STATIC / "index.html")


async def _about(session: Session, _request: Request) -> Response:
    """Units, quantities, parameters and verbs, the session, and the recordings that are there, if there was a fit."""
    fits = any(result.verb != "file" for result in session.board.all(Result))
    return JSONResponse({
        "units": {name: asdict(unit) for name, unit in UNITS.items()}, "quantities": dict(QUANTITIES),
        "parameters": meanings(),
        "verbs": {verb: dict(options) for verb, options in VERBS.items()}, "methods": METHOD_CHOICES,
        "session": session.name, "offered": [item.id for item in session.board.all(Recording) if fits],
    })  # fmt: skip


async def _events(session: Session, request: Request) -> Response:
    """All objects, then every change, as server-sent events; a page that reconnects continues where it was."""
    last = request.headers.get("last-event-id") or request.query_params.get("after", "0")
    number = int(last) if last.isdigit() else 0

    async def stream() -> AsyncIterator[str]:
        yield "retry: 500\n\n"
        async for changes in session.board.follow(number, _PATIENCE):
            for change in changes:
                data = json.dumps(change.content(), allow_nan=False)
                yield f"id: {change.number}\ndata: {data}\n\n"
            if not changes:
                yield ": alive\n\n"

    return StreamingResponse(stream(), media_type="text/event-stream")


async def _files(session: Session, request: Request) -> Response:
    return JSONResponse(uploads.folder_listing(request.query_params.get("under", ""), session.below))


async def _upload_recording(session: Session, request: Request) -> Response:
    id_, path = await _received(session, request)
    return JSONResponse({"id": session.open(path, id_, uploaded=True)})


async def _upload_calibration(session: Session, request: Request) -> Response:
    length = request.headers.get("content-length", "")
    if length.isdigit() and int(length) > _LARGEST_BODY:
        raise DataError(
            f"{request.query_params.get('name')}: {int(length) / 1e6:.3g} MB is too large for a parameter file."
        )
    _, path = await _received(session, request)
    return JSONResponse({"id": session.open_calibration(path, path.name, move=True)})


async def _received(session: Session, request: Request) -> tuple[str, Path]:
    """The body of the request as a file with its id, without a second copy."""
    name = request.query_params.get("name", "")
    size = uploads.upload_size(name, request.headers.get("content-length"), session.folder)
    id_, path = session.upload_path(name)
    path.unlink(missing_ok=True)  # the same file once more
    await uploads.receive_upload(request.stream(), path, size)
    return id_, path


async def _open_path(session: Session, request: Request) -> Response:
    (path,) = _texts(await _body(request), "path")
    return JSONResponse({"id": session.open_any(uploads.allowed_path(path, session.below, session.named))})


async def _forget(session: Session, request: Request) -> Response:
    session.forget(request.path_params["id"])
    return JSONResponse({})


async def _plot(kind: type[Recording | Result | Observation], session: Session, request: Request) -> Response:
    """Time and columns one after the other as float64; the page knows the number of columns."""
    query = request.query_params
    try:
        grid = int(query["grid"])
        columns = [int(column) for column in query["columns"].split(",") if column]
        begin, end, width = float(query["begin"]), float(query["end"]), int(query["width"])
    except (KeyError, ValueError):
        raise ParameterError("plot: grid, columns, begin, end and width must be numbers.") from None
    if not (math.isfinite(begin) and math.isfinite(end)) or grid < 0 or len(columns) > 64:
        raise ParameterError("plot: begin and end are times in s, and at most 64 columns are plotted.")
    folder = session.columns_of(kind, request.path_params["id"])
    try:
        values = plotted(folder, grid, columns, begin, end, width)
    except FileNotFoundError:
        raise DataError("this channel has no numbers to plot.") from None
    return Response(values.astype("<f8").tobytes(), media_type="application/octet-stream")


async def _set_map(session: Session, request: Request) -> Response:
    body = await _body(request)
    channels, rate, ambient = body.get("channels"), body.get("rate"), body.get("ambient", "")
    if isinstance(body.get("toml"), str):
        channels = toml_of(body["toml"].encode(), "map", "channel map")
        rate = channels.pop("rate", None)
    if not isinstance(channels, dict) or not isinstance(ambient, str) or not isinstance(rate, int | float | None):
        raise ParameterError("map: give the channels by quantity.")
    session.set_map(request.path_params["id"], channels, rate, ambient)
    return JSONResponse({})


async def _map_file(session: Session, request: Request) -> Response:
    item = session.board.item(request.path_params["id"])
    if not isinstance(item, Recording | Result) or item.map is None:
        raise DataError("this recording has no channel map of its own.")
    return FileResponse(item.map, headers=_attachment(f"{item.name}.map.toml"))


async def _cut(session: Session, request: Request) -> Response:
    body = await _body(request)
    span = read_record(list[float], body.get("span", []), "span")
    if not (len(span) == 2 and span[0] < span[1]):
        raise ParameterError("cut: choose a range of time.")
    return JSONResponse({"id": session.cut(request.path_params["id"], (span[0], span[1]))})


async def _fit(session: Session, request: Request) -> Response:
    body = await _body(request)
    recordings, verify = (read_record(list[str], body.get(name, []), name) for name in ("recordings", "verify"))
    start = body.get("start") or None
    (verb,) = _texts(body, "verb")
    id_ = session.fit(verb, recordings, verify, start, body.get("options", {}))
    return JSONResponse({"id": id_})


async def _choices(session: Session, request: Request) -> Response:
    """The parameters that a fit may free; in a thread, as the model may have to be derived first."""
    body = await _body(request)
    verb, free = _texts(body, "verb", "free")
    offered = await asyncio.to_thread(session.choices, verb, free, body.get("start") or None, body.get("options", {}))
    return Response(json_text(offered), media_type="application/json")


async def _observe(session: Session, request: Request) -> Response:
    body = await _body(request)
    recording, start, method = _texts(body, "recording", "start", "method")
    return JSONResponse({"id": session.observe(recording, start, method, force=bool(body.get("force")))})


async def _cancel(session: Session, request: Request) -> Response:
    return JSONResponse({"cancelled": session.jobs.cancel(request.path_params["id"])})


async def _export(session: Session, request: Request) -> Response:
    to, method = _texts(await _body(request), "to", "method")
    session.export(request.path_params["id"], to, method)
    return JSONResponse({})


async def _result_file(session: Session, request: Request) -> Response:
    id_, name = request.path_params["id"], request.path_params["name"]
    path, result = session.file_of(id_, name)
    if path.suffix == ".html":
        return FileResponse(path, media_type="text/html", headers={"content-security-policy": REPORT_POLICY})
    return FileResponse(path, headers=_attachment(uploads.download_name(result.name, name)))


def _attachment(name: str) -> dict[str, str]:
    """The Content-Disposition header of a download, for any letters in its name."""
    return {"content-disposition": f"attachment; filename*=UTF-8''{quote(name, safe='')}"}


async def _body(request: Request) -> dict[str, Any]:
    """The object in the body of a request.

    Raises
    ------
    ParameterError
        If it is no JSON object, or a large one.
    """
    length = request.headers.get("content-length", "")
    if not length.isdigit() or int(length) > _LARGEST_BODY:
        raise ParameterError("this request is too large, or its length is not given.")
    try:
        body = json.loads(await request.body())
    except (ValueError, RecursionError):
        body = None
    if not isinstance(body, dict):
        raise ParameterError("this request is not a JSON object.")
    return body


def _texts(body: dict[str, Any], *names: str) -> tuple[str, ...]:
    """Entries of an object that are texts."""
    return tuple(read_record(str, body.get(name), name) for name in names)


def bound(port: int) -> socket.socket:
    """A socket that this machine alone reaches; port 0 takes any that is free.

    Raises
    ------
    ParameterError
        If the port is in use or may not be used.
    """
    listener = socket.socket(proto=socket.IPPROTO_TCP)  # known to asyncio as TCP, it sends small answers at once
    try:
        listener.bind((LOOPBACK[0], port))
        listener.listen(128)
    except (OSError, OverflowError) as error:
        listener.close()
        reason = reason_of(error) if isinstance(error, OSError) else "no such port"
        raise ParameterError(
            f"--port {port}: cannot be used ({reason}); name another, or leave --port out for a free one."
        ) from error
    return listener


def serve(
    files: Sequence[Path], below: Path, base: Path, say: Callable[[str], None],
    *, port: int = 0, browser: bool = True, keep: bool = False, project: bool = False,
    trace: Callable[[str], None] = lambda _: None,
) -> Path:  # fmt: skip
    """Serve the page until the process is interrupted; the folder of the server, which is left only with `keep`.

    Parameters
    ----------
    files, below
        Recordings and calibrations that are opened, and the folder whose files may be opened by path.
    base
        Where the folder of the server is made.
    say
        Called with the address once the page is there.
    trace
        Called with the traceback of an error in a job that nobody expected.
    port
        Of this machine; 0 for any that is free.
    project
        Whether recordings, maps and results are kept in the folder `below` for the next server.

    Raises
    ------
    DataError
        If a file or the folder is not there.
    ParameterError, ExportError
        If the port cannot be used, or no folder can be made.
    """
    for path, option in ((below, "--folder"), *((file, "") for file in files)):
        not_an_address(path, option)
    if not below.is_dir():
        raise DataError(f"--folder {below}: there is no such folder.")
    for file in files:
        if not file.is_file():
            raise DataError(f"{file}: there is no such file.")
    listener = bound(port)
    folder = project_folder(below.resolve()) if project else new_folder(base)
    try:
        access = Access(listener.getsockname()[1])

        def begun() -> None:
            say(access.address)
            if browser:
                webbrowser.open(opening_page(folder, access.address).as_uri())

        app = application(
            Session(folder, below, [file.absolute() for file in files], trace, project=project), access, begun
        )
        config = uvicorn.Config(app, log_level="critical", access_log=False, timeout_graceful_shutdown=1, ws="none")
        with contextlib.suppress(KeyboardInterrupt):  # uvicorn raises it again when it has ended
            uvicorn.Server(config).run(sockets=[listener])
    finally:
        listener.close()
        end_folder(folder, keep=keep, project=project)
    return folder
