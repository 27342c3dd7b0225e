"""Who may ask the server: each way in that another page or user could try is refused."""

import mimetypes
import re

import pytest

from clutchid.app.guard import CONTENT_POLICY, HEADERS, Access
from clutchid.app.server import application, bound

#: Port of the server, see `Served`.
PORT = 8123

#: A request that changes something, and is refused for what it asks, not for who asks.
CHANGE = ("POST", "/api/fits", {"verb": "calibrate"})


def test_the_token_opens_the_page_once_and_leaves_the_address(idle):
    answer = idle.ask("GET", f"/?token={idle.access.token}", cookie=False)
    assert (answer.status, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(f"clutchid-{PORT}={idle.access.cookie};")
    assert {"HttpOnly", "SameSite=strict", "Path=/"} <= set(cookie.split("; "))
    assert idle.access.token not in cookie
    assert idle.ask("GET", "/", cookie=cookie.partition(";")[0]).status == 200


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/api/events", "/api/about", "/static/main.js"])
def test_nothing_is_answered_without_the_cookie(idle, path):
    answer = idle.ask("GET", path, cookie=False)
    assert answer.status == 403
    assert b"token" in answer.body
    assert "set-cookie" not in answer.headers


@pytest.mark.parametrize("cookie", ["clutchid-8123=", "clutchid-8123=wrong", "clutchid-8124={0}", "other={0}", '"=;;'])
def test_another_cookie_opens_nothing(idle, cookie):
    assert idle.ask("GET", "/", cookie=cookie.format(idle.access.cookie)).status == 403


@pytest.mark.parametrize(
    "host", ["evil.example", f"evil.example:{PORT}", "127.0.0.1", f"127.0.0.1:{PORT + 1}", "", f"[::1]:{PORT}"]
)
def test_another_name_of_this_machine_is_refused_as_by_dns_rebinding(idle, host):
    answer = idle.ask("GET", f"/?token={idle.access.token}", host=host)
    assert answer.status == 421
    assert "set-cookie" not in answer.headers


@pytest.mark.parametrize("host", [f"127.0.0.1:{PORT}", f"localhost:{PORT}"])
def test_both_names_of_this_machine_are_answered(idle, host):
    assert idle.ask("GET", "/", host=host).status == 200


@pytest.mark.parametrize(
    "origin", [None, "http://evil.example", "null", f"http://127.0.0.1:{PORT + 1}", f"https://127.0.0.1:{PORT}"]
)
@pytest.mark.parametrize(
    ("method", "path"), [("POST", "/api/fits"), ("PUT", "/api/recordings?name=a.csv"), ("DELETE", "/api/jobs/job-1")]
)
def test_a_change_from_another_origin_is_refused(idle, origin, method, path):
    assert idle.ask(method, path, {}, origin=origin).status == 403
    assert idle.session.board.since(0) == []


def test_a_change_without_our_header_is_refused_as_a_form_cannot_send_it(idle):
    assert idle.ask(*CHANGE, ours=False).status == 403
    assert idle.ask(*CHANGE).status == 422


@pytest.mark.parametrize(("path", "cookie"), [("/", True), ("/", False), ("/api/about", True), ("/nowhere", True)])
def test_every_answer_allows_the_page_its_own_files_only(idle, path, cookie):
    headers = idle.ask("GET", path, cookie=cookie).headers
    assert {name: headers.get(name) for name in HEADERS} == HEADERS
    assert "unsafe" not in CONTENT_POLICY
    assert CONTENT_POLICY.startswith("default-src 'none'; script-src 'self'; style-src 'self';")


def test_secrets_cannot_be_guessed_and_two_servers_have_two_cookies():
    first, other = Access(1), Access(2)
    assert len({first.token, first.cookie, other.token, other.cookie}) == 4
    assert all(len(text) >= 43 for text in (first.token, first.cookie))
    assert first.name != other.name
    assert re.fullmatch(r"http://127\.0\.0\.1:1/\?token=[\w-]+", first.address)


def test_a_web_socket_is_not_answered(idle):
    sent = []

    async def send(message):
        sent.append(message)

    idle.run(idle.app({"type": "websocket", "path": "/"}, None, send))
    assert sent == []


@pytest.mark.parametrize(
    "path", ["/static/../server.py", "/static/%2e%2e/server.py", "/static/..%2fguard.py", "/static//etc/passwd"]
)
def test_only_files_of_the_page_are_served(idle, path):
    assert idle.ask("GET", path).status == 404


def test_a_browser_runs_the_scripts_whatever_the_system_calls_them(idle):
    mimetypes.add_type("text/plain", ".js")  # as the registry of Windows may
    idle.app = application(idle.session, idle.access)
    assert idle.ask("GET", "/static/main.js").headers["content-type"].startswith("text/javascript")


def test_the_server_listens_on_this_machine_only():
    with bound(0) as listener:
        assert listener.getsockname()[0] == "127.0.0.1"
