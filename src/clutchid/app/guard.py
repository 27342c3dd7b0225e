"""`Guard`: access control of the server, and the content policy of the page.

Any page that the browser has open can send requests to a server on this machine, and so can other users of it. So every
request needs the cookie, which the browser gets once for the token that only the terminal shows; a request for another
host is refused (DNS rebinding), and so is a change from another origin or without a header that a form cannot send.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Iterable
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: Nothing from elsewhere, no text that becomes a script, no frame around the page.
CONTENT_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

#: A report has scripts and styles within it: they run without an origin, and can load nothing.
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"
)

HEADERS = {
    "content-security-policy": CONTENT_POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}

#: The header that only scripts of the page send.
_OURS = "x-clutchid"

_SAFE = ("GET", "HEAD")

#: Names under which only this machine reaches itself.
LOOPBACK = ("127.0.0.1", "localhost")


def new_secret() -> str:
    """A random secret for an address."""
    return secrets.token_urlsafe(32)


@dataclass(frozen=True, slots=True)
class Access:
    """Access to the server at a port: the token of the printed address, and the cookie that replaces it."""

    port: int
    token: str = field(default_factory=new_secret)
    cookie: str = field(default_factory=new_secret)

    @property
    def name(self) -> str:
        """Name of the cookie; browsers keep cookies by host, so each server needs its own."""
        return f"clutchid-{self.port}"

    @property
    def address(self) -> str:
        """The address that opens the page."""
        return f"http://{LOOPBACK[0]}:{self.port}/?token={self.token}"

    @property
    def hosts(self) -> tuple[str, ...]:
        """Host headers that are accepted."""
        return tuple(f"{name}:{self.port}" for name in LOOPBACK)


class Guard:
    """The application behind its checks; see the module."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self.app, self.access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it with a sentence."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":  # no web sockets
            return
        refused = self._refused(scope)

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        await (refused or self.app)(scope, receive, guarded)

    def _refused(self, scope: Scope) -> Response | None:
        """Response that refuses a request, or opens the page by its token; None to let the request through."""
        headers, access = Headers(scope=scope), self.access
        host = headers.get("host", "")
        if host not in access.hosts:
            return PlainTextResponse("This server answers requests of this machine only.", 421)
        if scope["method"] == "GET" and scope["path"] == "/":
            tokens = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
            if tokens:
                return self._opened(tokens[0])
        if not self._knows(headers.getlist("cookie")):
            return PlainTextResponse("Open the address that `clutchid app` has printed: it contains a token.", 403)
        ours = headers.get("origin") == f"http://{host}" and headers.get(_OURS) is not None
        if scope["method"] not in _SAFE and not ours:
            return PlainTextResponse("Only the page of this server may change anything.", 403)
        return None

    def _opened(self, token: str) -> Response:
        if not _same(token, self.access.token):
            return PlainTextResponse("This token is unknown: open the address that `clutchid app` printed last.", 403)
        answer = RedirectResponse("/", 303)  # the token stays neither in the address bar nor in the history
        answer.set_cookie(self.access.name, self.access.cookie, httponly=True, samesite="strict", path="/")
        return answer

    def _knows(self, cookies: Iterable[str]) -> bool:
        for text in cookies:
            try:
                cookie = SimpleCookie(text).get(self.access.name)
            except CookieError:
                continue
            if cookie is not None and _same(cookie.value, self.access.cookie):
                return True
        return False


def _same(received: str, secret: str) -> bool:
    """Whether two secrets are the same, in constant time."""
    return hmac.compare_digest(received.encode("utf-8", "replace"), secret.encode())
