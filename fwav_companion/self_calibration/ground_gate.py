"""The gate of the joint estimate: all fixes of a frame against all targets, by their points on the ground.

Points are by the exact attitude at the capture, sensitivities those of the fixes at their nominal captures. Compared in
pixels, which takes three times as long, normalised innovations are the same to a fifth over figure-eights of a wing.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isnan, nan

import msgspec
import numpy as np

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
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.calibrated_fix import BIASES_OF, SIGNS
from fwav_companion.self_calibration.calibration_report import SharedParameter
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.self_calibration.joint_filter import LEAST_DETERMINANT, JointFilter, two_by_two
from fwav_companion.self_calibration.pixel_measurement import LEAST_DOWN, LEVER, MOUNT, SHARED_COUNT
from fwav_companion.types import GroundFix, Sighting, Unpaired
from fwav_companion.types.tracks import GateResult

KNOT_NS = 8 * NS_PER_MS
"""Interval at which states within the readout of a frame are requested. Continued by all of it with constant rates, a
beat of 5 degrees at 5 Hz errs by 0.16 degrees, a third of a pixel's noise."""


class CorrectedCamera(msgspec.Struct, frozen=True, gc=False):
    """The camera at one instant, by the mean of a joint estimate."""

    axes: Matrix3
    """Attitude by the true heading, NED from camera."""
    rates: Vector3
    """rad/s, camera axes."""
    place: Vector3
    """By reported positions, with the height corrected, NED, m; so is the next, m/s."""
    velocity: Vector3


class GroundGate:
    """The fixes of one frame on the ground, by the mean of a joint estimate with one hypothesis."""

    def __init__(self, joint: JointFilter, fixes: Sequence[GroundFix], state_at: StateAt) -> None:
        self._mean = mean = list[float](joint.mean[0, :SHARED_COUNT].tolist())
        self._state_at = state_at
        mounted = matrix_from_quaternion(exp(_vector(mean[MOUNT])))
        self._body_from_camera = multiply(mounted, fixes[0].sighting.body_from_camera)
        self._true_heading = matrix_from_quaternion(exp((0.0, 0.0, -mean[SharedParameter.HEADING])))
        self._lever = subtract(_lever(fixes[0].sighting), _vector(mean[LEVER]))
        self._views: dict[int, CorrectedCamera | None] = {}
        off = np.array([self._point(fix) for fix in fixes]) - joint.apparent[0].reshape(-1, 1, 2)
        noise = np.array([fix.noise_cov for fix in fixes])[:, :2, :2]
        spread = noise + (rows := _rows(fixes)) @ joint.apparent_covs[:, None] @ rows.swapaxes(1, 2)
        nowhere = np.isinf(off).any(-1)  # infinite terms of both signs would make NaN of it: not known
        off[nowhere] = 0.0
        nis, determinant = two_by_two(off, spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1])
        alone = noise[:, 0, 0] * noise[:, 1, 1] - noise[:, 0, 1] * noise[:, 0, 1]
        self._nis: list[list[float]] = np.where(nowhere, inf, nis).tolist()
        self._log_det: list[list[float]] = np.log(np.maximum(determinant, LEAST_DETERMINANT) / alone).tolist()

    def gate(self, place: int, index: int) -> GateResult | None:
        """Gating statistics of a fix against the target at this place of the estimate; None where the vehicle's state
        at its capture is not known.
        """
        nis = self._nis[place][index]
        return None if isnan(nis) else GateResult(nis, self._log_det[place][index])

    def _point(self, fix: GroundFix) -> tuple[float, float]:
        """North and east where a fix's ray meets the ground; inf: nowhere, NaN: not known."""
        sighting = fix.sighting
        delay_s = self._mean[SharedParameter.DELAY] - self._mean[SharedParameter.READOUT] * sighting.row_fraction
        knot, later_ns = divmod(sighting.boot_ns - ns_from_s(delay_s), KNOT_NS)
        if knot not in self._views:
            self._views[knot] = self._view(BootNs(knot * KNOT_NS))
        view, later_s = self._views[knot], s_from_ns(later_ns)
        if view is None:
            return nan, nan
        direction = sighting.ray.direction
        ray = transform(view.axes, add(direction, scale(cross(view.rates, direction), later_s)))
        if ray[2] <= LEAST_DOWN:
            return inf, inf
        north, east, down = add(view.place, scale(view.velocity, later_s))
        reach = (fix.drop_m + sighting.camera_ned[2] - down) / ray[2]
        return north + reach * ray[0], east + reach * ray[1]

    def _view(self, boot_ns: BootNs) -> CorrectedCamera | None:
        """The camera at an instant; None where the vehicle's state is not known."""
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
        )


def _vector(values: Sequence[float]) -> Vector3:
    x, y, z = values
    return (x, y, z)


def _lever(sighting: Sighting) -> Vector3:
    """Camera position in its carrier, m."""
    state = sighting.state
    arm = subtract(sighting.camera_ned, state.position_ned or ZERO3)
    return transform(transpose(matrix_from_quaternion(state.ned_from_carrier)), arm)


def _rows(fixes: Sequence[GroundFix]) -> Array:
    """(N, 2, 13) change of a point less the place of its target, by the shared parameters and the place; negative."""
    rows = np.empty((len(fixes), 2, SHARED_COUNT + 2))
    rows[..., :SHARED_COUNT] = np.array([BIASES_OF(fix.bias_jacobian) for fix in fixes])[..., :2].swapaxes(1, 2)
    rows[..., :SHARED_COUNT] *= SIGNS
    rows[..., SHARED_COUNT:] = np.eye(2)
    return rows
