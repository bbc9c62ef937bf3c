"""The server over real HTTP: what it answers, and to whom."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest
from tile_files import PNG, tile_file

pytest.importorskip("aiohttp")

from ground_server import get, picture_of_a_target, served

from fwav_companion.errors import UserError
from fwav_companion.ground import ground_process
from fwav_companion.ground import server as limits
from fwav_companion.ground.access import COOKIE, AccessRules
from fwav_companion.ground.ground_process import GroundOptions, GroundProcess
from fwav_companion.ground.tiles import TileFile


@pytest.fixture
def picture():
    return picture_of_a_target()


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


@pytest.mark.parametrize(
    "cookie", [b"\xff\xfe", b"\xed\xa0\x80", "fwav=\xe4".encode("latin-1")], ids=["bytes", "surrogate", "latin-1"]
)
def test_cookie_of_invalid_bytes_is_refused_as_a_wrong_token(picture, cookie):
    with served(picture, token="t" * 16) as port, socket.create_connection(("127.0.0.1", port), 20.0) as stranger:
        head = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nCookie: {COOKIE}=".encode()
        stranger.sendall(head + cookie + b"\r\nConnection: close\r\n\r\n")
        assert b" 403 " in stranger.recv(4096)


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
