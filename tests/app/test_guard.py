"""Who may ask the server: each way in that another page or user could try is refused."""

import mimetypes
import re

import pytest

from clutchid.app.guard import CONTENT_POLICY, HEADERS, LOOPBACK, Access, names_of, warning_of
from clutchid.app.server import application, bound
from clutchid.errors import ParameterError

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


@pytest.fixture
def open_to_others(idle):
    """The server as it is with `--host` 10.1.2.3, a machine called lab."""
    names = names_of("10.1.2.3", "Lab")
    idle.access = Access(PORT, names, idle.access.token, idle.access.cookie)
    idle.app.access = idle.access
    return idle


@pytest.mark.parametrize("host", [f"10.1.2.3:{PORT}", f"lab:{PORT}"])
@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/api/events", "/api/tables/x", "/static/main.js"])
def test_with_another_host_nothing_is_answered_without_the_token(open_to_others, host, path):
    assert open_to_others.ask("GET", path, host=host, cookie=False).status == 403


def test_with_another_host_the_token_opens_the_page_and_changes_need_the_same_origin(open_to_others):
    host = f"10.1.2.3:{PORT}"
    address = open_to_others.access.address
    assert address == f"http://{host}/?token={open_to_others.access.token}"
    opened = open_to_others.ask("GET", address.partition(host)[2], host=host, cookie=False)
    assert (opened.status, "HttpOnly" in opened.headers["set-cookie"]) == (303, True)
    assert open_to_others.ask("GET", "/", host=host).status == 200
    assert open_to_others.ask(*CHANGE, host=host).status == 422
    assert open_to_others.ask(*CHANGE, host=host, origin=f"http://127.0.0.1:{PORT}").status == 403
    for other in (f"127.0.0.1:{PORT}", f"evil.example:{PORT}", "10.1.2.3"):
        assert open_to_others.ask("GET", "/", host=other).status == 421


def test_only_a_server_that_others_can_reach_warns():
    assert warning_of("127.0.0.1", names_of("127.0.0.1", "localhost")) == ""
    said = warning_of("10.1.2.3", names_of("10.1.2.3", "10.1.2.3"))
    assert "other machines can reach this page, as 10.1.2.3. It asks everyone for the token" in said
    assert "nothing is encrypted" in said
    assert "other machines can reach this page" in warning_of("0.0.0.0", LOOPBACK)


def test_all_addresses_are_those_of_this_machine_and_no_wildcard():
    names = names_of("0.0.0.0", "0.0.0.0")
    assert names[:2] == LOOPBACK
    assert "0.0.0.0" not in names


@pytest.mark.parametrize(
    ("host", "address"), [("127.0.0.1", "127.0.0.1"), ("localhost", "127.0.0.1"), ("0.0.0.0", "0.0.0.0")]
)
def test_the_server_listens_where_it_is_told_and_on_this_machine_by_default(host, address):
    for listener in (bound(0, host), *([bound(0)] if host == "127.0.0.1" else [])):
        with listener:
            assert listener.getsockname()[0] == address


@pytest.mark.parametrize("host", ["192.0.2.1", "no.such.name.invalid", "::1", "a" * 300])
def test_a_host_that_is_not_this_machine_is_a_sentence(host):
    with pytest.raises(ParameterError, match="is no name or IPv4 address of this machine"):
        bound(0, host)
