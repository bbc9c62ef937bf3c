"""A .tlog of a simulator that does not run at real time is reported."""

import pytest

from fwav_companion.mavlink.wire.codec import Encoder
from fwav_companion.recording.tlog import tlog_record
from fwav_companion.replay import read_telemetry

BEGUN_US = 1_790_000_000_000_000


def recording(rate, *, reboot_at_s=None):
    """A minute of attitudes at 10 Hz, with an autopilot's clock of this rate."""
    encoder, data = Encoder(1, 1), bytearray()
    angles = dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0.0)
    for tenth in range(600):
        begun = 0 if reboot_at_s is None or tenth < 10 * reboot_at_s else 10 * reboot_at_s
        boot_ms = round(100 * rate * (tenth - begun)) + 1000
        frame = encoder.encode("ATTITUDE", {"time_boot_ms": boot_ms, **angles})
        data += tlog_record(BEGUN_US + tenth * 100_000, frame)
    return bytes(data)


@pytest.mark.parametrize(("rate", "said"), [(4.6, "4.6 times"), (0.2, "0.2 times")])
def test_another_pace_is_named(rate, said):
    (note,) = read_telemetry(recording(rate)).notes
    assert said in note
    assert "time_boot" in note


@pytest.mark.parametrize("rate", [1.0, 0.985, 1.9])
def test_a_pace_that_is_followed_is_not(rate):
    assert not read_telemetry(recording(rate)).notes


def test_a_reboot_is_no_pace():
    assert not read_telemetry(recording(1.0, reboot_at_s=30)).notes
