"""What a target straight below would be worth, before there is one. Pure."""

from __future__ import annotations

from math import isfinite

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.vectors import larger_semi_axis, multiply, transform
from fwav_companion.localization import Localizer
from fwav_companion.pairing import Pairer
from fwav_companion.telemetry import Telemetry
from fwav_companion.types import GroundFix, NoFix, NoRay, Sighting, Unpaired

FLYING_M = 2.0
"""Lower than this the vehicle is about to take off, and nobody wants to know how well it sees its own feet."""
NOMINAL_M = 10.0
"""The height that is then spoken of."""


class PredictedAccuracy(msgspec.Struct, frozen=True):
    """Of one fix."""

    sigma_m: float
    """One sigma along the larger horizontal semi-axis, relative to the vehicle."""
    height_m: float
    """Of the camera above the ground, for which that holds."""


def predicted_accuracy_below(pairer: Pairer, localizer: Localizer, telemetry: Telemetry) -> PredictedAccuracy | None:
    """By the vehicle's newest state; None where nothing can be told, as with a camera that looks up."""
    sighting = _look_down(pairer, telemetry)
    if sighting is None:
        return None
    height_m = _height_m(localizer, sighting)
    if height_m is not None and height_m < FLYING_M:
        raised = _raised(sighting, NOMINAL_M - height_m)
        raised_m = _height_m(localizer, raised)
        if raised_m is not None and raised_m > height_m:  # a ground at a fixed distance stays where it is
            sighting, height_m = raised, raised_m
    fix = localizer.locate(sighting)
    if height_m is None or not isinstance(fix, GroundFix):
        return None
    sigma_m = larger_semi_axis(fix.relative_cov)
    return PredictedAccuracy(sigma_m, height_m) if isfinite(sigma_m) else None


def _look_down(pairer: Pairer, telemetry: Telemetry) -> Sighting | None:
    """At the pixel below which the vehicle stands; at the middle of the picture where that is not in it."""
    state = telemetry.newest_state()
    if isinstance(state, Unpaired):
        return None
    host_ns = telemetry.clock.host_from_boot(state.boot_ns)
    if isinstance(host_ns, Unpaired):
        return None
    ned_from_camera = multiply(matrix_from_quaternion(state.ned_from_carrier), pairer.body_from_camera)
    below = pairer.lens.pixel_from_camera_point(ned_from_camera[2])
    width, height = pairer.lens.image_size
    middle = ((width - 1) / 2, (height - 1) / 2)
    pixels = [middle] if isinstance(below, NoRay) else [below, middle]
    for u, v in pixels:
        sighting = pairer.look_at(u, v, None, host_ns, telemetry)
        if isinstance(sighting, Sighting):
            return sighting
    return None


def _height_m(localizer: Localizer, sighting: Sighting) -> float | None:
    meeting = localizer.ground.meet(sighting, transform(sighting.ned_from_camera, sighting.ray.direction))
    return None if isinstance(meeting, NoFix) else meeting.height_m


def _raised(sighting: Sighting, by_m: float) -> Sighting:
    """The same from higher up, where no rangefinder has measured yet."""
    north, east, down = sighting.camera_ned
    above_home_m = sighting.camera_height_above_home_m
    return msgspec.structs.replace(
        sighting,
        camera_ned=(north, east, down - by_m),
        camera_height_above_home_m=None if above_home_m is None else above_home_m + by_m,
        state=msgspec.structs.replace(sighting.state, range=None),
    )
