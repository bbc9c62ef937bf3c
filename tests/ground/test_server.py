"""The server over real HTTP: what it answers, to whom, and its bounds."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import logging
import socket
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager

import pytest
from processes import free_port
from tile_files import PNG, tile_file

pytest.importorskip("aiohttp")

from fwav_companion.errors import UserError
from fwav_companion.ground import connections, ground_process, guarded_site
from fwav_companion.ground import server as limits
from fwav_companion.ground.access import COOKIE, AccessRules
from fwav_companion.ground.ground_process import GroundOptions, GroundProcess, PictureInput
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.tiles import TileFile
from fwav_companion.ground.views import TargetView


@contextmanager
def served(picture: GroundPicture, token: str = "", tiles: TileFile | None = None, inputs: Sequence[PictureInput] = ()):
    """The port of a server of this picture, in a thread of its own."""
    port, ready = free_port(), threading.Event()
    loop = asyncio.new_event_loop()
    stop = asyncio.Event()
    options = GroundOptions(host="127.0.0.1", port=port, token=token, rate_hz=10.0)
    process = GroundProcess(picture, inputs, options, clock=time.time, tiles=tiles)
    thread = threading.Thread(target=lambda: loop.run_until_complete(process.run(stop, ready.set)))
    thread.start()
    try:
        assert ready.wait(20.0)
        yield port
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join(20.0)
        loop.close()


def get(port: int, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)) as connection:
        connection.request("GET", path, headers=headers)
        response = connection.getresponse()
        return response.status, dict(response.getheaders()), response.read()


@pytest.fixture
def picture():
    made = GroundPicture()
    made.on_target(
        TargetView(
            id="1/4", vehicle="1", state="confirmed", lat=48.1, lon=11.5, first_unix=time.time(),
            seen_unix=time.time(), source="status",
        ),
        time.time(),
    )  # fmt: skip
    return made


@pytest.fixture
def port(picture):
    with served(picture) as at:
        yield at


def events(port: int, count: int) -> list[tuple[str, object]]:
    """The first events of a page."""
    found, name = [], ""
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)) as connection:
        connection.request("GET", "/events")
        response = connection.getresponse()
        while len(found) < count:
            line = response.readline().decode().rstrip("\n")
            if line.startswith("event: "):
                name = line[7:]
            elif line.startswith("data: "):
                found.append((name, json.loads(line[6:])))
    return found


def test_the_page_and_its_files_come_with_a_strict_policy(port):
    status, headers, body = get(port, "/")
    assert status == 200
    assert b"<!doctype html>" in body
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    for name in limits.PAGE_FILES:
        assert get(port, f"/page/{name}")[0] == 200
    assert get(port, "/page/app.js")[1]["Content-Type"].startswith("text/javascript")


@pytest.mark.parametrize("path", ["/page/../server.py", "/page/%2e%2e/server.py", "/page/index.html", "/nothing"])
def test_no_other_file_is_served(port, path):
    status, headers, _ = get(port, path)
    assert status == 404
    assert "Content-Security-Policy" in headers


def test_events_bring_the_paths_and_the_picture(port, picture):
    (first, _), (second, update) = events(port, 2)
    assert (first, second) == ("paths", "picture")
    assert update["whole"]
    assert update["targets"][0]["id"] == "1/4"


def test_history_and_exports(port):
    assert len(json.loads(get(port, "/history.json?target=1/4")[2])) == 1
    assert json.loads(get(port, "/history.json?target=unknown")[2]) == []
    for kind in ("geojson", "kml", "csv"):
        status, headers, body = get(port, f"/export/{kind}")
        assert status == 200
        assert b"48.1" in body
        assert "attachment" in headers["Content-Disposition"]
    assert get(port, "/export/exe")[0] == 404


@pytest.mark.parametrize(
    ("utc_ns", "status", "words"), [(None, 503, b"synchronise"), (1_790_000_000 * 10**9, 200, b"<event")]
)
def test_cursor_on_target_without_utc_is_503_with_the_reason(picture, monkeypatch, utc_ns, status, words):
    monkeypatch.setattr(ground_process, "utc_ns", lambda: utc_ns)
    with served(picture) as port:
        found, _, body = get(port, "/export/cot")
    assert (found, words in body) == (status, True)


@pytest.mark.parametrize(
    "headers",
    [{"Host": "evil.example:80"}, {"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Origin": "null"},
     {"Sec-Fetch-Site": "cross-site"}],
)  # fmt: skip
def test_requests_of_other_sites_are_refused(port, headers):
    assert get(port, "/settings.json", **headers)[0] == 403


def test_only_reading_is_answered(port):
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)) as connection:
        connection.request("POST", "/events", body=b"x")
        assert connection.getresponse().status == 405


def test_the_token_is_required_and_kept_in_a_cookie(picture):
    with served(picture, token="secret") as port:
        host = f"127.0.0.1:{port}"
        assert get(port, "/", Host=host)[0] == 403
        assert get(port, "/?token=wrong", Host=host)[0] == 403
        status, headers, _ = get(port, "/?token=secret", Host=host)
        assert status == 200
        cookie = headers["Set-Cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        assert get(port, "/settings.json", Host=host, Cookie=cookie.partition(";")[0])[0] == 200


def test_hosts_of_a_public_address_are_addresses_and_own_names():
    rules = AccessRules(host="0.0.0.0", port=8080, token="t", names=("laptop", "laptop.local"))
    for host in ("192.168.1.7:8080", "[fe80::1]:8080", "laptop:8080", "laptop.local:8080"):
        assert rules.refusal({"Host": host}, "t", "") is None
    for host in ("evil.example:8080", "192.168.1.7:81", "192.168.1.7", ""):
        assert rules.refusal({"Host": host}, "t", "") is not None


def test_pages_are_bounded(port, monkeypatch):
    monkeypatch.setattr(limits, "MAX_CLIENTS", 2)
    opened = [http.client.HTTPConnection("127.0.0.1", port, timeout=20.0) for _ in range(3)]
    statuses = []
    for connection in opened:
        connection.request("GET", "/events")
        statuses.append(connection.getresponse().status)
    for connection in opened:
        connection.close()
    assert statuses == [200, 200, 503]


def test_tiles_are_counted_from_the_north(tmp_path, picture):
    tiles = TileFile(tile_file(tmp_path / "a.mbtiles", format="png", attribution="<a href='x'>Map</a> makers"))
    assert tiles.info.attribution == "Map makers"
    with served(picture, tiles=tiles) as port:
        status, headers, body = get(port, "/tiles/2/1/0")  # row 3 from the south of four
        assert (status, headers["Content-Type"], body) == (200, "image/png", PNG)
        assert get(port, "/tiles/2/1/3")[0] == 404
        assert get(port, "/tiles/99/1/3")[0] == 404
        assert json.loads(get(port, "/settings.json")[2])["tiles"]["max_zoom"] == 2


def test_a_tile_that_takes_long_holds_up_no_other_request(tmp_path, picture):
    tiles, answered, asked = (
        TileFile(tile_file(tmp_path / "a.mbtiles", format="png")),
        threading.Event(),
        threading.Event(),
    )
    look_up = tiles.tile

    def slow(*place: int) -> tuple[str, bytes] | None:
        asked.set()
        assert answered.wait(20.0)
        return look_up(*place)

    tiles.tile = slow
    with served(picture, tiles=tiles) as port, ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(get, port, "/tiles/2/1/0")
        assert asked.wait(20.0)
        assert get(port, "/settings.json")[0] == 200
        assert not waiting.done()
        answered.set()
        assert waiting.result(20.0)[2] == PNG


def test_a_taken_port_is_one_line(port, picture):
    options = GroundOptions(host="127.0.0.1", port=port, token="", rate_hz=5.0)
    process = GroundProcess(picture, [], options, clock=time.time)
    with pytest.raises(UserError, match="accepted: a free port"):
        asyncio.run(process.run(asyncio.Event(), lambda: None))


def waiting(port: int, count: int) -> list[socket.socket]:
    """Connections with half a request each."""
    opened = [socket.create_connection(("127.0.0.1", port), 20.0) for _ in range(count)]
    for each in opened:
        each.sendall(b"GET / HTTP/1.1\r\nHost: ")
    return opened


def is_closed(opened: socket.socket) -> bool:
    """Whether the server closes a connection; with bytes unread its end is a reset."""
    with opened, contextlib.suppress(ConnectionResetError):
        return opened.recv(1) == b""
    return True


def test_server_closes_connections_without_a_request_and_the_newest_of_too_many(picture, monkeypatch):
    monkeypatch.setattr(connections, "REQUEST_S", 1.0)
    with served(picture) as port:
        opened = waiting(port, connections.MOST_WAITING + 20)
        assert all(map(is_closed, opened[connections.MOST_WAITING :])), "closed at the next sweep"
        assert get(port, "/")[0] == 200, "a page that is opened meanwhile is served"
        assert all(map(is_closed, opened[: connections.MOST_WAITING]))


def test_half_requests_of_one_host_keep_no_browser_of_another_out(picture):
    """The newest of all were closed: a browser that came during a flood had no answer."""
    with served(picture) as port:
        flood = [
            socket.create_connection(("127.0.0.1", port), 20.0, source_address=("127.0.0.2", 0))
            for _ in range(3 * connections.MOST_WAITING)
        ]
        with socket.create_connection(("127.0.0.1", port), 20.0) as browser:
            assert all(map(is_closed, flood[connections.MOST_WAITING :]))
            browser.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            assert browser.recv(100).startswith(b"HTTP/1.1 200")
        for each in flood:
            each.close()


def test_server_keeps_a_page_that_reads_for_longer_than_a_request_may_take(picture, monkeypatch):
    monkeypatch.setattr(connections, "REQUEST_S", 0.2)
    with served(picture) as port, socket.create_connection(("127.0.0.1", port), 20.0) as page:
        page.sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        received = b""
        for _ in range(3):
            time.sleep(0.3)
            received += page.recv(65536)
        assert received.startswith(b"HTTP/1.1 200")
        assert received.count(b"data:") >= 2


def test_a_stranger_without_the_token_keeps_no_connection(picture):
    with served(picture, token="t" * 16) as port, socket.create_connection(("127.0.0.1", port), 20.0) as stranger:
        stranger.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        received = b""
        while data := stranger.recv(4096):  # to the end of the connection
            received += data
        assert received.startswith(b"HTTP/1.1 403")


def test_an_answered_connection_without_a_further_request_is_closed(picture, monkeypatch):
    monkeypatch.setattr(guarded_site, "IDLE_S", 0.2)
    with served(picture) as port, socket.create_connection(("127.0.0.1", port), 20.0) as page:
        page.sendall(f"GET /page/style.css HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        while page.recv(65536):
            pass


@pytest.mark.parametrize(
    "cookie", [b"\xff\xfe", b"\xed\xa0\x80", "fwav=\xe4".encode("latin-1")], ids=["bytes", "surrogate", "latin-1"]
)
def test_cookie_of_invalid_bytes_is_refused_as_a_wrong_token(picture, cookie):
    with served(picture, token="t" * 16) as port, socket.create_connection(("127.0.0.1", port), 20.0) as stranger:
        head = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nCookie: {COOKIE}=".encode()
        stranger.sendall(head + cookie + b"\r\nConnection: close\r\n\r\n")
        assert b" 403 " in stranger.recv(4096)


def test_errors_of_the_library_are_one_short_line_a_second_with_the_number_left_out(caplog, monkeypatch):
    seconds = [100.0]
    monkeypatch.setattr(connections.time, "monotonic", lambda: seconds[0])
    log = connections.QuietLog(logging.getLogger("fwav_companion.ground"))
    for number in range(30):
        seconds[0] += 0.1
        try:
            raise ValueError(f"Bad status line {number}\n" + 500 * "x")
        except ValueError as error:
            log.exception("Error handling request from %s", "10.0.0.9", exc_info=error)
    assert len(caplog.records) == 3
    assert all(record.exc_info is None and len(record.getMessage()) < 200 for record in caplog.records)
    assert caplog.records[0].getMessage().startswith("ground: bad request: Bad status line 0 xxx")
    assert caplog.records[1].getMessage().endswith("(10 more)")


class FaultyInput:
    """An input whose every step fails."""

    steps = 0

    def start(self) -> None:
        asyncio.get_running_loop().call_soon(self.tick, 0.0)

    def tick(self, now: float) -> None:
        self.steps += 1
        raise ZeroDivisionError("a stranger's bytes")

    def close(self) -> None:
        pass


def test_an_input_that_fails_at_each_step_ends_neither_the_page_nor_fills_the_log(picture, caplog):
    faulty = FaultyInput()
    with served(picture, inputs=[faulty]) as port:
        while faulty.steps < 4:
            assert get(port, "/")[0] == 200
    lines = [record.getMessage() for record in caplog.records if "internal fault" in record.getMessage()]
    assert lines
    assert len([record for record in caplog.records if record.exc_info]) == 1, "one trace"


def test_bad_requests_write_no_traceback(picture, caplog):
    with served(picture) as port, caplog.at_level("INFO"):
        for request in (
            b"\x16\x03\x01 nonsense \xff\r\n\r\n",
            b"GET / HTTP/9.9\r\n\r\n",
            b"GET / HTTP/1.1\r\n: x\r\n\r\n",
        ):
            with socket.create_connection(("127.0.0.1", port), 20.0) as stranger:
                stranger.sendall(request)
                assert stranger.recv(4096)[:12] in (b"HTTP/1.0 400", b"HTTP/1.1 400", b"HTTP/1.1 505")
    assert [record for record in caplog.records if record.exc_info is not None] == []
