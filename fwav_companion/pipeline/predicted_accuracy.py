"""Predicted accuracy of a target straight below the vehicle, before one is seen. Pure."""

from __future__ import annotations

from math import isfinite

import msgspec

from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.vectors import multiply, transform
from fwav_companion.localization import Localizer
from fwav_companion.pairing import Pairer, VehicleSource
from fwav_companion.types import GroundFix, NoFix, NoRay, Reason, Sighting, Unpaired

FLYING_M = 2.0
"""Height of flight, metres. Below it the vehicle is about to take off, and the prediction is made for
:data:`NOMINAL_M`."""
NOMINAL_M = 10.0
"""Height for which the accuracy is predicted before take-off, metres."""


class PredictedAccuracy(msgspec.Struct, frozen=True):
    """Predicted accuracy of one fix."""

    within95_m: float
    """Radius of the 95 % circle, relative to the vehicle, metres."""
    height_m: float
    """Height of the camera above the ground for that radius, metres."""


def predicted_accuracy_below(
    pairer: Pairer, localizer: Localizer, telemetry: VehicleSource
) -> PredictedAccuracy | Reason:
    """Accuracy of a fix straight below, by the vehicle's newest state; or the reason why there would be no fix."""
    sighting = _look_down(pairer, telemetry)
    if isinstance(sighting, Reason):
        return sighting
    height_m = _height_m(localizer, sighting)
    if not isinstance(height_m, Reason) and height_m < FLYING_M:
        raised = _raised(sighting, NOMINAL_M - height_m)
        raised_m = _height_m(localizer, raised)
        if not isinstance(raised_m, Reason) and raised_m > height_m:  # not so where the ground's distance is fixed
            sighting, height_m = raised, raised_m
    fix = localizer.locate(sighting)
    if isinstance(height_m, Reason):
        return height_m
    if not isinstance(fix, GroundFix):
        return fix.reason
    within95_m = radius_95(fix.relative_cov)
    return PredictedAccuracy(within95_m, height_m) if isfinite(within95_m) else Reason.NOT_FINITE


def _look_down(pairer: Pairer, telemetry: VehicleSource) -> Sighting | Reason:
    """Sighting of the point straight below, or of the picture's middle where that point is outside the picture."""
    state = telemetry.newest_state()
    if isinstance(state, Unpaired):
        return state.reason
    host_ns = telemetry.clock.host_from_boot(state.boot_ns)
    if isinstance(host_ns, Unpaired):
        return host_ns.reason
    ned_from_camera = multiply(matrix_from_quaternion(state.ned_from_carrier), pairer.body_from_camera)
    below = pairer.lens.pixel_from_camera_point(ned_from_camera[2])
    width, height = pairer.lens.image_size
    middle = ((width - 1) / 2, (height - 1) / 2)
    pixels = [middle] if isinstance(below, NoRay) else [below, middle]
    reason = Reason.OUTSIDE_LENS
    for u, v in pixels:
        sighting = pairer.look_at(u, v, sigma_px=None, host_ns=host_ns, vehicle=telemetry)
        if isinstance(sighting, Sighting):
            return sighting
        reason = sighting.reason
    return reason


def _height_m(localizer: Localizer, sighting: Sighting) -> float | Reason:
    meeting = localizer.ground.meet(sighting, transform(sighting.ned_from_camera, sighting.ray.direction))
    return meeting.reason if isinstance(meeting, NoFix) else meeting.height_m


def _raised(sighting: Sighting, by_m: float) -> Sighting:
    """The sighting from a higher camera, without a range measurement."""
    north, east, down = sighting.camera_ned
    above_home_m = sighting.camera_height_above_home_m
    return msgspec.structs.replace(
        sighting,
        camera_ned=(north, east, down - by_m),
        camera_height_above_home_m=None if above_home_m is None else above_home_m + by_m,
        state=msgspec.structs.replace(sighting.state, range=None),
    )
