"""One line when the vehicle is armed: ready, with what a fix would be worth, or the one reason why not."""

from math import radians

import pytest
from flying import Companion, fly
from mavlink_wire import Wire

from sitl_mock import scenario

NOTHING_ELSE = tuple(
    f"uncertainty.{name}={value}"
    for name, value in {
        "pixel_noise_px": 1e-3,
        "attitude_noise_deg": 0.0,
        "attitude_bias_deg": 0.0,
        "heading_bias_deg": 0.0,
        "height_noise_m": 0.0,
        "height_bias_m": 0.0,
        "time_offset_sigma_s": 0.0,
        "attitude_stamp_delay_s": 0.0,
    }.items()
)

LEVEL = {"flight.pitch_deg": 0.0}
"""The mock's vehicle flies nose up, and its camera then does not see the point below."""


def lines(name: str, *settings: str, **changes: object) -> list[str]:
    flown = fly(scenario(name).but({"seconds": 10.0, "autopilot.arms_at_s": 8.0} | changes), settings)
    return [notice for notice in flown.companion.notices if "ready" in notice]


def test_ready_is_told_once_to_the_log_and_to_the_ground():
    flown = fly(scenario("default").but({"seconds": 10.0, "autopilot.arms_at_s": 8.0}))
    (line,) = [notice for notice in flown.companion.notices if "ready" in notice]
    assert line.startswith("ready: attitude 100 Hz, clock ")
    assert ", camera 30/s, expect " in line
    assert line.endswith("m (relative to the vehicle)")
    texts = "".join(each.fields["text"] for _, each in flown.companion.sent if each.name == "STATUSTEXT")
    assert line in texts


@pytest.mark.parametrize("mount_deg", [1.0, 4.0])
def test_what_is_expected_is_the_angle_times_the_height(mount_deg: float):
    settings = (*NOTHING_ELSE, f"uncertainty.mount_bias_deg={mount_deg}", "camera.readout_s=0.0")
    (line,) = lines("perfect", *settings, **LEVEL)
    told_m, height_m = (float(part.split()[0]) for part in line.partition("expect ")[2].split(" at "))
    assert told_m == pytest.approx(height_m * radians(mount_deg), abs=0.05 + 0.5 * radians(mount_deg))


def test_on_the_ground_it_speaks_of_ten_metres():
    settings = (*NOTHING_ELSE, "uncertainty.mount_bias_deg=2.0", "camera.readout_s=0.0")
    (line,) = lines("perfect", *settings, **LEVEL, **{"flight.height_m": 0.3})
    assert line.endswith("expect 0.3 m at 10 m (relative to the vehicle)")


def test_armed_right_after_the_start_it_tells_what_has_come_until_then():
    (line,) = lines("default", **{"autopilot.arms_at_s": 4.0})
    rate_hz = float(line.removeprefix("ready: attitude ").split()[0])
    assert 85.0 < rate_hz < 105.0


@pytest.mark.parametrize(
    ("changes", "settings", "why"),
    [
        ({"autopilot.true_ceiling_hz": 40.0}, (), "attitude 40 Hz, wanted 100 Hz"),
        ({"camera.enabled": False}, (), "no pictures from the camera"),
        ({"camera.time_offset_s": 2.0}, (), "pictures are refused: from_the_future"),
    ],
    ids=["slow attitude", "no camera", "stamps from the future"],
)
def test_or_the_one_reason_why_not(changes: dict[str, object], settings: tuple[str, ...], why: str):
    assert lines("default", *settings, **changes) == [f"not ready: {why}"]


def test_of_several_autopilots_none_is_adopted_and_only_the_log_is_told():
    """Whoever's system we spoke for, it might be the wrong one: no word leaves but the companion's heartbeat."""
    companion, one, other = Companion(), Wire(1, 1), Wire(2, 1)
    for second in range(1, 12):
        asked = one.frame("PING", 5, 1, 0, 0) + one.command(1, 191)
        companion.on_bytes(one.heartbeat() + other.heartbeat() + asked, second * 1_000_000_000)
        companion.on_wake(second * 1_000_000_000 + 500_000_000)
    assert companion.notices == ["several autopilots heard (1, 2), none adopted: set [vehicle] system_id"]
    assert {(outgoing.name, outgoing.component) for _, outgoing in companion.sent} == {("HEARTBEAT", 191)}
    assert companion.pipeline.system == 1
