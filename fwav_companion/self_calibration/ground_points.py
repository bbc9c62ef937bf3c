"""Ground points of fixes for given values of the shared parameters, with the exact attitude at their delayed captures.

A flapping wing goes through a third of a beat within 35 ms: the sensitivities at the nominal capture do not give the
ray at the true one.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan

import msgspec

from fwav_companion.geometry.rotations import exp, matrix_from_quaternion
from fwav_companion.geometry.stamps import NS_PER_MS, BootNs, ns_from_s, s_from_ns
from fwav_companion.geometry.vectors import (
    ZERO3,
    Matrix3,
    Vector3,
    add,
    cross,
    multiply,
    scale,
    subtract,
    transform,
    transpose,
)
from fwav_companion.self_calibration.calibration_report import SharedParameter
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.self_calibration.pixel_measurement import LEAST_DOWN, LEVER, MOUNT
from fwav_companion.types import GroundFix, Sighting, Unpaired

GATE_KNOT_NS = 8 * NS_PER_MS
"""Interval at which vehicle states within the readout of a frame are requested for gating. Extrapolated over all of it
with constant rates, a beat of 5 degrees at 5 Hz errs by 0.16 degrees, a third of a pixel's noise."""
FIX_KNOT_NS = 2 * NS_PER_MS
"""Interval at which vehicle states are requested for a published place: a beat of 3 degrees at 14 Hz errs by 0.05
degrees, half of an attitude's noise."""


class CorrectedCamera(msgspec.Struct, frozen=True, gc=False):
    """Camera pose and motion at one instant, corrected by values of the shared parameters."""

    axes: Matrix3
    """Rotation NED from camera, with the heading corrected."""
    rates: Vector3
    """Angular velocity, camera axes, rad/s."""
    place: Vector3
    """Camera position by the reported positions, corrected for their delay, the lever arm and the height, NED, m."""
    velocity: Vector3
    """Velocity of the vehicle, NED, m/s."""
    reported: Vector3
    """Reported position of the vehicle, NED, m."""


class GroundPoints:
    """Ground points of the fixes of one frame, for given values (11) of the shared parameters."""

    __slots__ = (
        "_body_from_camera",
        "_knot_ns",
        "_lever",
        "_mean",
        "_state_at",
        "_true_heading",
        "_views",
    )

    def __init__(self, mean: Sequence[float], sighting: Sighting, state_at: StateAt, knot_ns: int) -> None:
        self._mean, self._state_at, self._knot_ns = mean, state_at, knot_ns
        mounted = matrix_from_quaternion(exp(_vector(mean[MOUNT])))
        self._body_from_camera = multiply(mounted, sighting.body_from_camera)
        self._true_heading = matrix_from_quaternion(exp((0.0, 0.0, -mean[SharedParameter.HEADING])))
        self._lever = subtract(_lever(sighting), _vector(mean[LEVER]))
        self._views: dict[int, CorrectedCamera | None] = {}

    def of(self, fix: GroundFix) -> tuple[float, float]:
        """North and east where a fix's ray meets the ground; inf if nowhere, NaN without a vehicle state."""
        return self._met(fix, in_report=False)

    def in_report_of(self, fix: GroundFix) -> tuple[float, float]:
        """North and east as of ``of``, but relative to the vehicle's report at the nominal capture.

        The displacement between true and nominal capture is taken from the velocity, so that the result has the noise
        of this report alone.
        """
        return self._met(fix, in_report=True)

    def _met(self, fix: GroundFix, *, in_report: bool) -> tuple[float, float]:
        sighting = fix.sighting
        delay_s = self._mean[SharedParameter.DELAY] - self._mean[SharedParameter.READOUT] * sighting.row_fraction
        knot, later_ns = divmod(sighting.boot_ns - ns_from_s(delay_s), self._knot_ns)
        if knot not in self._views:
            self._views[knot] = self._view(BootNs(knot * self._knot_ns))
        view, later_s = self._views[knot], s_from_ns(later_ns)
        if view is None:
            return nan, nan
        direction = sighting.ray.direction
        ray = transform(view.axes, add(direction, scale(cross(view.rates, direction), later_s)))
        if ray[2] <= LEAST_DOWN:
            return inf, inf
        if in_report:
            off = subtract(_moved_back(sighting, view.velocity, delay_s), view.reported)
            north, east, down = add(view.place, off)
        else:
            north, east, down = add(view.place, scale(view.velocity, later_s))
        reach = (fix.height_above_target_m + sighting.camera_ned[2] - down) / ray[2]
        return north + reach * ray[0], east + reach * ray[1]

    def _view(self, boot_ns: BootNs) -> CorrectedCamera | None:
        """The corrected camera at an instant; None where the vehicle's state is not known."""
        state = self._state_at(boot_ns)
        if isinstance(state, Unpaired) or state.position_ned is None:
            return None
        axes, velocity = matrix_from_quaternion(state.ned_from_carrier), state.velocity_ned or ZERO3
        late = scale(velocity, self._mean[SharedParameter.POSITION_DELAY])
        north, east, down = add(add(state.position_ned, late), transform(axes, self._lever))
        return CorrectedCamera(
            multiply(self._true_heading, multiply(axes, self._body_from_camera)),
            transform(transpose(self._body_from_camera), state.carrier_rates),
            (north, east, down + self._mean[SharedParameter.HEIGHT]),
            velocity,
            state.position_ned,
        )


def _moved_back(sighting: Sighting, velocity: Vector3, delay_s: float) -> Vector3:
    """The vehicle's position ``delay_s`` before the nominal capture, by its nominal report and the mean velocity."""
    state = sighting.state
    mean = scale(add(velocity, state.velocity_ned or velocity), 0.5)
    return subtract(state.position_ned or ZERO3, scale(mean, delay_s))


def _vector(values: Sequence[float]) -> Vector3:
    x, y, z = values
    return (x, y, z)


def _lever(sighting: Sighting) -> Vector3:
    """Camera position in the axes of its carrier (body or gimbal), m."""
    state = sighting.state
    arm = subtract(sighting.camera_ned, state.position_ned or ZERO3)
    return transform(transpose(matrix_from_quaternion(state.ned_from_carrier)), arm)
