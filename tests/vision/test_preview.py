"""The pictures in a browser: as an HTTP client gets them."""

import http.client
import json
import logging
import select
import socket
import threading
import time
from contextlib import suppress
from math import pi

import cv2
import msgspec
import numpy as np
import pytest

from fwav_companion.types.track_marks import MARKS_QUESTION, TrackMark, TrackMarks
from fwav_companion.vision import preview as module
from fwav_companion.vision.images import Picture
from fwav_companion.vision.preview import MOST_CONNECTIONS, Preview
from fwav_companion.vision.preview_address import PreviewAddress, parse_preview
from fwav_companion.vision.preview_drawing import drawn, ellipse_axes

TOKEN = "0123456789abcdef"
FOUND = {"u": 40.0, "v": 30.0, "label": "person", "score": 0.8, "box": [30.0, 20.0, 50.0, 40.0]}


class Daemon:
    """Answers each question about tracks, or none."""

    def __init__(self):
        self.questions, self.marks, self.preview = [], (), None

    def ask(self, question):
        assert question.startswith(MARKS_QUESTION)
        self.questions.append(json.loads(question)["shown"])
        if self.marks is not None:
            answer = TrackMarks(self.questions[-1]["picture"], self.marks)
            threading.Thread(target=self.preview.on_marks, args=(msgspec.json.encode(answer),)).start()


@pytest.fixture
def daemon():
    return Daemon()


@pytest.fixture
def preview(daemon):
    made = daemon.preview = Preview(PreviewAddress("127.0.0.1", 0, TOKEN), daemon.ask)
    yield made
    made.close()


def picture(pixels):
    return Picture(pixels, {"time_monotonic": 3.5}, 7)


def looking(preview, path=f"/{TOKEN}"):
    connection = http.client.HTTPConnection("127.0.0.1", preview.port, timeout=10)
    connection.request("GET", path)
    return connection, connection.getresponse()


def picture_of(response):
    """The next picture of the stream."""
    length = 0
    while True:
        line = response.fp.readline().strip()
        if line.startswith(b"Content-Length:"):
            length = int(line.split(b":")[1])
        if not line and length:
            return cv2.imdecode(np.frombuffer(response.fp.read(length), np.uint8), cv2.IMREAD_COLOR)


def test_a_browser_sees_the_newest_picture_with_what_was_detected(preview):
    connection, response = looking(preview)
    assert response.status == 200
    assert response.getheader("Content-Type") == "multipart/x-mixed-replace; boundary=picture"
    grey = np.full((60, 80), 100, np.uint8)
    preview.offer(picture(grey), [FOUND])
    shown = picture_of(response)
    assert shown.shape == (60, 80, 3)
    assert shown[20, 40, 1] > shown[20, 40, 2] + 50, "the box is drawn"
    assert (grey == 100).all(), "and not into the detector's own picture"
    begun_s = time.monotonic()
    for level in (10, 20, 30):
        preview.offer(picture(np.full((60, 80), level, np.uint8)), [])
    assert abs(float(picture_of(response).mean()) - 30.0) < 3.0
    assert time.monotonic() - begun_s > 0.1, "five a second at most"
    connection.close()


MARK = TrackMark(3, "click", "confirmed", True, (60.0, 30.0), (16.0, 0.0, 4.0))


def test_a_browser_sees_where_the_tracks_are(preview, daemon):
    """The ellipse of 95 %: 2.45 sigma of 4 px along u, of 2 px along v."""
    daemon.marks = (MARK,)
    connection, response = looking(preview)
    preview.offer(picture(np.full((60, 120), 100, np.uint8)), [])
    shown = picture_of(response).astype(int)
    (question,) = daemon.questions
    assert (question["time_monotonic"], question["frame"], question["detections"]) == (3.5, 7, [])
    reds = shown[..., 2] - shown[..., 1]
    for u, v in ((50, 30), (70, 30), (60, 25), (60, 35)):
        assert reds[v - 1 : v + 2, u - 1 : u + 2].max() > 60, (u, v)
    assert abs(reds[30, 20]) < 30
    connection.close()


def test_a_daemon_that_does_not_answer_leaves_the_picture_without_tracks(preview, daemon):
    daemon.marks = None
    connection, response = looking(preview)
    preview.offer(picture(np.full((60, 120), 100, np.uint8)), [])
    assert abs(float(picture_of(response).mean()) - 100.0) < 3.0
    connection.close()


@pytest.mark.parametrize(
    ("cov", "axes"),
    [
        ((9.0, 0.0, 4.0), (3.0, 2.0, 0.0)),
        ((4.0, 0.0, 9.0), (3.0, 2.0, pi / 2)),
        ((2.0, 1.0, 2.0), (3**0.5, 1.0, pi / 4)),
    ],
)
def test_axes_of_an_ellipse(cov, axes):
    assert ellipse_axes(cov) == pytest.approx(axes)


def test_an_ellipse_larger_than_any_picture_is_drawn_without_trouble():
    mark = TrackMark(3, "click", "coasting", False, (-5.0, 4000.0), (1e12, 0.0, 1e-3))
    assert drawn(np.zeros((60, 80), np.uint8), [], [mark])


def test_nothing_is_kept_or_asked_while_no_one_looks(preview, daemon):
    preview.offer(picture(np.zeros((60, 80), np.uint8)), [FOUND])
    assert preview._shown is None
    assert daemon.questions == []


@pytest.mark.parametrize("path", ["/", "/0123456789abcdeg", f"/{TOKEN}/", "/../etc/passwd"])
def test_without_the_token_nothing_is_shown(preview, path):
    connection, response = looking(preview, path)
    assert response.status == 404
    connection.close()


def test_a_browser_that_leaves_before_any_picture_gives_its_place_back(preview):
    connections = [looking(preview) for _ in range(module.MOST_WATCHERS)]
    for connection, response in connections:
        response.close()
        connection.close()
    deadline = time.monotonic() + 20.0
    while preview._watchers:
        assert time.monotonic() < deadline, "its place is kept"
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("host", "status"),
    [("localhost:8089", 200), ("127.0.0.1", 200), ("[::1]:8089", 200), ("attacker.example:8089", 404), ("", 404)],
)
def test_preview_without_a_token_answers_names_of_loopback_alone(host, status):
    """A site whose name resolves to this address would read the pictures in the operator's browser (DNS rebinding)."""
    preview = Preview(PreviewAddress("127.0.0.1", 0, ""))
    connection = http.client.HTTPConnection("127.0.0.1", preview.port, timeout=10)
    connection.request("GET", "/", headers={"Host": host})
    assert connection.getresponse().status == status
    connection.close()
    preview.close()


def test_only_a_few_may_look(preview):
    connections = [looking(preview) for _ in range(module.MOST_WATCHERS)]
    connection, response = looking(preview)
    assert response.status == 503
    for each, _ in [*connections, (connection, response)]:
        each.close()


def test_half_requests_take_no_more_threads_than_connections_are_allowed(preview):
    before = threading.active_count()
    opened = [socket.create_connection(("127.0.0.1", preview.port), 10) for _ in range(40)]
    for each in opened:
        each.sendall(b"GET /")
    deadline = time.monotonic() + 20.0
    while len(ended(opened)) < len(opened) - MOST_CONNECTIONS:
        assert time.monotonic() < deadline, "a hang"
    assert threading.active_count() - before <= MOST_CONNECTIONS
    assert looking(preview)[1].status == 200, "strangers keep no browser out"
    for each in opened:
        each.close()
    deadline = time.monotonic() + 20.0
    while threading.active_count() > before:
        assert time.monotonic() < deadline, "a hang"
        time.sleep(0.01)


def ended(opened: list[socket.socket]) -> list[socket.socket]:
    """The connections that the server has closed."""
    found = []
    for each in select.select(opened, [], [], 0.1)[0]:
        try:
            if each.recv(1, socket.MSG_PEEK) == b"":
                found.append(each)
        except ConnectionError:
            found.append(each)
    return found


def test_a_request_that_never_ends_is_closed_though_it_goes_on(preview, monkeypatch):
    monkeypatch.setattr(module, "SEND_S", 0.3)
    with socket.create_connection(("127.0.0.1", preview.port), 10) as stranger:
        stranger.sendall(b"GET /")
        deadline = time.monotonic() + 20.0
        while not ended([stranger]):
            assert time.monotonic() < deadline, "a hang"
            with suppress(ConnectionError):
                stranger.sendall(b"x")


def test_a_browser_that_takes_nothing_delays_no_detection(preview):
    with socket.create_connection(("127.0.0.1", preview.port)) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.sendall(f"GET /{TOKEN} HTTP/1.1\r\n\r\n".encode())
        while not preview._watchers:
            time.sleep(0.01)
        noise = picture(np.random.default_rng(0).integers(0, 255, (480, 640), np.uint8))
        before_s = time.process_time()
        for _ in range(1000):
            preview.offer(noise, [])
        assert time.process_time() - before_s < 1.0, "a thousand pictures are handed over, not drawn"


def test_a_port_that_is_taken_is_a_warning_and_no_end(caplog):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with caplog.at_level(logging.WARNING):
            busy = Preview(PreviewAddress("127.0.0.1", taken.getsockname()[1], ""))
        assert "Address already in use" in caplog.text
        busy.offer(picture(np.zeros((4, 4), np.uint8)), [])
        busy.close()


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("", None),
        ("127.0.0.1:8089", PreviewAddress("127.0.0.1", 8089, "")),
        ("[::1]:8089", PreviewAddress("::1", 8089, "")),
        ("localhost:80", PreviewAddress("localhost", 80, "")),
        (f"0.0.0.0:8089/{TOKEN}", PreviewAddress("0.0.0.0", 8089, TOKEN)),
    ],
)
def test_addresses(text, address):
    assert parse_preview(text) == address


@pytest.mark.parametrize(
    "text", ["8089", "127.0.0.1", "127.0.0.1:0", "a b:1", "10.0.0.2:8089", "0.0.0.0:1/short", "h:99999"]
)
def test_other_addresses_are_refused(text):
    with pytest.raises(ValueError, match="accepted: HOST:PORT"):
        parse_preview(text)
