"""The measurements that self-calibration takes from a frame, and the instants for which it requests vehicle states."""

import msgspec
import numpy as np
import pytest
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration.calibration_context import KNOT_S, CalibrationContext
from fwav_companion.self_calibration.calibrator import Calibrator
from fwav_companion.self_calibration.filter_pass import filter_pass
from fwav_companion.self_calibration.joint_filter import joint_filter
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.relinearization import Relinearization

DELAY_S = 0.03
SIGMAS = np.array((0.005, *np.radians([1.0, 1.0, 1.0, 2.0]), 0.1, *[0.0] * 5))


def taught(targets, row_ns=2_000_000):
    """(measurements that one frame with this number of targets adds, delays requested before its first row)."""
    world = World(Flight(seconds=3, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5))
    fix = [fix for view in world.frames() for fix in view.fixes][30]
    first_ns, asked = fix.sighting.boot_ns, []

    def state_at(boot_ns):
        asked.append(boot_ns)
        return world.state_at(boot_ns)

    means = np.zeros((1, SHARED_COUNT))
    means[0, 0] = DELAY_S
    tracks = tuple(range(1, targets + 1))
    joint = joint_filter(priors(), SIGMAS, means, means)
    for track in tracks:
        joint = joint.with_target(track, np.array([[4.0, 3.0]]))
    passes = Relinearization(complete=False, delay_s=DELAY_S, served=filter_pass(joint, {}), tracks=frozenset(tracks))
    calibrator = Calibrator(CalibrationContext(priors(), state_at), passes=passes)
    frame_ns, fixes = fix.sighting.frame_host_ns, []
    for k, track in enumerate(tracks):
        sighting = msgspec.structs.replace(fix.sighting, state=world.state_at(first_ns + k * row_ns))
        fixes.append((track, msgspec.structs.replace(fix, sighting=sighting)))
    calibrator = calibrator.updated(frame_ns, (), fixes, tracks).updated(frame_ns + 10**9, (), [], tracks)
    after = calibrator.passes.served
    return int((after.used + after.refused).max()), sorted(1e-9 * (first_ns - boot_ns) for boot_ns in set(asked))


@pytest.mark.parametrize("targets", [1, 3, 10, 20])
def test_every_target_of_a_frame_teaches(targets):
    assert taught(targets)[0] == targets


def test_few_rows_are_measured_with_the_vehicle_at_their_own_instants():
    """Rows of a frame are captured one after another while the vehicle rotates."""
    _, delays = taught(3, row_ns=15_000_000)
    at_rows = [DELAY_S - 0.03, DELAY_S - 0.015, DELAY_S]
    assert [d for d in delays if abs(d - DELAY_S) < 0.05] == pytest.approx(at_rows)


def test_the_readout_of_many_targets_takes_a_few_states():
    _, delays = taught(20, row_ns=1_700_000)
    grid = [d for d in delays if abs(d - DELAY_S) < 0.05]
    assert (grid[0], grid[-1]) == pytest.approx((DELAY_S - 19 * 0.0017, DELAY_S))
    assert len(grid) == 4 + 1, "and the one of the path, at the middle row"
    assert max(np.diff(grid)) <= KNOT_S
