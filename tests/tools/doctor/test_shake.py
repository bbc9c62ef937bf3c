"""`check --shake` with the mock in invented time: planted delays and mounts are found, and mistakes are named."""

import json
from collections.abc import Mapping
from functools import cache
from typing import Any

import msgspec
import numpy as np
import pytest
from draws import first_of
from flying import Companion

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.pipeline_factory import make_pipeline
from fwav_companion.tools.doctor.shake_session import KEPT_S, MOST_FRAMES, MOST_TAGS, ShakeSession
from fwav_companion.tools.shake.estimate import estimate
from fwav_companion.tools.shake.instructions import Instruction, ShakePhase
from fwav_companion.types import Detection, Frame, StampClock
from fwav_companion.types.network_status import LinkReport
from fwav_companion.types.status import RunStatus
from fwav_companion.vision.wire import parse_frame
from sitl_mock import scenario, simulate

HAND = scenario("shake").but({"seed": 3, "draw_biases": False})


class Watched(Companion):
    """The service with a session that looks at it five times a second."""

    def __init__(self) -> None:
        super().__init__()
        self.pipeline = make_pipeline(self.config, None, unix_offset_ns=0, live=True, attitudes_kept_s=KEPT_S)
        self.advices: list[Instruction] = []
        self.session = ShakeSession(
            self.config, self.calibration, wait_s=12.0, show=self.advices.append, now_s=lambda: self._now * 1e-9
        )
        self._look_ns = 0

    def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
        self.session.on_frame(parse_frame(json.dumps(frame), HostNs(now_ns), self.wall_clock))
        return super().on_frame(frame, now_ns)

    def is_over(self, now_ns: int) -> bool:
        if now_ns < self._look_ns:
            return False
        self._look_ns = now_ns + 200_000_000
        flight = msgspec.structs.asdict(self.pipeline.status(self._now))
        status = RunStatus(**flight, links={"autopilot": LinkReport(state="up")})
        return self.session.enough(status, self.pipeline.telemetry)


@cache
def watched(*differences):
    """One session with the mock, with these differences from a healthy one."""
    mock = simulate(HAND.but({"seconds": 60.0, **dict(differences)}))
    watcher = Watched()
    for now_ns, _ in mock.drive(watcher):
        if watcher.is_over(now_ns):
            break
    return watcher, watcher.session.result(0.16)


def shaken(*differences):
    _, shown = watched(*differences)
    return estimate(shown.shaking)


def test_a_late_camera_and_a_crooked_mount_are_found():
    """The shutter rolls, unconfigured; the rates pass two poles at 20 Hz: sqrt(2) / (2 pi f) late at low frequency."""
    found = shaken(("biases.time_offset_s", 0.035), ("biases.mount_deg", (0.5, 1.0, 2.0)), ("camera.readout_s", 0.02))
    assert (found.sign_errors, found.not_shown) == ((), ())
    assert found.delay.value == pytest.approx(0.035, abs=0.003)
    assert found.delay.value == pytest.approx(0.035, abs=3.5 * found.delay.sigma)
    errors = np.degrees([known.value for known in found.mount]) - (0.5, 1.0, 2.0)
    assert abs(errors).max() < 0.3
    assert (abs(errors) < 3.5 * np.degrees([known.sigma for known in found.mount])).all()
    assert found.heading_change == pytest.approx(np.pi / 2, abs=0.3)
    assert found.rate_lag.lag_s == pytest.approx(0.0112, abs=0.0015)


PLANTED = {
    "image upside down": ("biases.mount_deg", (0.0, 0.0, 180.0)),
    "roll reversed": ("autopilot.reversed_axes", ("roll",)),
}


@pytest.mark.parametrize("name", first_of(*PLANTED))
def test_a_planted_mistake_is_named(name):
    assert [error.name for error in shaken(PLANTED[name]).sign_errors] == [name]


@pytest.mark.slow  # "never turned" of the estimate itself is tested by default
def test_a_missing_turn_is_reported():
    watcher, shown = watched(("flight.quarter_turn_s", 0.0))
    assert any("turn it by 90 deg" in advice.text for advice in watcher.advices)
    found = estimate(shown.shaking)
    assert found.mount is None
    assert "never turned" in found.not_shown[-1]


@pytest.mark.slow
def test_missing_shaking_is_reported():
    still = {"shake_deg": (0.0, 0.0, 0.0), "flapping_pitch_deg": 0.0, "flapping_roll_deg": 0.0, "wander_deg": 0.0}
    found = shaken(*((f"flight.{name}", value) for name, value in still.items()))
    assert (found.delay, found.mount) == (None, None)
    assert "too little shaking" in found.not_shown[-1]


MISSING = {
    "no tag with its four corners": ("camera.corner_noise_px", None),
    "no pictures and no detections": ("camera.enabled", False),
    "attitudes come": ("autopilot.true_ceiling_hz", 10.0),
}


@pytest.mark.parametrize("words", MISSING)
def test_an_input_that_never_comes_is_named(words):
    _, shown = watched(MISSING[words])
    assert shown.shaking is None
    assert shown.advice.phase is ShakePhase.FAILED
    assert words in shown.advice.text


def test_kept_frames_are_bounded_in_number_and_in_tags():
    """A detector may send 256 detections a frame, and the user may forget that the session runs."""
    watcher, _ = watched(("flight.quarter_turn_s", 0.0))
    four = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
    tags = tuple(Detection(1.5, 1.5, label=f"tag{number}", corners=four) for number in range(MOST_TAGS + 4))
    people = (Detection(9.0, 9.0, label="person"),) * 200
    crowded = Frame(None, 0, StampClock.HOST, HostNs(0), people + tags)
    for _ in range(MOST_FRAMES + 10):
        watcher.session.on_frame(crowded)
    assert len(watcher.session.frames) == MOST_FRAMES
    assert watcher.session.frames[-1].detections == tags[:MOST_TAGS]
