"""The camera on its vehicle: its position and attitude by the state of the vehicle. Pure."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add, multiply, scale, subtract, transform
from fwav_companion.pairing.paired_frame import CameraView
from fwav_companion.types import GimbalAt, Lens, Reason, Unpaired, VehicleState


class CapturePose(msgspec.Struct, frozen=True, gc=False):
    """The vehicle and its camera at one instant: the same for every detection of one row."""

    state: VehicleState
    ned_from_camera: Matrix3
    camera_ned: Vector3
    camera_height_m: float | None
    """Camera height above home, metres; None where it is not known."""
    relative: bool
    """Whether there is no global position."""


class MountedCamera:
    """A lens with its mount on the vehicle, or on the vehicle's gimbal."""

    def __init__(self, lens: Lens, body_from_camera: Matrix3, lever_arm_m: Vector3) -> None:
        self._lens = lens
        self._body_from_camera = body_from_camera
        self._lever_arm_m = lever_arm_m

    def pose(self, at: VehicleState | Unpaired, clock_rate: float, *, relative: bool | None) -> CapturePose | Unpaired:
        """The pose of the camera at this state, or the reason why it is not known."""
        if isinstance(at, Unpaired):
            return at
        if clock_rate != 1.0:
            at = _per_stamp_second(at, clock_rate)
        if isinstance(at.gimbal, Reason):
            return Unpaired(at.gimbal)
        seen_from = self.view(at, relative=relative)
        if seen_from is None:
            return Unpaired(Reason.NO_POSITION, at.gap_s)
        return CapturePose(
            at, seen_from.ned_from_camera, seen_from.camera_ned, self._camera_height(at), relative is True
        )

    def view(self, state: VehicleState, *, relative: bool | None) -> CameraView | None:
        """The camera at this state; None where an expected position or the gimbal's attitude is not known."""
        if isinstance(state.gimbal, Reason):
            return None
        ned_from_camera = multiply(matrix_from_quaternion(state.ned_from_carrier), self._body_from_camera)
        if relative:
            return CameraView(self._lens, ned_from_camera, ZERO3)
        if state.position_ned is None:
            return None
        camera_ned = add(state.position_ned, self._arm_ned(state))
        return CameraView(self._lens, ned_from_camera, camera_ned, vehicle_ned=state.position_ned)

    def camera_view(self, state: VehicleState, *, relative: bool | None) -> CameraView | None:
        """The camera at this state in the frame of the tracks; None where it is not known.

        A relative world has its origin on the ground below the camera.
        """
        view = self.view(state, relative=relative)
        if view is None or not relative:
            return view
        height_m = self._camera_height(state)
        if height_m is None:
            return None
        camera_ned = (0.0, 0.0, -height_m)
        vehicle_ned = subtract(camera_ned, self._arm_ned(state))
        return CameraView(view.lens, view.ned_from_camera, camera_ned, vehicle_ned)

    def _camera_height(self, state: VehicleState) -> float | None:
        return None if state.height_above_home_m is None else state.height_above_home_m - self._arm_ned(state)[2]

    def _arm_ned(self, state: VehicleState) -> Vector3:
        """The camera's lever arm, NED."""
        if self._lever_arm_m == ZERO3:
            return ZERO3
        return transform(matrix_from_quaternion(state.ned_from_body), self._lever_arm_m)


def _per_stamp_second(state: VehicleState, rate: float) -> VehicleState:
    """The state with velocity, rates and acceleration per second of the stamp's clock, not of the autopilot's."""
    velocity = state.velocity_ned
    gimbal = state.gimbal
    if isinstance(gimbal, GimbalAt):
        gimbal = msgspec.structs.replace(gimbal, rates=scale(gimbal.rates, rate))
    return msgspec.structs.replace(
        state,
        rates=scale(state.rates, rate),
        angular_acceleration=scale(state.angular_acceleration, rate * rate),
        turning_frequency=rate * state.turning_frequency,
        velocity_ned=None if velocity is None else scale(velocity, rate),
        gimbal=gimbal,
    )
