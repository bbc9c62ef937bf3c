"""LANDING_TARGET as its receivers read it: their published formulas by hand, geometry by scipy."""

from math import cos, inf, nan, radians, sin, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from landing_options import OPTIONS
from msgspec import structs
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from fwav_companion.publishing.landing import Landing
from fwav_companion.publishing.landing_reports import Withheld
from fwav_companion.publishing.options import PublishOptions
from fwav_companion.types import AutopilotKind, Destination, Reason, SizeHeight, TrackState, Unpaired


def rotation(q):
    w, x, y, z = q
    return Rotation.from_quat([x, y, z, w])


def test_ardupilot_gets_the_vector_from_the_vehicle_in_its_body(world, landing):
    q = world.quaternion(yaw_deg=130, pitch_deg=37, roll_deg=-12)
    vehicle = world.state(q=q, position=(1.0, -2.0, -8.0))
    out = landing.on_tracks((world.track(),), world.situation(vehicle=vehicle))
    got = world.packed(out)
    expected = rotation(q).inv().apply([4.0 - 1.0, 3.0 + 2.0, 8.0])
    assert (out.to, out.component) == (Destination.AUTOPILOT, 191)
    assert (got["frame"], got["position_valid"]) == (mavlink.MAV_FRAME_BODY_FRD, 1)
    assert [got["x"], got["y"], got["z"]] == pytest.approx(expected, abs=1e-5)
    assert got["distance"] == pytest.approx(np.linalg.norm(expected), rel=1e-6)
    assert got["time_usec"] == world.NOW // 1000
    assert got["type"] == mavlink.LANDING_TARGET_TYPE_VISION_OTHER


@settings(derandomize=True, max_examples=100)
@given(
    yaw=st.floats(-180, 180),
    pitch=st.floats(-40, 40),
    roll=st.floats(-40, 40),
    north=st.floats(-8, 8),
    east=st.floats(-8, 8),
)
def test_the_angles_say_the_same_as_the_vector_by_ardupilots_formula(world, yaw, pitch, roll, north, east):
    """AC_PrecLand: line of sight = (-tan(angle_y), tan(angle_x), 1) in body FRD, down positive."""
    landing = Landing(OPTIONS)
    q = world.quaternion(yaw, pitch, roll)
    out = landing.on_tracks((world.track(position_ned=(north, east, 0.0)),), world.situation(vehicle=world.state(q=q)))
    fields = out.fields
    if fields["z"] < 0.5:  # next to the body, where tangents end
        return
    los = np.array([-tan(fields["angle_y"]), tan(fields["angle_x"]), 1.0])
    vector = np.array([fields["x"], fields["y"], fields["z"]])
    assert np.cross(los, vector) == pytest.approx([0, 0, 0], abs=1e-9 * np.linalg.norm(vector) * np.linalg.norm(los))
    assert los @ vector > 0


@pytest.mark.parametrize(
    ("target", "sign_x", "sign_y"), [((3.0, 0.0, 0.0), 0, -1), ((-3.0, 0.0, 0.0), 0, 1), ((0.0, 3.0, 0.0), 1, 0)]
)
def test_signs_ahead_is_negative_y_and_right_is_positive_x(world, landing, target, sign_x, sign_y):
    fields = landing.on_tracks((world.track(position_ned=target),), world.situation()).fields
    assert np.sign(fields["angle_x"]) == sign_x
    assert np.sign(fields["angle_y"]) == sign_y


def test_the_attitude_is_that_of_the_arrival_less_plnd_lag(world):
    """A body that pitches at 2 rad/s: what counts is where it was 20 ms before the message comes in."""
    landing = Landing(OPTIONS)
    rate, newest_age_s, round_trip_s = 2.0, 0.005, 0.004
    q = world.quaternion(pitch_deg=20)
    vehicle = world.state(
        at=world.NOW - round(newest_age_s * 1e9), q=q, rates=(0.0, rate, 0.0), velocity=(3.0, 0.0, 0.0)
    )
    fields = landing.on_tracks(
        (world.track(),), world.situation(vehicle=vehicle, clock=world.clock(round_trip_s))
    ).fields
    step_s = newest_age_s + round_trip_s / 2 - 0.02
    pitch = radians(20) + rate * step_s
    forward = [cos(pitch), 0.0, -sin(pitch)]  # of the body, in NED, at that instant
    relative = [4.0 - 3.0 * step_s, 3.0, 10.0]
    assert fields["x"] == pytest.approx(np.dot(forward, relative), abs=1e-9)
    assert fields["y"] == pytest.approx(3.0, abs=1e-9)


def test_a_history_that_knows_the_instant_is_asked_for_it(world):
    asked = []

    def state_at(boot_ns):
        asked.append(boot_ns)
        return world.state(q=world.quaternion(yaw_deg=90))

    out = Landing(OPTIONS, state_at).on_tracks((world.track(),), world.situation())
    assert asked == [world.situation().vehicle.boot_ns - 20_000_000]
    assert [out.fields["x"], out.fields["y"]] == pytest.approx([3.0, -4.0])


def test_a_history_that_does_not_know_it_leaves_the_newest_state(world):
    landing = Landing(OPTIONS, lambda boot_ns: Unpaired(Reason.STALE_ATTITUDE))
    out = landing.on_tracks((world.track(),), world.situation())
    assert [out.fields["x"], out.fields["y"]] == pytest.approx([4.0, 3.0])


def test_a_long_lag_is_looked_up_in_the_history_and_not_guessed_without_one(world):
    """PLND_LAG may be 0.25 s, longer than rates can be trusted."""
    for state_at, sent in ((lambda boot_ns: world.state(), True), (None, False)):
        landing = Landing(OPTIONS, state_at)
        landing.lag_s = 0.25
        assert (landing.on_tracks((world.track(),), world.situation()) is not None) is sent


def test_a_moving_target_is_carried_to_that_instant(world, landing):
    moving = world.track(at=world.NOW - 200_000_000, velocity_ned=(0.0, 2.0, 0.0))
    fields = landing.on_tracks((moving,), world.situation()).fields
    assert fields["y"] == pytest.approx(3.0 + 2.0 * 0.2)
    assert fields["time_usec"] == world.NOW // 1000, "the instant of the prediction"


def test_px4_gets_its_own_position_plus_our_difference_at_the_newest_attitude(world):
    own, asked = (120.0, -40.0, -13.0), []  # another origin, another projection

    def local_position_at(boot_ns):
        asked.append(boot_ns)
        return own

    vehicle = world.state(at=world.NOW - 30_000_000, q=world.quaternion(yaw_deg=77), position=(1.0, 1.0, -9.0))
    landing = Landing(OPTIONS, local_position_at=local_position_at)
    out = landing.on_tracks((world.track(),), world.situation(kind=AutopilotKind.PX4, vehicle=vehicle))
    got = world.packed(out)
    assert asked == [vehicle.boot_ns]
    assert (got["frame"], got["position_valid"]) == (mavlink.MAV_FRAME_LOCAL_NED, 1)
    assert [got["x"], got["y"], got["z"]] == pytest.approx([120.0 + 3.0, -40.0 + 2.0, -13.0 + 9.0], abs=1e-5)
    assert got["distance"] == pytest.approx(np.sqrt(9 + 4 + 81), rel=1e-6)
    assert got["time_usec"] == (world.NOW - 30_000_000) // 1000


@pytest.mark.parametrize(("kind", "frame"), [(AutopilotKind.ARDUPILOT, 12), (AutopilotKind.PX4, 1)])
def test_without_a_global_position_the_height_comes_from_the_fix_itself(world, kind, frame):
    """The camera 0.5 m ahead of the vehicle, 7 m above a floor that the autopilot's altitude puts 2 m lower."""
    options = structs.replace(OPTIONS, camera_position_m=(0.5, 0.0, 0.0))
    landing = Landing(options, local_position_at=lambda _: (0.0, 0.0, 0.0))
    landing.lag_s = 0.0
    target = (2.0, 1.0, 0.0)
    down_the_ray = np.array([2.0, 1.0, 7.0]) / np.linalg.norm([2.0, 1.0, 7.0])
    in_camera = tuple(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]).T @ down_the_ray)
    seen = world.track(position_ned=target, fix=world.fix(target, ray=in_camera))
    hovering = world.state(q=world.quaternion(yaw_deg=90), position=None, velocity=None, height=9.0)
    fields = landing.on_tracks((seen,), world.situation(kind=kind, plane=None, vehicle=hovering)).fields
    north_east_down = (2.0, 1.5, 7.0)  # the nose points east
    in_body = (1.5, -2.0, 7.0)
    assert fields["frame"] == frame
    expected = in_body if kind is AutopilotKind.ARDUPILOT else north_east_down
    assert [fields["x"], fields["y"], fields["z"]] == pytest.approx(expected)


def test_straight_below_the_height_is_the_autopilots_or_there_is_none(world, landing):
    hovering = world.state(position=None, velocity=None, height=9.0)
    below = world.track(position_ned=(0.0, 0.0, 0.0))
    fields = landing.on_tracks((below,), world.situation(plane=None, vehicle=hovering)).fields
    assert fields["z"] == pytest.approx(9.0)
    unknown = structs.replace(hovering, height_above_home_m=None)
    later = world.track(position_ned=(0.0, 0.0, 0.0), at=world.NOW + 1000)
    assert landing.on_tracks((later,), world.situation(world.NOW + 1000, plane=None, vehicle=unknown)) is None
    assert landing.last_withheld is Withheld.NO_HEIGHT


def test_height_above_the_landing_point_is_that_of_the_tags_size_and_the_climb_since(world):
    """Reported 10 m high by a barometer, 6 m above the tag 0.4 s ago, sinking at 0.5 m/s, the camera 0.1 m low."""
    landing = Landing(structs.replace(OPTIONS, camera_position_m=(0.0, 0.0, 0.1)))
    landing.lag_s = 0.0
    before = world.NOW - 400_000_000
    sinking = {"velocity": (0.0, 0.0, 0.5)}
    fix = world.fix((4.0, 3.0, 0.0), at=before)
    fix = structs.replace(
        fix, best_height_m=6.0, sighting=structs.replace(fix.sighting, state=world.state(before, **sinking))
    )
    seen = world.track(fix=fix, at=before)
    fields = landing.on_tracks((seen,), world.situation(vehicle=world.state(**sinking))).fields
    assert [fields["x"], fields["y"], fields["z"]] == pytest.approx([4.0, 3.0, 5.9])
    assert fields["distance"] == pytest.approx(np.linalg.norm([4.0, 3.0, 5.9]))


@pytest.mark.parametrize("height_m", [None, 9.0])
def test_height_straight_above_a_tag_of_known_size_needs_no_altitude(world, landing, height_m):
    fix = world.fix((0.0, 0.0, 0.0))
    by_size = structs.replace(fix.sighting, size_height=SizeHeight(5.0, 0.02, 0.01))
    below = world.track(position_ned=(0.0, 0.0, 0.0), fix=structs.replace(fix, best_height_m=5.0, sighting=by_size))
    hovering = world.state(position=None, velocity=None, height=height_m)
    fields = landing.on_tracks((below,), world.situation(plane=None, vehicle=hovering)).fields
    assert fields["z"] == pytest.approx(5.0)


def refused(landing, track, situation):
    assert landing.on_tracks((track,) if track is not None else (), situation) is None
    assert landing.withheld[landing.last_withheld] == 1
    assert sum(landing.withheld.values()) == 1
    return landing.last_withheld


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"label": "person"}, Withheld.NO_TARGET),
        ({"state": TrackState.TENTATIVE}, Withheld.NO_TARGET),
        ({"state": TrackState.COASTING}, Withheld.NO_TARGET),
        ({"state": TrackState.DROPPED}, Withheld.NO_TARGET),
        ({"relative_cov": ((0.26, 0, 0), (0, 0.01, 0), (0, 0, 0))}, Withheld.TOO_UNCERTAIN),
        ({"relative_cov": ((0.15, 0.14, 0), (0.14, 0.15, 0), (0, 0, 0))}, Withheld.TOO_UNCERTAIN),
        ({"relative_cov": ((nan, 0, 0), (0, 0.01, 0), (0, 0, 0))}, Withheld.TOO_UNCERTAIN),
        ({"relative_cov": ((0.01, nan, 0), (nan, 0.01, 0), (0, 0, 0))}, Withheld.TOO_UNCERTAIN),
        ({"relative_cov": ((inf, 0, 0), (0, inf, 0), (0, 0, 0))}, Withheld.TOO_UNCERTAIN),
        ({"at": 39_998_300_000_000}, Withheld.LATE_FRAME),
        ({"last_seen_host_ns": 39_998_300_000_000, "with_fix": False}, Withheld.NOT_SEEN),
    ],
)
def test_what_may_not_steer_is_withheld_for_its_reason(world, landing, changes, reason):
    assert refused(landing, world.track(**changes), world.situation()) is reason


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"kind": None}, Withheld.NO_AUTOPILOT),
        ({"kind": AutopilotKind.OTHER}, Withheld.UNKNOWN_AUTOPILOT),
        ({"vehicle": None}, Withheld.NO_VEHICLE),
        ({"kind": AutopilotKind.PX4, "vehicle": None}, Withheld.NO_VEHICLE),
        ({"kind": AutopilotKind.PX4}, Withheld.NO_LOCAL_POSITION),
    ],
)
def test_nothing_is_sent_into_the_unknown(world, landing, changes, reason):
    assert refused(landing, world.track(), world.situation(**changes)) is reason


def test_an_old_attitude_does_not_steer(world, landing):
    stale = world.situation(vehicle=world.state(at=world.NOW - 150_000_000))
    assert refused(landing, world.track(), stale) is Withheld.NO_VEHICLE


def test_the_bound_does_not_count_the_vehicles_own_position(world, landing):
    """cov includes it, relative_cov does not."""
    lost_vehicle = world.track(cov=world.diagonal(30.0, 30.0, 30.0))
    assert landing.on_tracks((lost_vehicle,), world.situation()) is not None


def test_off_means_off(world):
    landing = Landing(PublishOptions(landing_label="pad"))
    assert landing.on_tracks((world.track(),), world.situation()) is None
    assert sum(landing.withheld.values()) == 0


def test_the_oldest_confirmed_is_kept_until_it_is_dropped(world, landing):
    old = world.track(7, confirmed_at=world.NOW - 9_000_000_000)
    young = world.track(3, confirmed_at=world.NOW - 2_000_000_000)
    landing.on_tracks((young, old), world.situation())
    assert landing.target == 7
    older = world.track(9, at=world.NOW + 1000, confirmed_at=world.NOW - 99_000_000_000)
    later = world.situation(world.NOW + 1000)
    assert landing.on_tracks((older, world.track(7, at=world.NOW + 1000)), later).fields["target_num"] == 7
    coasting = world.track(
        7, at=world.NOW + 2000, state=TrackState.COASTING, with_fix=False, last_seen_host_ns=world.NOW
    )
    out = landing.on_tracks((world.track(3, at=world.NOW + 2000), coasting), world.situation(world.NOW + 2000))
    assert out.fields["target_num"] == 7, "it coasts, and is predicted"
    dropped = world.track(7, at=world.NOW + 3000, state=TrackState.DROPPED, reason=Reason.NOT_SEEN)
    out = landing.on_tracks((world.track(3, at=world.NOW + 3000), dropped), world.situation(world.NOW + 3000))
    assert out.fields["target_num"] == 3


@pytest.mark.parametrize("state", [TrackState.CONFIRMED, TrackState.COASTING])
def test_it_goes_on_with_what_the_chosen_one_turned_out_to_be(world, landing, state):
    """Even if another pad was confirmed before: the vehicle is descending to this one."""
    landing.on_tracks((world.track(7),), world.situation())
    other = world.track(3, at=world.NOW + 1, confirmed_at=world.NOW - 99 * world.S)
    same = world.track(9, at=world.NOW + 1, state=state, replaces=(7,))
    landing.on_tracks((other, same), world.situation())
    assert landing.target == 9


# The claim decides, and what the pilot reads.
