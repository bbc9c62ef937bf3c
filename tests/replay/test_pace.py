"""The clock of a simulator that does not run at real time is followed in its .tlog, or reported."""

import json

import pytest
from flying import CAMERA, LINK

from fwav_companion.camera import parse_calibration
from fwav_companion.config import parse
from fwav_companion.mavlink.wire.codec import Encoder
from fwav_companion.pipeline.pipeline_factory import own_components
from fwav_companion.recording.line_types import ClockEstimateLine
from fwav_companion.recording.tlog import tlog_record
from fwav_companion.replay import read_recording, read_telemetry, replay

BEGUN_US = 1_790_000_000_000_000
HEARTBEAT = {
    "type": 2, "autopilot": 3, "base_mode": 128, "custom_mode": 0, "system_status": 4, "mavlink_version": 3,
}  # fmt: skip


def recording(rate, *, reboot_at_s=None, late_s=None):
    """A minute of attitudes at 10 Hz, with an autopilot's clock of this rate."""
    encoder, data = Encoder(1, 1), bytearray()
    angles = dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0.0)
    for tenth in range(600):
        begun = 0 if reboot_at_s is None or tenth < 10 * reboot_at_s else 10 * reboot_at_s
        boot_ms = round(100 * rate * (tenth - begun)) + 1000
        frame = encoder.encode("ATTITUDE", {"time_boot_ms": boot_ms, **angles})
        late_us = 0 if late_s is None else round(1e6 * late_s(tenth / 10))
        data += tlog_record(BEGUN_US + tenth * 100_000 + late_us, frame)
        if tenth % 10 == 0:
            data += tlog_record(BEGUN_US + tenth * 100_000 + late_us, encoder.encode("HEARTBEAT", HEARTBEAT))
    return bytes(data)


@pytest.mark.parametrize(("rate", "said"), [(14.6, "14.6 times"), (0.05, "0.05 times")])
def test_another_pace_is_named(rate, said):
    (note,) = read_telemetry(recording(rate)).notes
    assert said in note
    assert "time_boot" in note


@pytest.mark.parametrize("rate", [0.2, 0.985, 1.9, 4.6])
def test_a_pace_that_is_followed_is_not(rate):
    read = read_telemetry(recording(rate))
    assert read.clock_rate == pytest.approx(rate, rel=1e-3)
    assert not read.notes


@pytest.mark.parametrize("rate", [1.0, 0.9995])
def test_a_crystals_pace_is_none(rate):
    assert read_telemetry(recording(rate)).clock_rate == 1.0


def test_a_reboot_is_no_pace():
    read = read_telemetry(recording(1.0, reboot_at_s=30))
    assert not read.notes
    assert read.clock_rate == 1.0


def test_a_queue_that_grows_and_empties_is_no_pace():
    def late_s(t):
        return 0.02 * max(0.0, t - 30.0) if t < 55.0 else 0.0

    assert read_telemetry(recording(1.0, late_s=late_s)).clock_rate == 1.0


@pytest.mark.parametrize(("rate", "late_s"), [(0.98, None), (1.0, lambda t: 0.02 * t)], ids=["slow clock", "queue"])
def test_a_slow_clock_and_a_growing_queue_are_named_together(rate, late_s):
    """Arrivals and stamps are the same in both: the user knows which of the two it was."""
    (note,) = read_recording(recording(rate, late_s=late_s), b"", frozenset()).notes
    assert note.startswith("its stamps run 2 % slower than its arrivals")
    assert "queue grew to 1.2 s instead" in note


@pytest.mark.parametrize("rate", [1.0, 1.9])
def test_no_queue_is_named_where_stamps_do_not_fall_behind(rate):
    assert not read_recording(recording(rate), b"", frozenset()).notes


def test_no_queue_is_named_where_the_companion_asked_for_the_clock():
    request = Encoder(1, 191).encode("TIMESYNC", {"tc1": 0, "ts1": 10**12})
    data = recording(0.98) + tlog_record(BEGUN_US + 60_000_000, request)
    assert not read_recording(data, b"", frozenset({191})).notes


@pytest.mark.parametrize("rate", [0.5, 0.98, 3.0])
def test_a_replay_pairs_frames_of_the_recorders_clock_with_a_simulators_attitudes(rate):
    """Without a height there is no fix: that reason comes after the pairing."""
    config = parse(LINK + '[camera]\ncalibration = "camera.yaml"\n', "flight.toml")
    stamps = [BEGUN_US * 1e-6 + 20.0 + 0.5 * number for number in range(70)]
    frames = (
        {"frame": number, "time_unix": at, "received_unix": at + 0.05, "width": 640, "height": 480,
         "detections": [{"u": 320.0, "v": 240.0}]}
        for number, at in enumerate(stamps)
    )  # fmt: skip
    read = read_recording(recording(rate), "\n".join(map(json.dumps, frames)).encode(), own_components(config))
    lines = list(replay(read, config, parse_calibration(CAMERA, "camera.yaml")))
    assert lines[-1].dropped.get("stale_attitude", 0) == 0, lines[-1].dropped
    assert [line.rate for line in lines if isinstance(line, ClockEstimateLine)][-1] == pytest.approx(rate, rel=0.01)
