"""LANDING_TARGET of the recorded landings of ArduCopter's and PX4's own simulators, as a live service sends it.

See tests/flights. The vehicle did not land by these messages: how near they are to the true pad is what counts.
"""

import lzma
from heapq import merge
from io import BytesIO
from itertools import pairwise
from math import hypot
from pathlib import Path

import numpy as np
import pytest
from flying import LINK

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.geometry.rotations import rotate
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.pipeline.pipeline_factory import make_pipeline, own_components
from fwav_companion.replay.recorded import is_own, read_recording
from fwav_companion.types import Frame, Message, Outgoing, VehicleState
from fwav_companion.types.flight_status import LandingReport

pytestmark = pytest.mark.slow

FLIGHTS = Path(__file__).parents[1] / "flights"
TEXT = LINK + '[camera]\ncalibration = "camera.yaml"\nreadout_s = 0.0\n'
SETTINGS = (
    "camera.time_offset_s=0.04",
    "tracking.self_calibration=false",
    "publish.landing_target=true",
    'publish.landing_label="pad"',
)
LIMIT_M, LAG_S = 0.5, 0.02


def unpacked(name: str, file: str) -> bytes:
    return lzma.decompress((FLIGHTS / name / f"{file}.xz").read_bytes())


class Landing:
    """A recorded flight through a live pipeline, its frames ``late_s`` later than they came."""

    def __init__(self, name: str, late_s: float = 0.0) -> None:
        config = parse(TEXT, "flight.toml", SETTINGS)
        calibration = parse_calibration((FLIGHTS / "camera.yaml").read_text(), "camera.yaml")
        own = own_components(config)
        recording = read_recording(unpacked(name, "telemetry.tlog"), unpacked(name, "detections.jsonl"), own)
        self.pipeline = make_pipeline(config, calibration, unix_offset_ns=recording.unix_offset_ns, live=True)
        self.sent: list[tuple[HostNs, Outgoing]] = []
        self.relative: list[tuple[float, float, float]] = []
        """Instant on the autopilot's clock, s, and what the autopilot reads: pad minus vehicle, north and east, m."""
        messages = [(unix_us * 1000 - recording.unix_offset_ns, 0, message) for unix_us, message in recording.messages]
        frames = [
            (frame.arrival_ns + round(late_s * 1e9), 1, frame)
            for frame in recording.frames
            if isinstance(frame, Frame) and frame.arrival_ns is not None
        ]
        now = HostNs(0)
        for at, _, event in merge(messages, sorted(frames, key=lambda each: each[0]), key=lambda each: each[:2]):
            now = HostNs(at)
            if isinstance(event, Message):
                is_ours = is_own(event, own, recording.own_system)
                (self.pipeline.on_own_message if is_ours else self.pipeline.on_message)(event, now)
            else:
                self.pipeline.on_frame(event, now)
            self._take(now)
        self.report: LandingReport = self.pipeline.status(now).publishing.landing

    def _take(self, now: HostNs) -> None:
        if not self.pipeline.has_outputs:
            return
        for outgoing in self.pipeline.take().messages:
            if outgoing.name == "LANDING_TARGET":
                self.sent.append((now, outgoing))
                self.relative.append(self._as_read(outgoing, now))

    def _as_read(self, outgoing: Outgoing, now: HostNs) -> tuple[float, float, float]:
        """What the autopilot reads, by its rules: ArduPilot turns by the attitude of its lag, PX4 subtracts itself."""
        telemetry, fields = self.pipeline.telemetry, outgoing.fields
        vector = (fields["x"], fields["y"], fields["z"])
        host_ns = now - round(LAG_S * 1e9) if fields["frame"] == 12 else fields["time_usec"] * 1000
        boot_ns = telemetry.clock.boot_from_host(HostNs(host_ns))
        assert isinstance(boot_ns, int)
        if fields["frame"] == 12:
            state = telemetry.state_at(BootNs(boot_ns))
            state = state if isinstance(state, VehicleState) else telemetry.newest_state()
            assert isinstance(state, VehicleState)
            north, east, _ = rotate(state.ned_from_body, vector)
        else:
            own = telemetry.local_position_at(BootNs(boot_ns))
            assert own is not None
            north, east = vector[0] - own[0], vector[1] - own[1]
        return boot_ns * 1e-9, north, east


def errors_m(name: str, landing: Landing) -> np.ndarray:
    """(N, 2): height of the vehicle and error of what the autopilot reads, metres, where the truth is known."""
    truth = np.loadtxt(BytesIO(unpacked(name, "truth.csv")), delimiter=",", skiprows=1)
    rows = []
    for boot_s, north, east in landing.relative:
        if truth[0, 0] <= boot_s <= truth[-1, 0]:
            true_north, true_east, height = (np.interp(boot_s, truth[:, 0], truth[:, k]) for k in (1, 2, 3))
            rows.append((height, hypot(north - true_north, east - true_east)))
    return np.array(rows)


@pytest.mark.parametrize("late_s", [0.0, 1.2])
@pytest.mark.parametrize("name", ["copter-landing", "px4-landing"])
def test_recorded_landing_gets_landing_target_throughout_and_right(name: str, late_s: float):
    landing = Landing(name, late_s)
    report, errors = landing.report, errors_m(name, landing)
    assert set(report.withheld) <= {"no_target", "not_seen", "late_frame", "too_uncertain"}
    assert report.sent > 1100
    stamps = [outgoing.fields["time_usec"] for _, outgoing in landing.sent]
    assert all(before < after for before, after in pairwise(stamps))
    assert all(outgoing.fields["time_usec"] * 1000 <= now for now, outgoing in landing.sent)
    assert np.percentile(errors[:, 1], 95) < LIMIT_M
    assert np.median(errors[errors[:, 0] < 3.0, 1]) < 0.25, "PX4's own altitude moved by half a metre there"
