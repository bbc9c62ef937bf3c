"""The measurements that self-calibration takes from a frame, and the instants for which it requests vehicle states."""

import msgspec
import numpy as np
import pytest
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration.calibration_context import CalibrationContext
from fwav_companion.self_calibration.calibrator import Calibrator
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.joint_filter import joint_of
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT
from fwav_companion.self_calibration.relinearization import Relinearization

DELAY_S = 0.03
ROW_NS = 2_000_000
SIGMAS = (0.005, *np.radians([1.0, 1.0, 1.0, 2.0]), 0.1, 0.0, 0.0, 0.0)


def taught(targets):
    """(measurements that one frame with this number of targets adds, instants requested meanwhile)."""
    world = World(Flight(seconds=3, shape="hover", height_m=10.0, targets=((4.0, 3.0),), pixel_px=0.5))
    fix = [fix for view in world.frames() for fix in view.fixes][30]
    asked = []

    def state_at(boot_ns):
        asked.append(boot_ns)
        return world.state_at(boot_ns)

    means = (DELAY_S, *(0.0,) * (COMMON_COUNT - 1))
    tracks, places = tuple(range(1, targets + 1)), (4.0, 3.0) * targets
    joint = joint_of(priors(), SIGMAS, means, means)
    joint = msgspec.structs.replace(
        joint,
        mean=(*means, *places),
        around=(*means, *places),
        cov=tuple(map(tuple, np.diag([*np.square(SIGMAS), *[0.1] * (2 * targets)]).tolist())),
        tracks=tracks,
    )
    passes = Relinearization(complete=False, delay_s=DELAY_S, served=FilterPass(joint))
    calibrator = Calibrator(CalibrationContext(priors(), state_at), passes=passes)
    frame_ns, fixes = fix.sighting.frame_host_ns, []
    for track in tracks:
        boot_ns = fix.sighting.boot_ns + track * ROW_NS
        sighting = msgspec.structs.replace(fix.sighting, state=world.state_at(boot_ns))
        fixes.append((track, msgspec.structs.replace(fix, sighting=sighting)))
    calibrator = calibrator.learned(frame_ns, (), fixes, tracks).learned(frame_ns + 10**9, (), [], tracks)
    after = calibrator.passes.served
    return after.used + after.refused, {(boot_ns - fix.sighting.boot_ns + 30_000_000) // ROW_NS for boot_ns in asked}


@pytest.mark.parametrize(("targets", "taken"), [(1, 1), (3, 3), (5, 5), (10, 2), (15, 2)])
def test_of_many_targets_a_frame_teaches_by_few(targets, taken):
    assert taught(targets)[0] == taken


def test_each_fix_is_taken_by_the_vehicle_at_its_own_row():
    """Rows of a frame are captured one after another while the vehicle rotates."""
    _, rows = taught(5)
    assert rows >= {1, 2, 3, 4, 5}
