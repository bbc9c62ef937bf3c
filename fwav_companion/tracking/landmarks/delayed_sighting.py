"""Sightings with the vehicle's pose at the estimated instant of their capture.

On a flapping wing, the rates at a capture give the attitude 20 ms earlier with an error of 1 degree (a beat of
5 degrees at 5 Hz). This error is in step with the beat, as an error of the lever arm or of the height would be. The
pose history gives the right attitude, so that the delay can be estimated. The rates are freed of the noise of the
attitudes, which would show a delay of its own (``rate_denoiser``).
"""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import BootNs, ns_from_s
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, multiply, subtract, transform, transpose
from fwav_companion.self_calibration.delayed_poses import StateAt
from fwav_companion.self_calibration.rate_denoiser import SPAN_S, RateDenoiser, slow_rates
from fwav_companion.types import GimbalAt, Sighting, Unpaired, VehicleState


class DelayedSighting(msgspec.Struct, frozen=True, gc=False):
    """A sighting with the pose at ``late_s`` seconds before its nominal capture."""

    sighting: Sighting
    late_s: float = 0.0


class PoseHistory(msgspec.Struct, frozen=True):
    """Vehicle poses around captures, and angular rates without their noise."""

    state_at: StateAt | None = None
    """Vehicle state at an instant; None without a history: sightings keep their pose."""
    slow: Vector3 = ZERO3
    """Mean rates before the newest frame, rad/s, axes of the carrier."""
    denoiser: RateDenoiser = RateDenoiser()

    def after(self, sighting: Sighting, attitude_noise: float) -> PoseHistory:
        """The history at the frame of this sighting."""
        slow = self._slow_rates(sighting.state)
        return PoseHistory(self.state_at, slow, self.denoiser.with_state(sighting.state, slow, attitude_noise))

    def delayed(self, sighting: Sighting, late_s: float) -> DelayedSighting:
        """The sighting with the pose at ``late_s`` seconds before its nominal capture, where that pose is known."""
        now, state_at = sighting.state, self.state_at
        if state_at is None or sighting.relative or now.position_ned is None:
            return DelayedSighting(self._denoised(sighting))
        state = state_at(BootNs(now.boot_ns - ns_from_s(late_s)))
        if isinstance(state, Unpaired) or state.position_ned is None or type(state.gimbal) is not type(now.gimbal):
            return DelayedSighting(self._denoised(sighting))
        arm_ned = subtract(sighting.camera_ned, now.position_ned)
        arm = transform(transpose(matrix_from_quaternion(now.ned_from_body)), arm_ned)
        moved = msgspec.structs.replace(
            sighting,
            state=state,
            ned_from_camera=multiply(matrix_from_quaternion(state.ned_from_carrier), sighting.body_from_camera),
            camera_ned=add(state.position_ned, transform(matrix_from_quaternion(state.ned_from_body), arm)),
        )
        return DelayedSighting(self._denoised(moved), late_s)

    def _slow_rates(self, state: VehicleState) -> Vector3:
        """Mean rates over the last SPAN_S, rad/s; zero where the attitude at its start is not known."""
        before = None if self.state_at is None else self.state_at(BootNs(state.boot_ns - ns_from_s(SPAN_S)))
        if before is None or isinstance(before, Unpaired):
            return ZERO3
        return slow_rates(before, state)

    def _denoised(self, sighting: Sighting) -> Sighting:
        """The sighting with the expected rates, given the reported rates."""
        state = sighting.state
        if self.state_at is None or isinstance(state.gimbal, GimbalAt):
            return sighting
        shares = zip(self.slow, self.denoiser.shares, state.rates, strict=True)
        p, q, r = (slow + share * (rate - slow) for slow, share, rate in shares)
        return msgspec.structs.replace(sighting, state=msgspec.structs.replace(state, rates=(p, q, r)))
