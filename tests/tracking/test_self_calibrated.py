"""Self-calibration next to filters that it does not correct: the paper's, and one of one's own."""

import msgspec
import numpy as np
import pytest
from handmade import BOOT_NS
from plain_filters import PlainFilter
from simulated_flight import Flight, priors
from simulated_world import World
from smoothed_flights import AHEAD_S, WorldSamples, tracked

from fwav_companion.tracking import TrackingOptions, filter_tracker
from fwav_companion.tracking.smoothed.smoothed_tracker import SmoothedTracker
from fwav_companion.types import BIAS_COUNT, Bias, TrackState
from fwav_companion.types.calibration_report import CalibrationStatus

PLANTED = np.zeros(BIAS_COUNT)
PLANTED[Bias.TIME_OFFSET] = 0.035
PLANTED[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = np.radians([0.5, 1.0, 2.0])
LOW_PASS = TrackingOptions(filter="lowpass")


@pytest.mark.parametrize("own", [None, PlainFilter(moves=False)], ids=["the paper's", "one's own"])
def test_next_to_a_filter_it_finds_its_values_and_moves_nothing(own):
    world = World(Flight(seed=1, fps=15, seconds=40.0, biases=PLANTED))
    samples, p = WorldSamples(world), world.flight.priors
    tracker = filter_tracker(LOW_PASS, p, own, calibrating=SmoothedTracker(p, samples, lever_m=(0.0, 0.0, 0.0)))
    alone = filter_tracker(LOW_PASS, p, own)
    for view in world.frames():
        samples.now_s = (view.boot_ns - BOOT_NS) * 1e-9 + AHEAD_S
        assert tracker.on_frame(view) == alone.on_frame(view)
    report = tracker.calibration
    assert report.status is CalibrationStatus.CALIBRATED
    assert report.time_offset_s == pytest.approx(0.035, abs=0.003)
    assert np.degrees(report.mount) == pytest.approx(-np.degrees(PLANTED[3:6]), abs=0.3)
    assert alone.calibration is None


@pytest.mark.parametrize(("crooked", "state"), [(True, TrackState.COASTING), (False, TrackState.DROPPED)])
def test_a_frame_whose_edge_a_crooked_mount_may_move_did_not_look(crooked, state):
    """The target is 0.3 m inside the image, 11 m away; a mount error of 1.5 degrees moves it by the same distance."""
    angle = np.radians(1.0 if crooked else 0.1)
    p = priors(mount_x=angle, mount_y=angle, mount_z=angle, heading=0.0, time_offset=0.0)
    flight = Flight(
        seconds=7.0, fps=10, shape="hover", height_m=10.0, flapping_deg=0.0, targets=((4.0, 3.0),), priors=p
    )
    world, reported = World(flight), ()
    views = [
        msgspec.structs.replace(view, fixes=view.fixes if k < 12 else (), could_see=lambda place: place[0] < 4.3)
        for k, view in enumerate(world.frames())
    ]
    for _, tracks in tracked(world, views):
        reported = tracks or reported
    assert reported[0].state is state
