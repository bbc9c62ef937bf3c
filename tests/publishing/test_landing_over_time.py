"""LANDING_TARGET over time: the claim grows with the age, stamps rise, and low over a pad its last fix leads."""

import numpy as np
import pytest
from landing_options import OPTIONS
from msgspec import structs

from fwav_companion.publishing.landing import Landing
from fwav_companion.publishing.landing_reports import Withheld
from fwav_companion.types import Bias


def clocked(world, sigma_s):
    return structs.replace(world.clock(), sigma_s=sigma_s)


def moving_image(world, m_s):
    """A fix whose place moves by this many metres a second of time error."""
    fix = world.fix()
    columns = list(fix.bias_jacobian)
    columns[Bias.TIME_OFFSET] = (m_s, 0.0, 0.0)
    return structs.replace(fix, bias_jacobian=tuple(columns))


@pytest.mark.parametrize(
    ("image_m_s", "clock_sigma_s", "sent"),
    [
        (0.0, 0.5, True),  # a calm descent: the clock does not matter
        (0.2, 0.5, True),
        (2.0, 0.1, True),
        (2.0, 0.25, False),  # half a metre by the clock alone
        (8.0, 0.05, True),
        (8.0, 0.1, False),
    ],
)
def test_landing_target_with_an_uncertain_clock_is_withheld_by_its_claim_alone(
    world, landing, image_m_s, clock_sigma_s, sent
):
    track = world.track(fix=moving_image(world, image_m_s))
    out = landing.on_tracks((track,), world.situation(clock=clocked(world, clock_sigma_s)))
    assert (out is not None) is sent
    assert landing.status(world.NOW).sigma_m == pytest.approx(np.hypot(0.3, image_m_s * clock_sigma_s), rel=1e-6)
    assert landing.last_withheld in (None, Withheld.TOO_UNCERTAIN)


def test_landing_target_on_a_turning_body_counts_the_clock_at_the_instant_of_the_prediction(world, landing):
    """2 rad/s at 10 m: 20 m/s in the image, 5 ms of clock are 0.1 m."""
    vehicle = world.state(rates=(2.0, 0.0, 0.0))
    landing.on_tracks((world.track(),), world.situation(vehicle=vehicle, clock=clocked(world, 0.005)))
    relative = np.array([4.0, 3.0, 10.0])
    speed = np.linalg.norm(np.cross([2.0, 0.0, 0.0], relative)[:2])
    assert landing.status(world.NOW).sigma_m == pytest.approx(np.hypot(0.3, 0.005 * speed), rel=1e-6)


def test_landing_target_flows_for_a_second_and_a_half_after_the_last_fix_with_a_growing_claim(world, landing):
    landing.on_tracks((world.track(),), world.situation())
    sent, claims = [world.NOW], [landing.status(world.NOW).sigma_m]
    for ms in range(20, 2500, 20):
        now = world.NOW + ms * 1_000_000
        out = landing.on_wake(world.situation(now, vehicle=world.state(now)))
        if out is not None:
            sent.append(out.fields["time_usec"] * 1000)
            claims.append(landing.status(now).sigma_m)
    assert max(np.diff(sent)) <= 0.22 * world.S, "ArduPilot starts again after 0.5 s"
    assert 1.2 * world.S < sent[-1] - world.NOW <= 1.5 * world.S
    assert (np.diff(claims) > 0.0).all()
    assert landing.last_withheld is Withheld.NO_FRAMES


def test_landing_target_of_late_frames_is_predicted_to_now_and_never_to_the_future(world, landing):
    """A camera that is 0.7 s late: its frames count, and the stamp is the instant of the prediction."""
    for k in range(5):
        now = world.NOW + k * 100_000_000
        track = world.track(
            at=now - 700_000_000, velocity_ned=(1.0, 0.0, 0.0), velocity_cov=world.diagonal(0.01, 0.01, 0.01)
        )
        fields = landing.on_tracks((track,), world.situation(now, vehicle=world.state(now))).fields
        assert fields["time_usec"] == now // 1000
        assert fields["x"] == pytest.approx(4.0 + 0.7)


def test_landing_target_stamps_always_rise(world, landing):
    times = []
    for now, at in ((0, 0), (0, 0), (1, -33), (5, 3), (4, 4), (40, 30)):
        vehicle = world.state(world.NOW + now * 1_000_000)
        tracks = (world.track(at=world.NOW + at * 1_000_000),)
        out = landing.on_tracks(tracks, world.situation(world.NOW + now * 1_000_000, vehicle=vehicle))
        if out is not None:
            times.append(out.fields["time_usec"])
    assert times == sorted(set(times))
    assert len(times) == 4


def test_landing_target_low_over_a_pad_is_the_last_fix_where_that_claims_less_than_the_track(world):
    """The reported position jumps by 0.3 m of noise between the fix and now: it is not in the message."""
    before = world.NOW - 100_000_000
    moving = {"velocity": (0.5, 0.0, 0.0)}
    for sigma_m, north_m in ((0.05, 4.0 - 1.0 - 0.05), (0.5, 4.0 - 1.35)):
        landing = Landing(OPTIONS)
        landing.lag_s = 0.0
        fix = world.fix((4.0, 3.0, 0.0), at=before, cov=world.diagonal(sigma_m, sigma_m, sigma_m))
        at_fix = world.state(before, position=(1.0, 0.0, -8.0), **moving)
        sized = structs.replace(fix, best_height_m=6.0, sighting=structs.replace(fix.sighting, state=at_fix))
        now = world.state(position=(1.35, 0.0, -8.0), **moving)
        seen = world.track(fix=sized, at=before)
        fields = landing.on_tracks((seen,), world.situation(vehicle=now)).fields
        assert [fields["x"], fields["y"], fields["z"]] == pytest.approx([north_m, 3.0, 6.0])
        claim = landing.status(world.NOW).sigma_m
        assert claim == pytest.approx(np.hypot(min(sigma_m, 0.3), 0.1 * 0.1), abs=2e-3)


def test_fix_of_a_thing_without_a_known_size_is_not_landed_on_alone(world, landing):
    """Its height is the autopilot's: the filter's place counts, whatever the fix claims."""
    seen = world.track(fix=world.fix((9.0, 9.0, 0.0), cov=world.diagonal(0.01, 0.01, 0.01)))
    fields = landing.on_tracks((seen,), world.situation()).fields
    assert [fields["x"], fields["y"]] == pytest.approx([4.0, 3.0])


def test_landing_target_without_a_position_is_the_last_fix_of_a_pad(world):
    """The track, still relative to the vehicle, lies where the pad was; the camera is 0.3 m ahead of the vehicle."""
    landing = Landing(structs.replace(OPTIONS, camera_position_m=(0.3, 0.0, 0.0)))
    landing.lag_s = 0.0
    fix = world.fix((1.0, 0.5, 0.0))
    hovering = world.state(position=None, velocity=None)
    sized = structs.replace(
        fix, best_height_m=2.0, sighting=structs.replace(fix.sighting, state=hovering, relative=True)
    )
    track = world.track(position_ned=(1.6, 0.5, 0.0), fix=sized, relative_cov=world.diagonal(0.01, 0.01, 0.01))
    fields = landing.on_tracks((track,), world.situation(plane=None, vehicle=hovering)).fields
    assert [fields["x"], fields["y"], fields["z"]] == pytest.approx([1.3, 0.5, 2.0])


def test_way_since_an_old_fix_is_that_of_all_velocities_since(world):
    """The vehicle has moved by 0.4 m since the fix; the two velocities at the ends alone would say 0.05 m."""
    ways, before = [], world.NOW - 1_000_000_000

    def moved_between(start_ns, end_ns):
        ways.append((end_ns - start_ns) * 1e-9)
        return (0.4, 0.0, 0.1)

    landing = Landing(OPTIONS, moved_between=moved_between)
    landing.lag_s = 0.0
    slow = {"velocity": (0.05, 0.0, 0.0)}
    fix = world.fix((4.0, 3.0, 0.0), at=before, cov=world.diagonal(0.05, 0.05, 0.05))
    at_fix = world.state(before, position=(1.0, 0.0, -8.0), **slow)
    sized = structs.replace(fix, best_height_m=6.0, sighting=structs.replace(fix.sighting, state=at_fix))
    now = world.state(position=(1.4, 0.0, -7.9), **slow)
    fields = landing.on_tracks((world.track(fix=sized, at=before),), world.situation(vehicle=now)).fields
    assert ways == pytest.approx([1.0])
    assert [fields["x"], fields["y"], fields["z"]] == pytest.approx([2.6, 3.0, 5.9])
