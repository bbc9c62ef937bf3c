"""Detections paired with the vehicle's state: each at the instant of its own row, or refused by name."""

from math import inf, nan

import numpy as np
import pytest
from placing import DOWN, HOST_FROM_BOOT_NS, MS, Clocks, Pinhole, StillVehicle, frame, pairer
from scipy.spatial.transform import Rotation

from fwav_companion.geometry.rotations import quaternion_from_euler
from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.pairing import CameraTiming, PairedFrame, RefusedFrame
from fwav_companion.pairing.placement import scaling_from_size
from fwav_companion.types import Detection, Lens, Reason, StampClock, Unpaired

CENTRE = (320.0, 240.0)


def whole(reported: PairedFrame | RefusedFrame) -> PairedFrame:
    assert isinstance(reported, PairedFrame), reported
    return reported


def refusal(reported: PairedFrame | RefusedFrame) -> Reason:
    assert isinstance(reported, RefusedFrame), reported
    return reported.reason


def test_each_detection_at_its_own_row():
    vehicle = StillVehicle()
    timing = CameraTiming(time_offset_s=0.005, readout_s=0.024)
    paired = whole(pairer(timing=timing).pair(frame((300.0, 60.0), CENTRE, (300.0, 440.0)), vehicle))
    assert paired.boot_ns == 4995 * MS
    assert paired.host_ns == HOST_FROM_BOOT_NS + 4995 * MS
    rows_ms = [(s.boot_ns / MS, (s.host_ns - HOST_FROM_BOOT_NS) / MS, s.row_fraction) for s in paired.sightings]
    assert rows_ms == [
        pytest.approx((4998.0, 4998.0, 0.125)),
        pytest.approx((5007.0, 5007.0, 0.5)),
        pytest.approx((5017.0, 5017.0, 440 / 480)),
    ]
    assert [s.frame_host_ns for s in paired.sightings] == [paired.host_ns] * 3


def test_the_camera_is_where_attitude_lever_arm_and_mount_put_it():
    """Against scipy's rotations."""
    euler = (0.2, 0.6, -1.1)
    q = quaternion_from_euler(*euler)
    ned_from_body = Rotation.from_euler("ZYX", euler[::-1])
    arm = (0.1, -0.05, 0.3)
    vehicle = StillVehicle(ned_from_body=q)
    (sighting,) = whole(pairer(lever_arm_m=arm).pair(frame(CENTRE), vehicle)).sightings
    assert sighting.camera_ned == pytest.approx(np.add(ned_from_body.apply(arm), (100.0, 50.0, -10.0)))
    axis = ned_from_body.apply([0.0, 0.0, 1.0])  # the camera looks along body down
    assert [row[2] for row in sighting.ned_from_camera] == pytest.approx(axis)
    assert sighting.camera_height_above_home_m == pytest.approx(10.0 - ned_from_body.apply(arm)[2])
    assert sighting.body_from_camera == DOWN


def test_times_noise_is_of_the_clock_and_of_the_stamps():
    (sighting,) = whole(pairer().pair(frame(CENTRE), StillVehicle(clock=Clocks(sigma_s=0.0004)))).sightings
    assert sighting.time_noise_s == pytest.approx(0.0005)
    on_boot = frame(CENTRE, stamp_ns=5000 * MS, stamp_clock=StampClock.BOOT)
    (sighting,) = whole(pairer().pair(on_boot, StillVehicle(clock=Clocks(sigma_s=0.0004)))).sightings
    assert sighting.time_noise_s == pytest.approx(0.0003)
    assert sighting.host_ns - sighting.boot_ns == HOST_FROM_BOOT_NS


def test_pixel_sigma_is_the_detections_own_or_the_configured():
    seen = frame(detections=(Detection(320.0, 240.0), Detection(320.0, 240.0, sigma=(1.0, 2.0))))
    paired = whole(pairer(pixel_noise_px=3.0).pair(seen, StillVehicle()))
    assert [s.pixel_sigma for s in paired.sightings] == [(3.0, 3.0), (1.0, 2.0)]


@pytest.mark.parametrize(
    ("detection", "reason"),
    [
        (Detection(320.0, 240.0, sigma=(0.0, 1.0)), Reason.NOT_FINITE),
        (Detection(320.0, 240.0, sigma=(1.0, nan)), Reason.NOT_FINITE),
        (Detection(320.0, 240.0, score=nan), Reason.NOT_FINITE),
        # The image spans [-0.5, width - 0.5]; the lens ends before its corners.
        (Detection(-0.5, -0.5, label="person"), Reason.OUTSIDE_LENS),
        (Detection(639.5, 479.5, label="person"), Reason.OUTSIDE_LENS),
        (Detection(-0.6, 240.0, label="person"), Reason.OUTSIDE_IMAGE),
        (Detection(320.0, 479.6, label="person"), Reason.OUTSIDE_IMAGE),
        (Detection(1e300, 240.0, label="person"), Reason.OUTSIDE_IMAGE),
        (Detection(2.0, 2.0, label="person"), Reason.OUTSIDE_LENS),
        (Detection(320.0, 240.0, score=0.4, label="person"), Reason.LOW_SCORE),
        (Detection(320.0, 240.0, score=0.9, label="car"), Reason.OTHER_LABEL),
        (Detection(320.0, 240.0, score=0.9, label="person"), None),
        (Detection(320.0, 240.0, label="person"), None),
    ],
)
def test_refusals_of_a_detection(detection, reason):
    paired = whole(pairer(min_score=0.5, labels=["person"]).pair(frame(detections=(detection,)), StillVehicle()))
    if reason is None:
        assert len(paired.sightings) == 1
        assert paired.refused == ()
    else:
        assert [(index, why) for index, why, _ in paired.refused] == [(0, reason)]
        assert paired.sightings == ()


@pytest.mark.parametrize("pixel", [(nan, 240.0), (320.0, inf), (nan, nan)])
def test_a_frame_without_a_finite_pixel_leaves_its_stamp_to_the_valid_one(pixel):
    one = pairer()
    assert refusal(one.pair(frame(pixel, pixel, number=7), StillVehicle())) is Reason.NOT_FINITE
    assert len(whole(one.pair(frame(CENTRE, number=7), StillVehicle())).sightings) == 1
    mixed = whole(one.pair(frame(CENTRE, pixel, number=8), StillVehicle()))
    assert [(index, why) for index, why, _ in mixed.refused] == [(1, Reason.NOT_FINITE)]


def test_one_refused_detection_leaves_the_others_their_index():
    paired = whole(pairer().pair(frame(CENTRE, (-5.0, 0.0), (300.0, 200.0)), StillVehicle()))
    assert [s.index for s in paired.sightings] == [0, 2]
    assert paired.refused == ((1, Reason.OUTSIDE_IMAGE, None),)


def test_rows_beyond_the_attitudes_are_refused_each_for_itself():
    vehicle = StillVehicle()
    vehicle.newest_ns = BootNs(5010 * MS)
    paired = whole(pairer(timing=CameraTiming(readout_s=0.024)).pair(frame((320.0, 100.0), (320.0, 400.0)), vehicle))
    assert [s.index for s in paired.sightings] == [0]
    assert paired.refused == ((1, Reason.STALE_ATTITUDE, pytest.approx(0.01)),)
    assert paired.view is not None


def test_a_vehicle_that_is_nowhere_sees_nothing():
    vehicle = StillVehicle()
    vehicle.newest_ns = BootNs(0)
    paired = whole(pairer().pair(frame(CENTRE), vehicle))
    assert isinstance(paired.state, Unpaired)
    assert paired.view is None


@pytest.mark.parametrize("relative", [False, None])
def test_an_expected_position_that_is_not_there(relative):
    paired = whole(pairer().pair(frame(CENTRE), StillVehicle(position_ned=None, relative=relative)))
    assert [why for _, why, _ in paired.refused] == [Reason.NO_POSITION]


def test_a_relative_world_needs_no_position():
    vehicle = StillVehicle(position_ned=None, relative=True)
    paired = whole(pairer().pair(frame(CENTRE), vehicle))
    assert paired.sightings[0].relative
    assert paired.sightings[0].camera_ned == (0.0, 0.0, 0.0)
    assert paired.view.could_see((0.0, 0.0, 0.0))  # the ground straight below
    assert not paired.view.could_see((9.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"after_ms": -5.9}, None),
        ({"after_ms": -7.0}, Reason.FROM_THE_FUTURE),
        ({"after_ms": 499.0}, None),
        ({"after_ms": 501.0}, Reason.TOO_LATE),
        ({"arrival_ns": None, "after_ms": 0.0}, None),
        ({"detections": (Detection(320.0, 240.0),) * 256}, None),
        ({"detections": (Detection(320.0, 240.0),) * 257}, Reason.TOO_MANY_DETECTIONS),
        ({"size": (320, 240)}, None),
        ({"size": (640, 360)}, Reason.WRONG_SIZE),
        ({"size": (0, 0)}, Reason.WRONG_SIZE),
    ],
)
def test_refusals_of_a_frame(changed, reason):
    """A capture may lie 5 ms and three sigma of 0.5 ms after its arrival, and 0.5 s before it."""
    reported = pairer(timing=CameraTiming(readout_s=0.0)).pair(frame(CENTRE, **changed), StillVehicle())
    assert (reported.reason if isinstance(reported, RefusedFrame) else None) == reason


@pytest.mark.parametrize(
    ("size", "calibrated", "fits"),
    [
        ((101, 75), (640, 480), True),  # 100 columns, or 75.75 rows
        ((75, 101), (480, 640), True),
        ((75, 100), (480, 640), True),
        ((102, 75), (640, 480), False),
        ((75, 102), (480, 640), False),
        ((100, 76), (640, 480), False),
        ((76, 100), (480, 640), False),
    ],
)
def test_a_shape_is_the_calibrations_if_one_side_is_rounded(size, calibrated, fits):
    """A scaler rounds one side to whole pixels, up or down: that side is less than a pixel off."""
    scaling = scaling_from_size(size, calibrated)
    assert (scaling is not Reason.WRONG_SIZE) == fits
    if fits:
        assert (scaling.horizontal, scaling.vertical) == (calibrated[0] / size[0], calibrated[1] / size[1])


def test_no_clock():
    reported = pairer().pair(frame(CENTRE, CENTRE), StillVehicle(clock=Clocks(known=False)))
    assert reported == RefusedFrame(None, Reason.NO_CLOCK, 2)


def test_duplicates():
    one = pairer()
    assert whole(one.pair(frame(CENTRE, number=7), StillVehicle())).number == 7
    assert refusal(one.pair(frame((1.0, 200.0), number=7), StillVehicle())) is Reason.DUPLICATE_FRAME
    whole(one.pair(frame(CENTRE, number=7, boot_ms=5040.0), StillVehicle()))  # a restarted source counts from the start
    whole(one.pair(frame(CENTRE, number=8), StillVehicle()))


def test_unnumbered_frames_are_counted_and_two_detectors_may_share_an_image():
    one = pairer()
    assert whole(one.pair(frame(CENTRE), StillVehicle())).number == 0
    assert whole(one.pair(frame((300.0, 200.0)), StillVehicle())).number == 1
    assert refusal(one.pair(frame(CENTRE), StillVehicle())) is Reason.DUPLICATE_FRAME
    assert whole(one.pair(frame(boot_ms=5040.0), StillVehicle())).number == 2


def test_a_frame_that_came_too_late_may_come_again_in_time():
    one = pairer()
    assert refusal(one.pair(frame(CENTRE, number=7, after_ms=900.0), StillVehicle())) is Reason.TOO_LATE
    whole(one.pair(frame(CENTRE, number=7), StillVehicle()))


HALF_CORNERS = ((-0.5, -0.5), (319.5, -0.5), (319.5, 239.5), (-0.5, 239.5))


def test_other_sizes_of_the_same_shape_are_scaled_about_pixel_edges():
    half = Detection(159.75, 119.75, sigma=(2.0, 2.0), box=(-0.5, -0.5, 319.5, 239.5), corners=HALF_CORNERS)
    (sighting,) = whole(pairer().pair(frame(detections=(half,), size=(320, 240)), StillVehicle())).sightings
    assert (sighting.detection.u, sighting.detection.v) == CENTRE
    assert sighting.detection.box == (-0.5, -0.5, 639.5, 479.5)
    assert sighting.detection.corners == ((-0.5, -0.5), (639.5, -0.5), (639.5, 479.5), (-0.5, 479.5))
    assert sighting.pixel_sigma == (4.0, 4.0)


def test_what_a_frame_waits_for_is_the_latest_row_in_which_something_was_seen():
    timing = CameraTiming(readout_s=0.032, time_offset_s=0.01)
    assert pairer(timing=timing).attitude_needed_until(frame(CENTRE), Clocks()) == 5006 * MS
    assert pairer(timing=timing).attitude_needed_until(frame(CENTRE), Clocks(known=False)) is None
    assert (
        pairer(timing=timing).attitude_needed_until(frame(CENTRE, (320.0, 360.0), (320.0, 120.0)), Clocks())
        == 5014 * MS
    )
    half = frame(detections=(Detection(159.75, 119.75),), size=(320, 240))
    assert pairer(timing=timing).attitude_needed_until(half, Clocks()) == 5006 * MS
    on_boot = frame(CENTRE, stamp_ns=5000 * MS, stamp_clock=StampClock.BOOT)
    assert pairer(timing=timing).attitude_needed_until(on_boot, Clocks(known=False)) == 5006 * MS


def test_a_frame_waits_for_its_row_0_whatever_was_seen():
    timing = CameraTiming(readout_s=0.032, time_offset_s=0.01)
    for nowhere in (frame(), frame((320.0, 1e300)), frame((320.0, nan)), frame((320.0, 240.0), size=(0, 0))):
        assert pairer(timing=timing).attitude_needed_until(nowhere, Clocks()) == 4990 * MS
    upward = CameraTiming(readout_s=-0.032, time_offset_s=0.01)
    assert pairer(timing=upward).attitude_needed_until(frame(CENTRE), Clocks()) == 5022 * MS


def test_a_recorded_frame_without_arrival_comes_at_its_last_capture_or_its_stamp():
    late = CameraTiming(readout_s=0.03, time_offset_s=0.05)
    early = CameraTiming(readout_s=0.03, time_offset_s=-0.05)
    untold = frame(CENTRE, arrival_ns=None)
    assert pairer(timing=late).assumed_arrival(untold, Clocks()) == HOST_FROM_BOOT_NS + 5000 * MS
    assert pairer(timing=early).assumed_arrival(untold, Clocks()) == HOST_FROM_BOOT_NS + 5080 * MS
    on_boot = frame(CENTRE, stamp_ns=5000 * MS, stamp_clock=StampClock.BOOT, arrival_ns=None)
    assert pairer(timing=early).assumed_arrival(on_boot, Clocks()) == HostNs(HOST_FROM_BOOT_NS + 5080 * MS)


def test_what_the_camera_could_see():
    view = whole(pairer().pair(frame(CENTRE), StillVehicle())).view
    assert view.could_see((100.0, 50.0, 0.0))
    assert view.pixel_of((102.0, 53.0, 0.0)) == pytest.approx((320.0 + 90.0, 240.0 - 60.0))
    assert not view.could_see((100.0, 50.0, -20.0))  # above it
    assert not view.could_see((100.0, 62.0, 0.0))  # outside the image
    assert not view.could_see((107.9, 50.0, 0.0))


def test_the_lens_of_these_tests_is_one():
    lens: Lens = Pinhole()
    ray = lens.camera_ray_from_pixel(350.0, 200.0)
    assert lens.pixel_from_camera_point(ray) == pytest.approx((350.0, 200.0))


@pytest.mark.parametrize(("readout_s", "expected"), [(0.02, 0.5), (None, 1.125)], ids=["known", "unknown"])
def test_an_unknown_readout_is_as_doubtful_as_the_frames_are_apart(readout_s, expected):
    """At 10 frames/s it lies in [0, 75 ms], 2.25 times the 30 frames/s that the bias's prior is made for."""
    ours, vehicle = pairer(timing=CameraTiming(readout_s=readout_s)), StillVehicle()
    for number in range(5):
        reported = whole(ours.pair(frame(CENTRE, boot_ms=4500.0 + number * 100.0), vehicle))
    assert reported.sightings[0].row_fraction == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(
    ("u", "v", "inside"),
    [
        *((-0.4, 240.0, True), (-0.6, 240.0, False), (639.4, 240.0, True), (639.6, 240.0, False)),
        *((320.0, -0.4, True), (320.0, -0.6, False), (320.0, 479.4, True), (320.0, 479.6, False)),
        *((500.0, 470.0, True), (500.0, 480.0, False), (600.0, 5.0, True), (-5.0, 5.0, False), (5.0, -5.0, False)),
    ],
)
def test_an_image_ends_half_a_pixel_beyond_its_outer_pixels_on_all_four_sides(u, v, inside):
    """Camera straight down, north is up: 10 m below, a pixel is a thirtieth of a metre."""
    view = whole(pairer(lens=Wide()).pair(frame(CENTRE), StillVehicle())).view
    place = (100.0 + (240.0 - v) / 30.0, 50.0 + (u - 320.0) / 30.0, 0.0)
    assert (view.pixel_of(place) is not None) is inside
    assert view.could_see(place) is inside


class Wide(Pinhole):
    """A pinhole without a limit of its angle."""

    def pixel_from_camera_point(self, point):
        x, y, z = point
        return (320.0 + 300.0 * x / z, 240.0 + 300.0 * y / z)
