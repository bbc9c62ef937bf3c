"""What the camera could see from where it was."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.vectors import Matrix3, Vector3, subtract, transform, transpose
from fwav_companion.types import Lens, NoRay


class CameraView(msgspec.Struct, frozen=True):
    """A camera at one instant."""

    lens: Lens
    ned_from_camera: Matrix3
    camera_ned: Vector3
    """Its centre, metres, local NED."""

    def pixel_of(self, position_ned: Vector3) -> tuple[float, float] | None:
        """Where a point would appear; None: not in the image, or beyond the lens's range."""
        in_camera = transform(transpose(self.ned_from_camera), subtract(position_ned, self.camera_ned))
        pixel = self.lens.pixel_from_camera_point(in_camera)
        if isinstance(pixel, NoRay):
            return None
        width, height = self.lens.image_size
        inside = -0.5 <= pixel[0] <= width - 0.5 and -0.5 <= pixel[1] <= height - 0.5
        return pixel if inside else None

    def could_see(self, position_ned: Vector3) -> bool:
        """Whether a target there would have been inside the image and the lens's range."""
        return self.pixel_of(position_ned) is not None


def sees_nothing(_position_ned: Vector3) -> bool:
    """The view of a frame whose camera could not be placed: nothing may be held against a target."""
    return False
