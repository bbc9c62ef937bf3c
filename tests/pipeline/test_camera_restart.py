"""Internal faults that repeat: tracking starts anew, all else of a flight goes on."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
from flying import LINK, Companion

from fwav_companion.pipeline.camera_restart import TEXT
from fwav_companion.tracking.tracker import Tracker
from fwav_companion.types import NoticeCode
from sitl_mock import Options, scenario, simulate

DESCENT = scenario("descent").but({"seed": 4, "seconds": 24.0})
LANDING = (
    LINK
    + """
[camera]
calibration = "camera.yaml"
readout_s = 0.0
[publish]
landing_target = true
landing_label = "pad"
"""
)


class Faulty(Companion):
    """A companion one of whose rooms fails; each fault is handled as the event loop does it."""

    def __init__(self, unix_minus_host_s: float, fails: Callable[[float], bool], *, heals: bool) -> None:
        """``fails``: whether the tracker fails at this time of the flight. ``heals``: whether a new one does not."""
        super().__init__(unix_minus_host_s=unix_minus_host_s, text=LANDING)
        self.faults_s: list[float] = []
        self._start_s: float | None = None
        first, honest = self.pipeline._components.camera._reorder.tracker, Tracker.on_frame

        def on_frame(tracker, view):
            if (not heals or tracker is first) and fails(self._at_s):
                raise ZeroDivisionError
            return honest(tracker, view)

        self.on_tracker_frame = on_frame

    def _guarded(self, handle, data, now_ns):
        self._start_s = self._start_s or now_ns / 1e9
        self._at_s = now_ns / 1e9 - self._start_s
        try:
            return handle(data, now_ns)
        except ZeroDivisionError:
            self.faults_s.append(self._at_s)
            self.pipeline.on_internal_fault(self._instant(now_ns))
            return []

    def on_bytes(self, data, now_ns):
        return self._guarded(super().on_bytes, data, now_ns)

    def on_frame(self, frame, now_ns):
        return self._guarded(super().on_frame, frame, now_ns)


def flown(monkeypatch, fails, *, heals: bool, options: Options = DESCENT) -> Faulty:
    mock = simulate(options)
    companion = Faulty(mock.unix_minus_host_s, fails, heals=heals)
    monkeypatch.setattr("fwav_companion.tracking.tracker.Tracker.on_frame", companion.on_tracker_frame)
    for _ in mock.drive(companion):
        pass
    return companion


def sent_s(companion: Faulty, name: str) -> list[float]:
    return [at / 1e9 - companion._start_s for at, each in companion.sent if each.name == name]


@pytest.fixture
def healed(monkeypatch) -> Faulty:
    """The state of the tracker fails from 12 s on."""
    return flown(monkeypatch, lambda at_s: at_s > 12.0, heals=True)


def test_faults_that_repeat_start_tracking_anew_and_its_ids_go_on(healed):
    assert len(healed.faults_s) == 5
    assert healed.texts(NoticeCode.STARTED_ANEW) == [TEXT]
    before = {line.track for line in healed.targets("pad") if line.state == "confirmed"}
    assert len(before) == 2, before
    (dropped,) = [line for line in healed.targets("pad") if line.reason == "internal_fault"]
    assert dropped.track == min(before)
    assert healed.targets("pad")[-1].track == max(before)


def test_landing_target_rests_from_the_restart_until_the_pad_is_found_again(healed):
    gap = max(later - earlier for earlier, later in pairwise(sent_s(healed, "LANDING_TARGET")))
    assert 0.1 < gap < 3.0
    assert sent_s(healed, "LANDING_TARGET")[-1] > 20.0


def test_a_restart_leaves_the_identity_and_the_clock(healed):
    assert healed.codes.count(NoticeCode.AUTOPILOT_FOUND) == 1
    exchanges = [at_s for at_s in sent_s(healed, "TIMESYNC") if 12.0 < at_s < 20.0]
    assert len(exchanges) >= 6


def test_a_fault_now_and_then_drops_its_input_alone(monkeypatch):
    last: list[float] = []

    def fails(at_s: float) -> bool:
        if at_s < 12.0 or (last and at_s - last[-1] < 3.0):
            return False
        last.append(at_s)
        return True

    companion = flown(monkeypatch, fails, heals=False)
    assert 3 <= len(companion.faults_s) <= 5
    assert companion.codes.count(NoticeCode.STARTED_ANEW) == 0
    assert len({line.track for line in companion.targets("pad") if line.state == "confirmed"}) == 1


def test_faults_that_stay_cost_one_restart_a_minute_and_nothing_else(monkeypatch):
    companion = flown(monkeypatch, lambda at_s: at_s > 5.0, heals=False, options=DESCENT.but({"seconds": 75.0}))
    assert companion.codes.count(NoticeCode.STARTED_ANEW) == 2
    assert len(companion.faults_s) <= 15
    beats = [at_s for at_s in sent_s(companion, "HEARTBEAT") if 20.0 < at_s < 60.0]
    assert max(later - earlier for earlier, later in pairwise(beats)) < 1.5
    assert companion.codes.count(NoticeCode.AUTOPILOT_LOST) == 0
