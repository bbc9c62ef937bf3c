"""SHELL: the pictures for a browser, as MJPEG, with what was detected drawn in.

For setting a camera up. Drawing and compression happen in the threads of those who look: the detector's thread hands a
picture over, and does nothing while no one looks.
"""

from __future__ import annotations

import hmac
import logging
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import cv2

from fwav_companion.vision.images import Found, Pixels
from fwav_companion.vision.preview_address import PreviewAddress

_log = logging.getLogger(__name__)
INTERVAL_S = 0.2
"""Five pictures a second at most."""
MOST_WATCHERS = 4
SEND_S = 5.0
"""Longest time for a browser to take a picture; then it is disconnected."""
WAIT_S = 2.0
"""Longest wait for a picture; the last one is sent again then, which shows whether the browser is still there."""
QUALITY = 70
BOUNDARY = "picture"
GREEN = (64, 255, 64)
Shown = tuple[Pixels, list[Found]]


class Preview:
    """The newest picture, and the server that shows it."""

    def __init__(self, address: PreviewAddress) -> None:
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

    def offer(self, pixels: Pixels, found: list[Found]) -> None:
        """Show a picture to those who look; the caller does not change it afterwards."""
        if self._watchers:
            with self._changed:
                self._shown, self._number = (pixels, found), self._number + 1
                self._changed.notify_all()

    def close(self) -> None:
        """Stop the server."""
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()

    def accepts(self, path: str) -> bool:
        """Whether a request's path has the token."""
        return hmac.compare_digest(path.encode(), f"/{self._token}".encode())

    def enter(self) -> bool:
        """Count one who looks; False where there are enough."""
        with self._changed:
            free = self._watchers < MOST_WATCHERS
            self._watchers += free
            return free

    def leave(self) -> None:
        """Forget one who looked."""
        with self._changed:
            self._watchers -= 1

    def newer_than(self, number: int) -> tuple[int, Shown | None]:
        """The newest picture and its number, as soon as there is one after ``number``; else the same after a while."""
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

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a browser that went away."""


def _handler_of(preview: Preview) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        timeout = SEND_S

        def do_GET(self) -> None:
            if not preview.accepts(self.path):
                self.send_error(404)
            elif not preview.enter():
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
            while True:
                number, shown = preview.newer_than(number)
                if shown is not None:
                    data = drawn(*shown)
                    head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
                    self.wfile.write(head.encode() + data + b"\r\n")
                time.sleep(INTERVAL_S)

    return Handler


def drawn(pixels: Pixels, found: list[Found]) -> bytes:
    """The picture as JPEG, with boxes, points and labels of what was detected."""
    shown = cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if pixels.ndim == 2 else pixels.copy()
    for each in found:
        place = (round(each["u"]), round(each["v"]))
        cv2.drawMarker(shown, place, GREEN, cv2.MARKER_CROSS, 9, 1)
        if "box" in each:
            left, top, right, bottom = (round(side) for side in each["box"])
            cv2.rectangle(shown, (left, top), (right, bottom), GREEN, 1)
        text = f"{each.get('label', '')} {each['score']:.2f}" if "score" in each else str(each.get("label", ""))
        cv2.putText(shown, text, (place[0] + 6, place[1] - 6), cv2.FONT_HERSHEY_SIMPLEX, 0.4, GREEN, 1)
    return bytes(cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1])
