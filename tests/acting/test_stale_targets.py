"""A target that no picture shows any more, or whose tracker or local frame ended, is not acted on."""

import pytest
from acting_world import AUTOPILOT, ORIGIN, ROI, T0, S, a_track, click, heartbeat, message, options, situation
from fuzz_targets import LINKS, Daemon

from fwav_companion.acting.acting import Acting
from fwav_companion.acting.aim import seen_target_ned, target_ned
from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.telemetry import OriginSet

FAST = (10.0, 0.0, 0.0)


@pytest.mark.parametrize("place", [target_ned, seen_target_ned])
def test_target_is_predicted_for_two_seconds_at_most(place):
    track = a_track(T0, (20.0, 0.0, 0.0), velocity=FAST)
    assert [round(place(track, HostNs(T0 + k * S // 2))[0]) for k in (0, 2, 4, 5, 60)] == [20, 30, 40, 40, 40]


def test_roi_of_a_moving_target_ends_when_no_pictures_come():
    acting, sent = Acting(options(point="roi")), []
    acting.on_message(heartbeat(), AUTOPILOT, T0)
    acting.on_selected(click(), a_track(T0, (20.0, 0.0, 0.0), velocity=FAST), AUTOPILOT, T0)
    for k in range(100):
        now = HostNs(T0 + k * S // 5)
        acting.on_message(heartbeat((255, 190), link="ground"), AUTOPILOT, now)
        for each in acting.on_wake(now, situation(now)):
            acting.on_message(message("COMMAND_ACK", command=ROI, result=0), AUTOPILOT, now)
            sent.append((k / 5, each.fields["x"]))
    farthest_m = (max(x for _, x in sent) * 1e-7 - ORIGIN.lat_deg) * 111_200.0
    assert max(at_s for at_s, _ in sent) <= 2.2
    assert farthest_m == pytest.approx(40.0, abs=0.5)
    assert acting.status().last_end == "no pictures come"
    assert not acting.status().acts


def faults(daemon):
    for _ in range(5):
        daemon.pipeline.on_internal_fault(daemon.now)


def late_origin(daemon):
    event = OriginSet(TangentPlane(ORIGIN).origin, late=True)
    daemon.pipeline._handlers.of_telemetry([event], daemon.now)


@pytest.mark.parametrize("happens", [faults, late_origin])
def test_end_of_all_tracks_ends_the_acting(happens):
    daemon = Daemon(LINKS + '[act]\npoint = "roi"\n')
    daemon.fly(4000)
    acting = daemon.pipeline._components.acting
    autopilot = daemon.pipeline.identity.autopilot
    acting.on_message(heartbeat(), autopilot, daemon.now)  # that of the flight is disarmed
    acting.on_selected(click("ground"), a_track(daemon.now), autopilot, daemon.now)
    assert acting.status().acts
    happens(daemon)
    assert not acting.status().acts
    assert acting.status().last_end == "the target was lost"
