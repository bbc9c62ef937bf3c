"""Readiness in flight: reported when it can be judged, on each change, on arming; alike to the log and the ground."""

import re
from collections.abc import Mapping
from math import radians
from typing import Any

import pytest
from draws import first_of
from flying import Companion, Flight, fly
from mavlink_wire import Wire

from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.types import NoticeCode, Reason
from sitl_mock import scenario, simulate
from sitl_mock.autopilots import AUTOPILOTS

RADIUS_OF_95 = 2.4477
"""Radius of a circular distribution that holds 95 %, in sigmas: sqrt(-2 ln 0.05)."""
NOT_READY = {code for code in NoticeCode if code.startswith("not_ready")}
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
ADOPTED_S = 3.0
"""The companion listens for three seconds before it adopts the only autopilot."""
S = 1_000_000_000


def flight(name: str, *settings: str, **changes: object) -> Flight:
    return fly(scenario(name).but({"seconds": 10.0, "autopilot.arms_at_s": None} | changes), settings)


def readiness(flown: Flight) -> list[NoticeCode]:
    return [code for code in flown.companion.codes if code is NoticeCode.READY or code in NOT_READY]


def sent_at_s(flown: Flight, code: NoticeCode) -> list[float]:
    """Seconds since the start at which texts with this code left."""
    start_ns = flown.mock.start_host_ns
    return [
        (at - start_ns) / S
        for at, each in flown.companion.sent
        if each.notice is code and each.fields["chunk_seq"] == 0
    ]


def test_ready_is_reported_once_within_five_seconds_of_the_adoption_to_the_log_and_to_the_ground():
    flown = flight("default")
    assert readiness(flown) == [NoticeCode.READY]
    (at_s,) = sent_at_s(flown, NoticeCode.READY)
    assert at_s <= ADOPTED_S + 5.5
    assert flown.companion.texts(NoticeCode.READY) == flown.companion.texts_to_ground(NoticeCode.READY)


def test_an_arming_before_anything_is_measured_raises_no_alarm():
    """Armed a second after the adoption: no rate is known yet."""
    assert readiness(flight("default", **{"autopilot.arms_at_s": 4.0})) == [NoticeCode.READY]


def test_a_later_arming_repeats_the_state():
    assert readiness(flight("default", seconds=22.0, **{"autopilot.arms_at_s": 19.0})) == [NoticeCode.READY] * 2


def test_the_line_has_the_rates_and_says_which_share_lies_within():
    (line,) = flight("default").companion.texts(NoticeCode.READY)
    assert line.startswith("ready: attitude ")
    assert 85.0 < float(line.removeprefix("ready: attitude ").split()[0]) < 105.0
    assert ", camera 30/s, 95 % within: clock " in line
    assert line.endswith("m, relative to the vehicle)")


@pytest.mark.parametrize("mount_deg", first_of(4.0, 1.0))
def test_what_is_expected_is_the_angle_times_the_height(mount_deg: float):
    settings = (*NOTHING_ELSE, f"uncertainty.mount_bias_deg={mount_deg}", "camera.readout_s=0.0")
    (line,) = flight("perfect", *settings, **LEVEL).companion.texts(NoticeCode.READY)
    within_m, height_m = (float(part.split()[0]) for part in line.partition("target ")[2].split("(from "))
    sigma_m = height_m * radians(mount_deg)
    slack_m = 0.05 + 0.5 * radians(mount_deg)
    assert within_m == pytest.approx(RADIUS_OF_95 * sigma_m, abs=RADIUS_OF_95 * slack_m)


def test_on_the_ground_it_speaks_of_ten_metres():
    settings = (*NOTHING_ELSE, "uncertainty.mount_bias_deg=2.0", "camera.readout_s=0.0")
    (line,) = flight("perfect", *settings, **LEVEL, **{"flight.height_m": 0.3}).companion.texts(NoticeCode.READY)
    assert line.endswith("target 0.9 m (from 10 m, relative to the vehicle)")


@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ({"autopilot.true_ceiling_hz": 40.0}, NoticeCode.NOT_READY_SLOW_ATTITUDE, "attitude at 40 Hz, wanted 100 Hz"),
        ({"camera.enabled": False}, NoticeCode.NOT_READY_NO_PICTURES, "[detections] url"),
        ({"camera.time_offset_s": 2.0}, NoticeCode.NOT_READY_PICTURES_REFUSED, Reason.FROM_THE_FUTURE.value),
        ({"autopilot.gps": False}, NoticeCode.NOT_READY_NO_POSITION, "GPS"),
    ],
    ids=["slow attitude", "no camera", "stamps from the future", "no GPS"],
)
def test_or_the_one_reason_why_not_within_five_seconds(changes: dict[str, object], code: NoticeCode, words: str):
    flown = flight("default", **changes)
    assert readiness(flown) == [code]
    assert words in flown.companion.texts(code)[0]
    assert sent_at_s(flown, code)[0] <= ADOPTED_S + 5.5
    assert flown.companion.texts_to_ground(code) == flown.companion.texts(code)


def test_ready_is_taken_back_when_the_pictures_stop():
    flown = flight("default", seconds=24.0, **{"camera.stops_at_s": 12.0})
    assert readiness(flown) == [NoticeCode.READY, NoticeCode.NOT_READY_NO_PICTURES]
    assert 12.0 < sent_at_s(flown, NoticeCode.NOT_READY_NO_PICTURES)[0] <= 12.0 + 8.0


def test_not_ready_is_taken_back_when_targets_can_be_localized_after_all():
    """Without a position the world is relative from the tenth second on."""
    flown = flight("default", seconds=22.0, **{"autopilot.gps": False})
    assert readiness(flown) == [NoticeCode.NOT_READY_NO_POSITION, NoticeCode.READY]
    codes = flown.companion.codes
    assert codes.index(NoticeCode.RELATIVE_WORLD) < codes.index(NoticeCode.READY)


def test_pictures_that_cannot_be_read_are_not_called_missing():
    class Garbled(Companion):
        def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
            return super().on_frame({"detections": frame["detections"]}, now_ns)

    mock = simulate(scenario("default").but({"seconds": 10.0}))
    companion = Garbled(unix_minus_host_s=mock.unix_minus_host_s)
    for _ in mock.drive(companion):
        pass
    (text,) = companion.texts(NoticeCode.NOT_READY_PICTURES_REFUSED)
    assert Reason.NO_TIME.value in text
    assert NoticeCode.NOT_READY_NO_PICTURES not in companion.codes


def test_the_loss_of_the_autopilot_is_reported_alone():
    """Attitude and pictures stop with it: they are its consequences, and not reported."""
    flown = flight("default")
    now_ns = flown.mock.end_ns
    for second in range(1, 30):
        flown.companion.on_wake(now_ns + second * S)
    assert readiness(flown) == [NoticeCode.READY]
    assert flown.companion.codes[-1] is NoticeCode.AUTOPILOT_LOST


def test_when_the_autopilot_is_back_readiness_is_judged_again():
    """It sends heartbeats now, and no attitude."""
    flown, autopilot = flight("default"), Wire(1, 1)
    companion, now_ns = flown.companion, flown.mock.end_ns
    for second in range(1, 20):
        if second > 10:
            companion.on_bytes(autopilot.heartbeat(), now_ns + second * S)
        companion.on_wake(now_ns + second * S + S // 2)
    assert companion.codes[-3:] == [
        NoticeCode.AUTOPILOT_LOST,
        NoticeCode.AUTOPILOT_BACK,
        NoticeCode.NOT_READY_NO_ATTITUDE,
    ]


def test_after_a_reboot_readiness_is_judged_again():
    assert readiness(flight("rebooting", seconds=26.0)) == [NoticeCode.READY] * 2


def test_a_target_is_found_in_the_log_and_at_the_ground():
    flown = flight("default")
    found = flown.companion.texts(NoticeCode.TARGET_FOUND)
    assert found
    assert found == flown.companion.texts_to_ground(NoticeCode.TARGET_FOUND)


def test_when_a_position_comes_late_targets_start_again_without_a_place_that_was_relative_to_the_vehicle():
    flown = flight("late_gps", seconds=30.0)
    codes = flown.companion.codes
    origin = codes.index(NoticeCode.ORIGIN_SET)
    assert NoticeCode.TARGET_FOUND in codes[:origin]
    assert NoticeCode.TARGET_FOUND in codes[origin:]
    assert NoticeCode.TARGET_LOST not in codes
    (text,) = flown.companion.texts_to_ground(NoticeCode.ORIGIN_SET)
    assert text.startswith(flown.companion.texts(NoticeCode.ORIGIN_SET)[0])


def test_a_target_that_is_seen_no_more_is_lost_in_the_log_and_at_the_ground():
    class Blindfolded(Companion):
        def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
            late = now_ns - mock.start_host_ns > 9 * S
            return super().on_frame({**frame, "detections": [] if late else frame["detections"]}, now_ns)

    mock = simulate(scenario("perfect").but({"seconds": 20.0, "flight.pattern": "hover"} | LEVEL))
    companion = Blindfolded(unix_minus_host_s=mock.unix_minus_host_s)
    for _ in mock.drive(companion):
        pass
    (lost,) = companion.texts(NoticeCode.TARGET_LOST)
    assert companion.texts_to_ground(NoticeCode.TARGET_LOST) == [lost]


def test_every_text_that_leaves_has_a_code():
    sent = [each for _, each in flight("rebooting", seconds=20.0).companion.sent if each.name == "STATUSTEXT"]
    assert len(sent) > 3
    assert all(each.notice is not None for each in sent)


def test_of_several_autopilots_none_is_adopted_and_only_the_log_says_so():
    """It might be the wrong system whose id we used: only the companion's heartbeat is sent."""
    companion, one, other = Companion(), Wire(1, 1), Wire(2, 1)
    for second in range(1, 12):
        asked = one.frame("PING", 5, 1, 0, 0) + one.command(1, 191)
        companion.on_bytes(one.heartbeat() + other.heartbeat() + asked, second * S)
        companion.on_wake(second * S + S // 2)
    assert companion.codes == [NoticeCode.SEVERAL_AUTOPILOTS]
    assert "(1, 2)" in companion.notices[0]
    assert {(outgoing.name, outgoing.component) for _, outgoing in companion.sent} == {("HEARTBEAT", 191)}
    assert companion.pipeline.identity.system == 1


class Copying(Companion):
    """Gets each picture's detections several times, as from two paths of one detector."""

    def on_frame(self, frame: Mapping[str, Any], now_ns: int) -> list[bytes]:
        sent = super().on_frame(frame, now_ns)
        for _ in range(6):
            sent = [*sent, *super().on_frame(frame, now_ns)]
        return sent


def test_second_copies_of_pictures_change_neither_readiness_nor_the_rate_of_the_camera():
    mock = simulate(scenario("default").but({"seconds": 14.0, "autopilot.arms_at_s": None}))
    companion = Copying(unix_minus_host_s=mock.unix_minus_host_s)
    for _ in mock.drive(companion):
        pass
    assert [code for code in companion.codes if code in NOT_READY] == []
    (text,) = companion.texts(NoticeCode.READY)
    camera_hz = float(text.partition("camera ")[2].partition("/s")[0])
    assert camera_hz == pytest.approx(mock.options.camera.fps, abs=2.0)


class Deaf(Companion):
    """Gets no positions from some instant on: another program has stopped their stream."""

    stopped = False
    positions = (
        Scanner(datagrams=True),
        frozenset(BY_NAME[name].msgid for name in ("GLOBAL_POSITION_INT", "ALTITUDE")),
    )

    def on_bytes(self, data: bytes, now_ns: int) -> list[bytes]:
        scanner, positions = self.positions
        kept = [frame.data for frame in scanner.feed(data) if not (self.stopped and frame.msgid in positions)]
        return super().on_bytes(b"".join(kept), now_ns)


def test_positions_that_stop_are_not_called_missing_gps():
    mock = simulate(scenario("default").but({"seconds": 30.0, "autopilot.arms_at_s": None}))
    companion = Deaf(unix_minus_host_s=mock.unix_minus_host_s)
    for now_ns, _ in mock.drive(companion):
        companion.stopped = now_ns > mock.start_host_ns + 12 * S
    texts = companion.texts(NoticeCode.NOT_READY_NO_POSITION)
    assert len(texts) == 1
    assert "stopped" in texts[0]
    assert "GPS" not in texts[0]


def test_slow_attitudes_of_an_autopilot_that_grants_no_rate_are_not_blamed_on_others():
    flown = flight("unbiased", **AUTOPILOTS["mute"][1])
    text = flown.companion.texts(NoticeCode.NOT_READY_SLOW_ATTITUDE)[0]
    assert text.endswith("the autopilot answers no rate request: set its telemetry rate, or lower [rates] attitude")


class Stuttering(Companion):
    """Gets each frame several times: a detector that sends it to two addresses, or a network that repeats datagrams."""

    copies = 7

    def on_frame(self, frame: Mapping[str, object], now_ns: int) -> list[bytes]:
        return [data for _ in range(self.copies) for data in super(Stuttering, self).on_frame(frame, now_ns)]


def test_copies_of_frames_neither_raise_the_cameras_rate_nor_make_the_vehicle_unready():
    mock = simulate(scenario("default").but({"seconds": 10.0, "autopilot.arms_at_s": None}))
    companion = Stuttering(unix_minus_host_s=mock.unix_minus_host_s)
    for _ in mock.drive(companion):
        pass
    codes = [code for code in companion.codes if code is NoticeCode.READY or code in NOT_READY]
    assert codes == [NoticeCode.READY]
    camera, once = [
        int(re.search(r"camera (\d+)/s", each.texts(NoticeCode.READY)[0])[1])
        for each in (companion, flight("default").companion)
    ]
    assert camera == once
