"""More detections than the processor handles, at the real daemon: frames are shed, all else keeps its time."""

from __future__ import annotations

import json
import random
import socket
import threading
import time
from pathlib import Path

import pytest
from sites import Site

OURS, VEHICLES = (1, 191), (1, 1)
BEATS = 20
"""Heartbeats of the vehicle to watch for."""


class Flood(threading.Thread):
    """256 detections a frame at 100 Hz, spread over the image, until the block ends."""

    def __init__(self, port: int) -> None:
        super().__init__()
        self._port, self._stop_it = port, threading.Event()
        self.sent = 0

    def run(self) -> None:
        rng, due_s = random.Random(1), time.monotonic()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while not self._stop_it.wait(max(0.0, due_s - time.monotonic())):
                due_s += 0.01
                places = [(20.0 + 40 * (i % 16), 15.0 + 29 * (i // 16)) for i in range(256)]
                detections = [{"u": u + rng.gauss(0.0, 1.0), "v": v + rng.gauss(0.0, 1.0)} for u, v in places]
                frame = {"time_monotonic": time.monotonic() - 0.02, "frame": self.sent, "size": [640, 480]}
                sender.sendto(json.dumps({**frame, "detections": detections}).encode(), ("127.0.0.1", self._port))
                self.sent += 1

    def __enter__(self) -> Flood:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop_it.set()
        self.join()


@pytest.mark.slow
@pytest.mark.timeout(200)
def test_256_detections_at_100_hz_stall_neither_heartbeats_nor_the_relay(tmp_path: Path):
    """Counted in heartbeats of the vehicle, which the daemon only relays: a loaded machine delays both."""
    site = Site(tmp_path)
    with site.service() as service, site.mock("--scenario", "hover", "--set", "draw_biases=false", seconds=120.0):
        service.wait_for("ready: ")
        fixes = site.status()["fixes"]
        with Flood(site.detections_port) as flood:
            heard = site.ground.listen_for(
                lambda m: m.get_type() == "HEARTBEAT" and (m.get_srcSystem(), m.get_srcComponent()) == VEHICLES,
                count=BEATS,
                within_s=100.0,
            )
            service.wait_for("frames come faster than this board handles them")
            status = site.status()
        assert service.stop() == 0
    site.close()
    senders = [(m.get_srcSystem(), m.get_srcComponent()) for m in heard if m.get_type() == "HEARTBEAT"]
    between, longest = 0, 0
    for sender in senders:
        between = 0 if sender == OURS else between + (sender == VEHICLES)
        longest = max(longest, between)
    assert longest <= 2, "our heartbeats stalled while the vehicle's went on"
    assert senders.count(OURS) >= BEATS - 4
    assert status["dropped"]["overload"] > 10
    assert status["fixes"] > fixes + 256, "the newest frames are used"
    assert status["intake"]["came"] <= flood.sent + 30 * 120
    assert not status["autopilot_lost"]
    assert status["internal_faults"] == 0
    assert service.said.count("frames come faster") <= 3, "once a minute"
