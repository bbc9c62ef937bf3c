"""Connections to the server of `ground`: which it closes, for whom, and what it logs of them."""

from __future__ import annotations

import contextlib
import logging
import socket
import time

import pytest

pytest.importorskip("aiohttp")

from ground_server import get, picture_of_a_target, served

from fwav_companion.ground import connections, guarded_site


@pytest.fixture
def picture():
    return picture_of_a_target()


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
