"""Whole flights through the pipeline: invented times, no sockets. The mock knows the truth and has its own geometry."""

from itertools import pairwise
from math import hypot, sqrt

import msgspec
import pytest
from flying import Companion, Flight, fly
from mavlink_wire import Wire

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.node import PassedRequest
from fwav_companion.mavlink.wire.rate_messages import RateRequest
from fwav_companion.recording.line_types import ClockEstimateLine, HeaderLine, OriginLine, SightingLine, TargetLine
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from fwav_companion.types import NoticeCode
from sitl_mock import TargetOptions, scenario, simulate

LANDING = ("publish.landing_target=true", 'publish.landing_label="target"', "publish.landing_max_sigma_m=3.0")
GLOBAL_SHUTTER = ("camera.readout_s=0.0",)


def flight(name: str, *settings: str, seconds: float = 16.0, seed: int = 3, **how) -> Flight:
    return fly(scenario(name).but({"seconds": seconds, "seed": seed}), settings, **how)


@pytest.fixture(scope="module")
def perfect() -> Flight:
    """A vehicle without errors: the remaining error is our own."""
    return flight("perfect", *GLOBAL_SHUTTER, sightings=True)


def test_the_target_is_found_where_it_is(perfect: Flight):
    line = perfect.final()
    assert perfect.error_m(line) < 0.02
    assert abs(line.down) < 0.02
    place = perfect.mock.world.place(perfect.mock.scene[0].at(0.0))
    assert line.lat == pytest.approx(place.lat, abs=2e-7)
    assert line.lon == pytest.approx(place.lon, abs=3e-7)
    assert line.alt_amsl == pytest.approx(place.alt_amsl, abs=0.02)


def test_a_recording_holds_the_whole_flight_in_order(perfect: Flight):
    lines = perfect.companion.lines
    assert isinstance(lines[0], HeaderLine)
    assert lines[0].schema == 1
    assert msgspec.structs.asdict(lines[0].origin) == pytest.approx({"lat": 48.1372, "lon": 11.5756, "alt_amsl": 519.0})
    assert isinstance(lines[-1], SummaryLine)
    targets = [line for line in lines if isinstance(line, TargetLine)]
    assert [line.time_unix for line in targets] == sorted(line.time_unix for line in targets)
    assert {line.state for line in targets} == {"tentative", "confirmed"}
    clocks = [line.time_monotonic for line in lines if isinstance(line, ClockEstimateLine)]
    assert len(clocks) >= 12
    assert all(later - earlier == 1.0 for earlier, later in pairwise(clocks))


def test_every_detection_is_accounted_for(perfect: Flight):
    summary = perfect.companion.lines[-1]
    sightings = [line for line in perfect.companion.lines if isinstance(line, SightingLine)]
    assert summary.detections == len(sightings)
    refused = [line.reason for line in sightings if line.reason is not None]
    assert summary.fixes == len(sightings) - len(refused)
    assert {reason: refused.count(reason) for reason in set(refused)} == summary.dropped


def test_sightings_tell_where_the_camera_was_and_looked(perfect: Flight):
    used = [line for line in perfect.companion.lines if isinstance(line, SightingLine) and line.reason is None]
    for line in used[::50]:
        host_ns = perfect.mock.clock.host_ns(round(line.time_boot * 1e9))
        true = perfect.mock.state_at(host_ns).position
        assert line.camera_ned == pytest.approx(true, abs=0.05)
        target = perfect.mock.scene[0].at(0.0)
        reach = (target[2] - line.camera_ned[2]) / line.ray_ned[2]
        miss = [line.camera_ned[i] + reach * line.ray_ned[i] - target[i] for i in range(3)]
        assert hypot(*miss) < 0.15


def test_the_clock_is_that_of_the_mock(perfect: Flight):
    lines = [line for line in perfect.companion.lines if isinstance(line, ClockEstimateLine)]
    for line in lines[6:]:
        host_ns = round(line.time_monotonic * 1e9)
        true_s = (host_ns - perfect.mock.clock.boot_ns(host_ns)) / 1e9
        assert abs(line.host_from_autopilot_s - true_s) < 1e-4
        assert abs(line.host_from_autopilot_s - true_s) <= line.bound_s


def test_before_an_autopilot_is_adopted_only_heartbeats_are_said():
    companion = Companion()
    companion.pipeline.advance(HostNs(1_000_000_000))
    for second in range(2, 12):
        companion.on_wake(second * 1_000_000_000)
    assert {outgoing.name for _, outgoing in companion.sent} == {"HEARTBEAT"}
    assert {outgoing.component for _, outgoing in companion.sent} == {191}
    assert companion.pipeline.identity.system == 1
    assert len(companion.sent) in range(9, 12)


@pytest.mark.parametrize(
    "vehicle",
    [
        {"autopilot.landing_consumer": "ardupilot_old"},
        {"autopilot.landing_consumer": "ardupilot_new"},
        {"autopilot.firmware": "px4"},
    ],
    ids=["old ArduPilot", "new ArduPilot", "PX4"],
)
def test_each_landing_consumer_takes_every_landing_target_at_its_place(vehicle: dict[str, str]):
    """The EKF's origin differs from home, and PX4's frame is on its own sphere: the mock evaluates by its own rules."""
    options = scenario("perfect").but({"seconds": 12.0, "seed": 5} | vehicle)
    assert options.autopilot.ekf_origin_m != (0.0, 0.0, 0.0)
    flown = fly(options, (*LANDING, *GLOBAL_SHUTTER))
    assert not flown.refused_landings
    assert len(flown.accepted_landings) > 200
    assert max(each["error_m"] for each in flown.accepted_landings[-200:]) < 0.1


def test_a_station_is_given_the_video_with_the_field_of_view_of_the_configured_lens():
    companion = Companion(('publish.video_uri="rtsp://10.0.0.2/live"', "vehicle.system_id=1"))
    ask = Wire(255, 190).frame("COMMAND_LONG", 1, 100, 512, 0, 269.0, *[0.0] * 6)
    companion.on_bytes(ask, 1_000_000_000)
    (stream,) = (each for _, each in companion.sent if each.name == "VIDEO_STREAM_INFORMATION")
    assert (stream.fields["uri"], stream.fields["hfov"]) == ("rtsp://10.0.0.2/live", 55)


def test_nothing_steers_a_landing_unless_it_is_asked_to():
    flown = flight("unbiased")
    assert "LANDING_TARGET" not in {outgoing.name for _, outgoing in flown.companion.sent}


def late_minus_in_time(settings=(), smoother=None):
    """North of each target line of a flight with late frames, less that of the same flight without, metres."""
    changes = {"seconds": 14.0, "seed": 8, "camera.clutter": 0.0, "camera.missed": 0.0}
    late = fly(scenario("default").but(changes | {"camera.late_every": 7}), settings, smoother=smoother)
    in_time = fly(scenario("default").but(changes), settings, smoother=smoother)
    by_time = {line.time_unix: line.north for line in in_time.companion.targets()}
    lines = [line for line in late.companion.targets() if line.time_unix in by_time]
    return [line.north - by_time[line.time_unix] for line in lines]


def test_a_late_frame_leaves_what_it_would_have_left_in_time():
    differences = late_minus_in_time()
    assert len(differences) > 250
    assert differences[5:] == pytest.approx([0.0] * len(differences[5:]), abs=0.02)


def test_late_frame_by_the_smoother_leaves_nearly_what_it_would_have_left_in_time():
    """The first solve sees a third of a second: until the next one a camera's place in it counts for centimetres."""
    differences = late_minus_in_time(("tracking.self_calibration=true",), SmootherOptions())
    assert len(differences) > 250
    assert sqrt(sum(each**2 for each in differences) / len(differences)) < 0.02
    assert max(map(abs, differences)) < 0.1


def test_without_a_position_targets_are_relative_and_say_so_once():
    flown = flight("no_gps", seconds=20.0)
    assert flown.companion.lines[0].origin is None
    line = flown.companion.targets()[-1]
    assert line.lat is line.lon is line.alt_amsl is None
    assert flown.companion.codes.count(NoticeCode.RELATIVE_WORLD) == 1
    fixes = [line.fix for line in flown.companion.targets() if line.fix]
    assert fixes
    assert all(fix.down == 0.0 for fix in fixes)


def test_a_position_that_comes_late_drops_every_track_by_name():
    flown = flight("late_gps", seconds=30.0)
    dropped = [line for line in flown.companion.targets() if line.state == "dropped"]
    assert "origin_set" in {line.reason for line in dropped}
    assert any(isinstance(line, OriginLine) for line in flown.companion.lines)
    assert flown.final().lat is not None
    assert flown.error_m(flown.final()) < 5.0


def test_three_targets_are_three_tracks():
    flown = flight("three_targets", seconds=14.0)
    last = flown.companion.targets()[-1].time_unix
    confirmed = [
        line for line in flown.companion.targets() if line.time_unix > last - 0.2 and line.state == "confirmed"
    ]
    assert len({line.track for line in confirmed}) == 3


def test_labels_that_are_not_wanted_are_counted_and_not_followed():
    options = scenario("unbiased").but(
        {"seconds": 10.0, "targets": (TargetOptions(label="cow"), TargetOptions(label="target", north=3.0))}
    )
    flown = fly(options, ('detections.labels=["target"]',))
    assert {line.label for line in flown.companion.targets()} == {"target"}
    assert flown.companion.lines[-1].dropped["other_label"] > 50


def test_advance_always_comes_to_rest():
    """No component may request a time in the past repeatedly: the pipeline would never return."""
    flown = flight("gcs_thief", seconds=14.0)
    now = HostNs(flown.mock.end_ns)
    flown.companion.on_wake(now)
    for _ in range(50):
        wake_at = flown.companion.pipeline.wake_at
        assert wake_at is not None
        assert wake_at > now
        now = HostNs(wake_at)
        flown.companion.on_wake(now)


@pytest.mark.parametrize("ground", ['ground.model="rangefinder"', "ground.model=fixed"], ids=["rangefinder", "fixed"])
def test_other_grounds_find_the_same_target(ground: str):
    options = scenario("perfect").but({"seconds": 12.0, "seed": 6, "flight.heave_m": 0.0, "flight.wander_m": 0.0})
    height = f"ground.height_m={options.flight.height_m}"
    flown = fly(options, (*GLOBAL_SHUTTER, ground, height))
    assert flown.error_m(flown.final()) < 0.1
    assert abs(flown.final().down) < 0.1


def test_the_next_due_time_is_always_the_one_that_the_rooms_tell():
    class Watched(Companion):
        def _flushed(self, now: HostNs) -> list[bytes]:
            frames = super()._flushed(now)
            reported = self.pipeline.wake_at
            assert reported == min((due for due in self.pipeline._dues() if due is not None), default=None)
            return frames

    options = scenario("default").but({"seconds": 9.0, "seed": 4, "camera.late_every": 7})
    mock = simulate(options)
    companion = Watched(unix_minus_host_s=mock.unix_minus_host_s)
    for _ in mock.drive(companion):
        pass
    request = RateRequest(
        system=255, component=190, link="ground", target_system=1, target_component=1, rates={31: 4.0}
    )
    for merged in (False, True):
        passed = [PassedRequest(request, merged)]
        followed = companion.pipeline.on_rate_requests(passed, {31: 4.0}, HostNs(mock.end_ns))
        assert bool(followed) is merged, "ours follow at once where requests are merged"
        companion._flushed(HostNs(mock.end_ns))
    companion.pipeline.on_internal_fault(HostNs(mock.end_ns))
    companion._flushed(HostNs(mock.end_ns))


def test_no_number_of_fixes_takes_away_what_is_not_known_of_the_grounds_level(perfect: Flight):
    """[uncertainty] height_bias_m is 0.5 by default, and the same in every fix."""
    line = perfect.final()
    assert len(perfect.companion.targets()) > 300
    assert line.cov[2][2] >= 0.5**2
    assert line.fix.cov[2][2] >= line.cov[2][2]


class AfterAWhile:
    """The companion of an earlier flight, for a simulation that begins later on its clock."""

    def __init__(self, companion: Companion, later_ns: int) -> None:
        self._companion, self._later_ns = companion, later_ns

    @property
    def wake_at(self) -> int | None:
        due = self._companion.wake_at
        return None if due is None else max(0, due - self._later_ns)

    def on_wake(self, now_ns: int) -> list[bytes]:
        return self._companion.on_wake(now_ns + self._later_ns)

    def on_bytes(self, data: bytes, now_ns: int) -> list[bytes]:
        return self._companion.on_bytes(data, now_ns + self._later_ns)


def test_another_autopilot_on_the_link_drops_every_track_and_begins_a_new_world():
    flown = flight("perfect", *GLOBAL_SHUTTER, seconds=12.0)
    companion, seconds = flown.companion, 10**9
    first = companion.pipeline.telemetry.world.plane.origin
    ended_ns = companion._now
    companion.on_bytes(Wire(1, 1).frame("HEARTBEAT", 16, 3, 0, 0, 4, 3), ended_ns + seconds)
    options = scenario("perfect").but(
        {"seconds": 20.0, "autopilot.system_id": 7, "camera.enabled": False, "origin": (47.0, 11.0, 300.0)}
    )
    for _ in simulate(options).drive(AfterAWhile(companion, ended_ns + 2 * seconds)):
        pass
    assert companion.pipeline.identity.system == 7
    assert companion.codes.count(NoticeCode.AUTOPILOT_REPLACED) == 1
    assert "tracks are dropped" in companion.texts_to_ground(NoticeCode.AUTOPILOT_REPLACED)[0]
    dropped = [line for line in companion.targets() if line.state == "dropped"]
    assert "vehicle_changed" in {line.reason for line in dropped}
    second = companion.pipeline.telemetry.world.plane.origin
    assert abs(second.lat_deg - first.lat_deg) > 0.1
    assert [line.origin.lat for line in companion.lines if isinstance(line, OriginLine)] == pytest.approx(
        [second.lat_deg]
    )
