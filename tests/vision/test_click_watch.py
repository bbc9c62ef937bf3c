"""Clicked spots in the camera process: what it asks the daemon, and what it makes of the answers."""

from __future__ import annotations

import json
from types import SimpleNamespace

import cv2
import msgspec
import numpy as np
import pytest

from fwav_companion.types.spots import QUESTION, REFUSAL, FollowSpot, ReleaseSpot, SpotView, SpotViews
from fwav_companion.vision import click_watch
from fwav_companion.vision.click_watch import ClickWatch
from fwav_companion.vision.images import Picture
from fwav_companion.vision.patch import FollowedSpots

SCALE = (60.0, 0.0, 0.0, 60.0)


class Daemon:
    """The daemon's end: gives what is queued, keeps what it is sent."""

    def __init__(self):
        self.sent, self.queued = [], []

    def send(self, message):
        self.sent.append(message)

    def messages(self, timeout_s=0.0):
        taken, self.queued = self.queued, []
        return taken

    def queue(self, *messages):
        self.queued += map(msgspec.json.encode, messages)


def picture(seed=1, shift=0):
    noise = np.random.default_rng(seed).standard_normal((240, 320)).astype(np.float32)
    grey = np.clip(118.0 + 100.0 * cv2.GaussianBlur(noise, (0, 0), 2.0), 0, 255).astype(np.uint8)
    return Picture(np.roll(grey, shift, axis=1), {"time_monotonic": 1.0})


def see(watch, number, shown):
    watch.begin(shown, number, b'{"time_monotonic":1.0,"detections":[],"picture":%d}' % number)
    return watch.found(shown, number)


@pytest.fixture
def daemon():
    return Daemon()


@pytest.fixture
def watch(daemon):
    watch = ClickWatch(daemon)
    assert see(watch, 1, picture()) == []
    daemon.queue(FollowSpot(3, 1, SpotView((160.0, 120.0), SCALE, 0.0)))
    return watch


def test_without_a_click_nothing_is_asked(daemon):
    watch = ClickWatch(daemon)
    for number in range(5):
        see(watch, number, picture())
    assert daemon.sent == []


def test_a_spot_is_asked_for_and_becomes_a_detection(watch, daemon):
    daemon.queue(SpotViews(2, {3: SpotView((160.0, 120.0), SCALE, 20.0)}))
    (found,) = see(watch, 2, picture(shift=7))
    (question,) = daemon.sent
    assert question.startswith(QUESTION)
    assert json.loads(question)["question"]["picture"] == 2
    assert (found["label"], found["id"]) == ("click", 3)
    assert (found["u"], found["v"]) == pytest.approx((167.0, 120.0), abs=0.1)
    assert found["box"] == pytest.approx([152.0, 105.0, 182.0, 135.0], abs=0.1)


def test_an_answer_about_another_picture_is_not_taken(watch, daemon, monkeypatch):
    monkeypatch.setattr(click_watch, "ANSWER_S", 0.01)
    daemon.queue(SpotViews(1, {3: SpotView((160.0, 120.0), SCALE, 20.0)}))
    assert see(watch, 2, picture()) == []


def test_a_board_on_which_spots_cost_much_is_asked_for_fewer_pictures(watch, daemon, monkeypatch, caplog):
    """30 ms of CPU a picture: at 30 frames/s every tenth picture is a tenth of a core."""
    now, cpu = [100.0], [0.0]
    real = FollowedSpots.detections

    def costly(self, shown, views):
        cpu[0] += 0.03
        return real(self, shown, views)

    monkeypatch.setattr(FollowedSpots, "detections", costly)
    clock = SimpleNamespace(monotonic=lambda: now[0], thread_time=lambda: cpu[0])
    monkeypatch.setattr(click_watch, "time", clock)
    seen = []
    for number in range(2, 182):
        now[0] += 1.0 / 30.0
        daemon.queue(SpotViews(number, {3: SpotView((160.0, 120.0), SCALE, 20.0)}))
        seen.append(bool(see(watch, number, picture())))
    assert sum(seen) == len(daemon.sent)
    assert 8 <= sum(seen[-90:]) <= 10
    assert caplog.text.count("over a tenth of a core") == 1


def test_a_camera_that_changes_its_size_in_flight_keeps_its_spots(watch, daemon):
    """The daemon's views are in pixels of the picture: half the size, half the pixels a metre."""
    half = Picture(cv2.resize(picture().pixels, (160, 120), interpolation=cv2.INTER_AREA), {"time_monotonic": 1.1})
    daemon.queue(SpotViews(2, {3: SpotView((81.0, 58.0), (30.0, 0.0, 0.0, 30.0), 12.0)}))
    (found,) = see(watch, 2, half)
    assert (found["u"], found["v"]) == pytest.approx((79.75, 59.75), abs=0.3)
    daemon.queue(SpotViews(3, {3: SpotView((160.0, 120.0), SCALE, 20.0)}))
    (found,) = see(watch, 3, picture(shift=5))
    assert found["u"] == pytest.approx(165.0, abs=0.2)


def test_a_spot_that_is_released_is_not_asked_for(watch, daemon):
    daemon.queue(ReleaseSpot(3))
    assert see(watch, 2, picture()) == []
    assert daemon.sent == []


@pytest.mark.parametrize(
    ("order", "reason"),
    [
        (FollowSpot(4, 99, SpotView((160.0, 120.0), SCALE, 0.0)), "forgotten"),
        (FollowSpot(4, 1, SpotView((2.0, 120.0), SCALE, 0.0)), "outside"),
    ],
)
def test_an_order_that_cannot_be_done_is_refused_with_its_reason(daemon, order, reason):
    watch = ClickWatch(daemon)
    see(watch, 1, picture())
    daemon.queue(order)
    see(watch, 2, picture())
    (refusal,) = daemon.sent
    assert refusal.startswith(REFUSAL)
    assert json.loads(refusal) == {"spot": 4, "refused": reason}
