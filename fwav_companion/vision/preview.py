"""SHELL: serves the pictures to a browser, as MJPEG, with detections and tracks drawn in.

It serves to set a camera up. Drawing and compression run in one thread for each browser, which also asks the daemon
where its picture shows the tracks. The detector's thread hands pictures over, if any browser is connected.
"""

from __future__ import annotations

import hmac
import logging
import select
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import msgspec

from fwav_companion.http_hosts import is_loopback, name_and_port
from fwav_companion.types.track_marks import MARKS_QUESTION, TrackMark, TrackMarks
from fwav_companion.vision.images import Found, Picture, frame_bytes
from fwav_companion.vision.preview_address import PreviewAddress
from fwav_companion.vision.preview_drawing import drawn

_log = logging.getLogger(__name__)
INTERVAL_S = 0.2
"""Shortest interval of pictures, seconds: at most five a second."""
MOST_WATCHERS = 4
MOST_CONNECTIONS = 8
"""Most connections, each with a thread, before and after their requests: a browser opens one or two in advance."""
SEND_S = 5.0
"""Longest time for a browser to take a picture, and from its connection to its request with the token; then it is
disconnected."""
WAIT_S = 2.0
"""Longest wait for a picture; the last one is sent again then, which shows whether the browser is still there."""
ANSWER_S = 0.1
"""Longest wait for the daemon's answer, which takes some milliseconds; then the picture is shown without tracks."""
BOUNDARY = "picture"
Shown = tuple[Picture, list[Found]]

_decode = msgspec.json.Decoder(TrackMarks).decode


class Preview:
    """The newest picture, and the server that shows it."""

    def __init__(self, address: PreviewAddress, ask: Callable[[bytes], None] | None = None) -> None:
        """``ask``: sends the daemon a question about tracks, whose answer comes by :meth:`on_marks`."""
        self._ask = ask
        self._marks = TrackMarks(0, ())
        self._answered = threading.Condition()
        self._changed = threading.Condition()
        self._shown: Shown | None = None
        self._number = 0
        self._watchers = 0
        self._token = address.token
        try:
            self._server: ThreadingHTTPServer | None = _Server((address.host, address.port), _handler_of(self))
        except OSError as error:
            self._server = None
            _log.warning("[vision] preview %s:%d: %s", address.host, address.port, error.strerror or error)
            return
        threading.Thread(target=self._server.serve_forever, name="preview", daemon=True).start()

    @property
    def port(self) -> int:
        """Port of the server; 0 where it could not listen."""
        return self._server.server_address[1] if self._server is not None else 0

    def offer(self, picture: Picture, found: list[Found]) -> None:
        """Show a picture to the connected browsers; the caller does not change it afterwards."""
        if self._watchers:
            with self._changed:
                self._shown, self._number = (picture, found), self._number + 1
                self._changed.notify_all()

    def on_marks(self, message: bytes) -> None:
        """Take the daemon's answer: where a picture shows the tracks."""
        with self._answered:
            self._marks = _decode(message)
            self._answered.notify_all()

    def marks_of(self, number: int, picture: Picture) -> tuple[TrackMark, ...]:
        """The tracks in a picture; none where the daemon does not answer in time."""
        if self._ask is None:
            return ()
        with self._answered:
            if self._marks.picture != number:
                self._ask(MARKS_QUESTION + frame_bytes(picture, [], number) + b"}")
                self._answered.wait_for(lambda: self._marks.picture == number, ANSWER_S)
            return self._marks.marks if self._marks.picture == number else ()

    def close(self) -> None:
        """Stop the server."""
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()

    def accepts(self, path: str, host: str) -> bool:
        """Whether a request's path has the token. Without one, its Host must be a name of loopback, which that of
        another site is not that lets its own name resolve to this address (DNS rebinding).
        """
        if not self._token and not is_loopback(name_and_port(host.lower())[0]):
            return False
        return hmac.compare_digest(path.encode(), f"/{self._token}".encode())

    def enter(self) -> bool:
        """Count a further browser; False if there are MOST_WATCHERS already."""
        with self._changed:
            free = self._watchers < MOST_WATCHERS
            self._watchers += free
            return free

    def leave(self) -> None:
        """Count one browser less."""
        with self._changed:
            self._watchers -= 1

    def newer_than(self, number: int) -> tuple[int, Shown | None]:
        """The newest picture and its number, as soon as one after ``number`` exists; else the same one after WAIT_S."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > number, WAIT_S)
            return self._number, self._shown


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        if ":" in address[0]:
            self.address_family = socket.AF_INET6
        super().__init__(address, handler)
        self._connections = threading.BoundedSemaphore(MOST_CONNECTIONS)
        self._waiting: dict[socket.socket, float] = {}
        """Start of each connection that has not sent the token, the oldest first, seconds."""

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a connection in a thread of its own; where there are MOST_CONNECTIONS, the oldest without the token
        is closed for it, so that strangers keep no browser out.
        """
        if not self._connections.acquire(blocking=False):
            for oldest in list(self._waiting)[:1]:
                self._end(oldest)
            if not self._connections.acquire(timeout=ANSWER_S):
                self.shutdown_request(request)
                return
        self._waiting[request] = time.monotonic()
        super().process_request(request, client_address)

    def service_actions(self) -> None:
        """Close the connections that have not sent the token in SEND_S; called twice a second."""
        now_s = time.monotonic()
        for request, since_s in list(self._waiting.items()):
            if now_s > since_s + SEND_S:
                self._end(request)

    def on_token(self, request: Any) -> None:
        """Keep a connection that has sent the token."""
        self._waiting.pop(request, None)

    def _end(self, request: socket.socket) -> None:
        """Let the thread of a connection read its end."""
        self._waiting.pop(request, None)
        with suppress(OSError):  # the browser has closed it already
            request.shutdown(socket.SHUT_RDWR)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer a connection to its end."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._waiting.pop(request, None)
            self._connections.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a browser that went away."""


def _has_left(connection: socket.socket) -> bool:
    """Whether a browser has closed its connection: while no picture comes, no write shows it."""
    poll = select.poll()  # a socket with a timeout waits in recv, whatever its flags say
    poll.register(connection, select.POLLIN)
    return bool(poll.poll(0)) and not connection.recv(1, socket.MSG_PEEK)


def _handler_of(preview: Preview) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        timeout = SEND_S

        def do_GET(self) -> None:
            if not preview.accepts(self.path, self.headers.get("Host", "")):
                self.send_error(404)
                return
            if isinstance(self.server, _Server):
                self.server.on_token(self.request)
            if not preview.enter():
                self.send_error(503, "enough browsers look already")
            else:
                try:
                    self._stream()
                finally:
                    preview.leave()

        def log_message(self, *_: Any) -> None:
            """Log no request."""

        def _stream(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            number = 0
            while not _has_left(self.connection):
                number, shown = preview.newer_than(number)
                if shown is not None:
                    picture, found = shown
                    data = drawn(picture.pixels, found, preview.marks_of(number, picture))
                    head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
                    self.wfile.write(head.encode() + data + b"\r\n")
                time.sleep(INTERVAL_S)

    return Handler
