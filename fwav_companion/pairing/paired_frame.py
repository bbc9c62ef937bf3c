"""The results of pairing: a frame with its sightings and the camera's view, or the reason why it was refused."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.geometry.vectors import Matrix3, Vector3, combination, subtract
from fwav_companion.types import Lens, NoRay, Reason, Sighting, Unpaired, VehicleState


class CameraView(msgspec.Struct, frozen=True):
    """A camera at one instant."""

    lens: Lens
    """Lens of the camera."""
    ned_from_camera: Matrix3
    """Attitude of the camera."""
    camera_ned: Vector3
    """Camera position in local NED, metres."""
    vehicle_ned: Vector3 | None = None
    """Vehicle's position as reported, local NED, metres; None where it is not known."""

    def pixel_of(self, position_ned: Vector3) -> tuple[float, float] | None:
        """The pixel of a point; None outside the image and outside the valid range of the lens."""
        # The matrix is a rotation: its rows are the columns of its inverse.
        in_camera = combination(self.ned_from_camera, subtract(position_ned, self.camera_ned))
        pixel = self.lens.pixel_from_camera_point(in_camera)
        if isinstance(pixel, NoRay):
            return None
        width, height = self.lens.image_size
        inside = -0.5 <= pixel[0] <= width - 0.5 and -0.5 <= pixel[1] <= height - 0.5
        return pixel if inside else None

    def could_see(self, position_ned: Vector3) -> bool:
        """Whether a target at this position lies inside the image and the valid range of the lens."""
        return self.pixel_of(position_ned) is not None


def sees_nothing(_position_ned: Vector3) -> bool:
    """False: the visibility test of a frame whose camera pose is unknown, which counts no missed detections."""
    return False


class PairedFrame(msgspec.Struct, frozen=True):
    """One frame on both clocks, with the vehicle, the camera and its sightings."""

    number: int
    """Frame number, of the source or counted."""
    host_ns: HostNs
    """Capture of row 0, host clock."""
    boot_ns: BootNs
    """Capture of row 0, autopilot clock."""
    state: VehicleState | Unpaired
    """State of the vehicle at the capture of row 0, or the reason why it is not known."""
    view: CameraView | None
    """Camera at the capture of row 0; None where its pose is not known. In a relative world its height is the height
    above home, where that is known."""
    sightings: tuple[Sighting, ...]
    """Sightings of the accepted detections, in the order of the frame."""
    refused: tuple[tuple[int, Reason, float | None], ...]
    """Refused detections: index, reason, and the time to the nearest attitude in seconds where it is known."""


class RefusedFrame(msgspec.Struct, frozen=True):
    """A frame that was refused as a whole."""

    number: int | None
    """Frame number of the source; None where it sends none."""
    reason: Reason
    """Reason of the refusal."""
    detections: int
    """Number of detections in the frame."""
