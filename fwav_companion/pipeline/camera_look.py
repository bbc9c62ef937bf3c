"""The camera's view of the ground at any instant, also between its frames. PURE."""

from __future__ import annotations

from math import asin, degrees, nan

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.geometry.vectors import Vector3, larger_semi_axis, multiply, transform
from fwav_companion.localization import Localizer
from fwav_companion.pairing import CameraView, Pairer, PictureRows, VehicleSource
from fwav_companion.pipeline.predicted_accuracy import PredictedAccuracy, predicted_accuracy_below
from fwav_companion.publishing.cot_events import CameraAim
from fwav_companion.types import Frame, GroundFix, Reason, Sighting, Unpaired

BORDER = ((-0.5, -0.5), (0.0, -0.5), (0.5, -0.5), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5), (-0.5, 0.5), (-0.5, 0.0))
"""Corners and middles of a picture's border, right and down, as shares of the image."""
BORDER_SHARES = (0.99, 0.8, 0.6, 0.4)
"""Shares of the way from the centre to the border that are tried; the border itself may count as outside."""
BORDER_SIGMA_PX = 1.0
AIM_AGE_NS = 300 * NS_PER_MS
"""Age of the view that maps show: at 4 Hz, attitude samples on both sides of it have arrived."""


class CameraLook(msgspec.Struct):
    """One camera on its vehicle, above the ground: answers questions about its view at an instant."""

    telemetry: VehicleSource
    pairer: Pairer
    localizer: Localizer

    def locate(self, u: float, v: float, sigma_px: float, host_ns: HostNs) -> GroundFix | None:
        """Fix of the ground at a pixel of a picture taken at this instant; None where the place is unknown."""
        sighting = self.pairer.look_at(u, v, sigma_px=sigma_px, host_ns=host_ns, vehicle=self.telemetry)
        fix = self.localizer.locate(sighting) if isinstance(sighting, Sighting) else None
        return fix if isinstance(fix, GroundFix) else None

    def footprint(self, size: tuple[int, int], host_ns: HostNs) -> list[Vector3]:
        """Ground positions, NED, of the border of a picture taken at this instant, clockwise from its top left.

        A pixel without ground is replaced by one nearer to the centre, or left out. Empty if fewer than three are left.
        """
        places = []
        for right, down in BORDER:
            for share in BORDER_SHARES:
                u, v = (0.5 + share * right) * size[0] - 0.5, (0.5 + share * down) * size[1] - 0.5
                fix = self.locate(u, v, BORDER_SIGMA_PX, host_ns)
                if fix is not None:
                    places.append(fix.position_ned)
                    break
        return places if len(places) > 2 else []

    def view_at(self, host_ns: HostNs) -> CameraView | None:
        """Camera pose and lens at a host instant, in the frame of the tracks; None where the pose is unknown."""
        return self.pairer.camera_at(host_ns, self.telemetry)

    def picture_rows(self, frame: Frame) -> PictureRows | None:
        """Row times and scaling of a frame of the service's own camera; None where its clock or size is not known."""
        return self.pairer.picture_rows(frame, self.telemetry.clock)

    def axis_elevation_deg(self) -> float | None:
        """Elevation of the optical axis above the horizon now, degrees; None while the attitude is not known."""
        state = self.telemetry.newest_state()
        if isinstance(state, Unpaired) or isinstance(state.gimbal, Reason):
            return None
        ned_from_camera = multiply(matrix_from_quaternion(state.ned_from_carrier), self.pairer.body_from_camera)
        return degrees(asin(max(-1.0, min(1.0, -ned_from_camera[2][2]))))

    def aim(self, host_ns: HostNs) -> CameraAim | None:
        """Optical axis shortly before this instant, and the ground that it meets; None while it is unknown."""
        at_ns = HostNs(host_ns - AIM_AGE_NS)
        u, v = self.pairer.image_centre
        view = self.pairer.look_at(u, v, sigma_px=BORDER_SIGMA_PX, host_ns=at_ns, vehicle=self.telemetry)
        if not isinstance(view, Sighting):
            return None
        axis = transform(view.ned_from_camera, view.ray.direction)
        fix = self.localizer.locate(view)
        if not isinstance(fix, GroundFix):
            return CameraAim(axis, None, nan)
        return CameraAim(axis, fix.position_ned, larger_semi_axis(fix.cov))

    def expected(self) -> PredictedAccuracy | Reason:
        """Accuracy of a fix straight below at this moment, or the reason why there would be no fix."""
        return predicted_accuracy_below(self.pairer, self.localizer, self.telemetry)

    def assumed_arrival(self, frame: Frame) -> HostNs | None:
        """Assumed arrival time of a recorded frame without ``received_unix``; None while the clock is unknown."""
        arrival_ns = self.pairer.assumed_arrival(frame, self.telemetry.clock)
        return arrival_ns if isinstance(arrival_ns, int) else None

    @property
    def time_offset_s(self) -> float:
        """Configured delay of the stamps, seconds."""
        return self.pairer.time_offset_s
