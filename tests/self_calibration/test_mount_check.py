"""Gross errors of the mount: reported with the true mount, and no target is reported as certain meanwhile."""

import re

import msgspec
import numpy as np
import pytest
import simulated_flight
from draws import first_of
from scipy.spatial.transform import Rotation
from simulated_flight import BODY_FROM_CAMERA, Flight, priors
from simulated_world import World

from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.self_calibration.mount_check import MountCheck
from fwav_companion.self_calibration.sights import expected_spread, sight_of, sights_of
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias

MOUNT = [Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]
LEVEL = {"fps": 10.0, "pitch_deg": 0.0, "targets": ((1.0, 2.0),), "seconds": 45.0}


@pytest.fixture(autouse=True)
def _wide_lens(monkeypatch):
    """75 degrees from the middle to the side."""
    monkeypatch.setattr(simulated_flight, "FOCAL", 244.0)
    monkeypatch.setattr(simulated_flight, "CUBIC", -4.0)


def crooked(vector_deg, **options):
    """A flight with a camera rotated from the configured mount by this rotation vector in body axes."""
    biases = np.zeros(BIAS_COUNT)
    biases[MOUNT] = -np.radians(vector_deg)
    return Flight(biases=biases, **LEVEL | options)


def flown(flight, **options):
    """(reported calibration, confirmed tracks) after each frame."""
    world = World(flight)
    tracker = make_tracker(TrackingOptions(self_calibration=True, **options), flight.priors, world.state_at)
    for view in world.frames():
        tracks = tracker.on_frame(view)
        yield tracker.calibration, [track for track in tracks if track.confirmed_host_ns is not None]


def nominally(state):
    return state


@pytest.mark.parametrize(
    "vector_deg", first_of((-20, 25, 10), (18, 0, 0), (0, 20, 0), (0, 0, 25), (0, -45, 0), (30, 30, 30))
)
def test_a_mount_far_off_is_named_as_it_is_and_nothing_is_reported_as_certain(vector_deg):
    named, doubted = "", []
    for report, tracks in flown(crooked(vector_deg)):
        named = report.mistake or named
        if report.mistake:
            assert report.status is CalibrationStatus.WAITING
            doubted += tracks
    reported = [float(number) for number in re.findall(r"-?\d+", named)]
    true = Rotation.from_rotvec(np.radians(vector_deg)) * BODY_FROM_CAMERA
    as_told = Rotation.from_matrix(body_from_camera_from_euler(*np.radians(reported[1:])))
    assert reported[0] == pytest.approx(np.linalg.norm(vector_deg), abs=3)
    assert np.degrees((true.inv() * as_told).magnitude()) < 4

    assert doubted
    assert all(track.fix is None for track in doubted)
    for cov in (lambda track: track.cov, lambda track: track.relative_cov):
        squares = []
        for track in doubted:
            error = np.subtract(track.position_ned[:2], (1.0, 2.0))
            squares.append(error @ np.linalg.solve(np.array(cov(track))[:2, :2], error))
        assert max(squares) < 13.8


@pytest.mark.slow
@pytest.mark.parametrize("vector_deg", first_of((6, 0, 0), (0, 0, 0), (0, -8, 0)))
def test_a_mount_that_self_calibration_finds_is_not_named(vector_deg):
    for report, tracks in flown(crooked(vector_deg)):  # noqa: B007
        assert report.mistake == ""
    assert np.degrees(report.mount) == pytest.approx(vector_deg, abs=0.3)
    assert np.sqrt(tracks[0].cov[0][0]) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("seed", first_of(0, 1, 2))
def test_who_walks_is_no_crooked_mount(seed):
    angle = 2.0 * seed
    flight = Flight(**LEVEL | {"seconds": 40.0}, seed=seed, velocities=((1.5 * np.cos(angle), 1.5 * np.sin(angle)),))
    assert not any(report.mistake for report, _ in flown(flight, motion="moving"))


def test_sights_meet_under_the_mount_that_is_there_and_nowhere_else():
    world = World(crooked((10, 0, 5), pixel_px=0.1, stamp_late_s=0.0))
    fixes = [view.fixes[0] for view in world.frames() if len(view.fixes) == 1]
    sights = [sight_of(fix, fix.sighting.state, world.flight.priors) for fix in fixes]
    configured = np.array(sights[0].body_from_camera)
    true = (Rotation.from_rotvec(np.radians([10, 0, 5])) * BODY_FROM_CAMERA).as_matrix()
    common, as_configured = sights_of(sights).meeting(np.array([true, configured]))
    assert common.spread < 0.005
    assert common.point == pytest.approx((1.0, 2.0), abs=0.05)
    assert sights_of(sights[-5:]).missed(common) < 0.005
    assert as_configured.spread > 0.1
    off = [np.hypot(*np.subtract(fix.position_ned[:2], (1.0, 2.0))) for fix in fixes]
    assert sights_of(sights).misplaced_m(common, configured) == pytest.approx(np.median(off), rel=0.05)


@pytest.mark.parametrize(("displaced_m", "position_m", "range_m"), [(0.1, 0.0, 2.0), (0.0, 1.0, 1.0), (0.1, 1.0, 12.0)])
def test_sights_spread_as_expected_by_noise_and_a_wandering_position(displaced_m, position_m, range_m):
    """5 sights/s for 16 s; 400 draws of a first-order process of 60 s, and of noise."""
    rng, steps, keep = np.random.default_rng(1), 80, np.exp(-0.2 / 60.0)
    wander = np.empty((400, steps, 2))
    wander[:, 0] = rng.normal(0.0, position_m, (400, 2))
    for k in range(1, steps):
        wander[:, k] = keep * wander[:, k - 1] + rng.normal(0.0, position_m * np.sqrt(1.0 - keep**2), (400, 2))
    points = wander + rng.normal(0.0, displaced_m, (400, steps, 2))
    apart = np.median(np.hypot(*np.moveaxis(points - np.median(points, axis=1, keepdims=True), -1, 0)), axis=1)
    seen = World(Flight(seconds=1.0, fps=5.0)).frames()[-1].fixes[0]
    sight = msgspec.structs.replace(
        sight_of(seen, seen.sighting.state, priors()),
        range_m=range_m,
        displaced_m2=displaced_m**2,
        position_m2=position_m**2,
    )
    sights = [msgspec.structs.replace(sight, host_ns=k * 200_000_000) for k in range(steps)]
    found = expected_spread(sights, priors(position_bias_time_s=60.0))
    assert found == pytest.approx(np.sqrt(np.mean(apart**2)) / range_m, rel=0.15)


def test_sights_are_taken_by_the_delay_that_was_found():
    """With another delay they belong to other attitudes: earlier sights are forgotten, the result is kept."""
    flight = crooked((20, 0, 0))
    fixes = [view.fixes for view in World(flight).frames() if len(view.fixes) == 1]
    suspicion = MountCheck()
    for seen in fixes:
        suspicion = suspicion.seen(seen, nominally, 0.0, flight.priors)
    assert "20 degrees" in suspicion.text

    sighting = fixes[-1][0].sighting
    after = msgspec.structs.replace(sighting, frame_host_ns=sighting.frame_host_ns + 10**9)
    suspicion = suspicion.seen([msgspec.structs.replace(fixes[-1][0], sighting=after)], nominally, 0.05, flight.priors)
    assert (len(suspicion.sights), suspicion.delay_s) == (1, 0.05)
    assert "20 degrees" in suspicion.text
