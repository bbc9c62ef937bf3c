"""Clicked spots: predicts where each appears in the next picture, and keeps which track belongs to which spot. PURE.

A click names a pixel of a picture that was on the operator's screen. The camera process keeps pictures and follows the
spot by its appearance. This module adds what only the pipeline knows: the spot's place on the ground, and the vehicle's
motion since the click.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from math import hypot
from typing import Final, Protocol

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.geometry.vectors import Vector3, add, larger_semi_axis, norm, subtract
from fwav_companion.pairing import CameraView, PictureRows, Scaling
from fwav_companion.types import Frame, GroundFix, Track
from fwav_companion.types.spots import CLICK_LABEL, FollowSpot, ReleaseSpot, SpotMessage, SpotView, SpotViews

MOST_PICTURES: Final = 128
"""Number of frames that a click can name: four seconds at 30 frames/s. The camera process keeps no older pictures."""
MOST_APART_NS: Final = 150 * NS_PER_MS
"""Largest time between a click's instant and a picture: the tolerance of [publish] video_delay_s. A picture further
from the clicked one shows another scene."""
STEP_M: Final = 0.05
"""Step of the finite differences for the Jacobian, metres: some pixels at any height of flight."""
LEAST_REACH_PX: Final = 12.0
"""Least search radius, pixels. Attitudes are extrapolated by up to 10 ms for the newest picture: 13 pixels at 150 deg/s
and 500 px/rad."""
SIGMAS: Final = 3.0
LOST_SIGMA_M: Final = 0.5
"""One sigma of a place that had no track for some time: the vehicle's position has wandered since."""
MOST_SPOTS: Final = 4
"""Most spots at once: the camera process follows as many."""


class SpotCamera(Protocol):
    """The camera's pose and its view of the ground, as clicked spots need them."""

    def locate(self, u: float, v: float, sigma_px: float, host_ns: HostNs) -> GroundFix | None:
        """Fix of the ground at a pixel of a picture taken at this instant; None where the place is unknown."""

    def view_at(self, host_ns: HostNs) -> CameraView | None:
        """Camera pose and lens at a host instant; None where the pose is unknown."""

    def picture_rows(self, frame: Frame) -> PictureRows | None:
        """Row times and scaling of a frame of the service's own camera; None where its clock or size is not known."""


class ClickedSpot(msgspec.Struct):
    """One clicked spot that is followed."""

    place_ned: Vector3
    """Ground position for its prediction, NED, metres: that of the click, later that of its track."""
    sigma_m: float
    """One sigma of the place relative to the vehicle, metres."""
    track: int | None = None
    """Id of its track; None while there is none."""


class ClickedSpots:
    """All spots of one camera."""

    def __init__(self, camera: SpotCamera) -> None:
        self._camera = camera
        self._pictures: deque[tuple[int, PictureRows]] = deque(maxlen=MOST_PICTURES)
        self._spots: dict[int, ClickedSpot] = {}
        self._newest = 0
        self._orders: list[SpotMessage] = []

    def on_picture(self, frame: Frame) -> None:
        """Remember a frame if the service's camera process keeps its picture."""
        rows = None if frame.picture is None else self._camera.picture_rows(frame)
        if rows is not None and frame.picture is not None:
            self._pictures.append((frame.picture, rows))

    def follow(self, point: tuple[float, float], host_ns: HostNs, sigma_px: float) -> int | None:
        """Order the camera process to follow the spot at a pixel of the picture nearest to this instant.

        Returns the spot's number; None where no picture of that time is known, or the ground at the pixel is not.
        ``point``: in pixels of the calibration.
        """
        number, rows = min(self._pictures, key=lambda each: abs(each[1].middle_ns - host_ns), default=(0, None))
        if rows is None or abs(rows.middle_ns - host_ns) > MOST_APART_NS:
            return None
        captured_ns = rows.host_ns(point[1])
        fix = self._camera.locate(*point, sigma_px, captured_ns)
        camera = self._camera.view_at(captured_ns)
        seen = None if fix is None or camera is None else spot_view(camera, fix.position_ned, 0.0)
        if fix is None or seen is None:
            return None
        self._newest += 1
        self._spots[self._newest] = ClickedSpot(fix.position_ned, larger_semi_axis(fix.relative_cov))
        if len(self._spots) > MOST_SPOTS:
            self.release(next(iter(self._spots)))
        view = in_picture(msgspec.structs.replace(seen, at=point), rows.scaling)
        self._orders.append(FollowSpot(self._newest, number, view))
        return self._newest

    def release(self, spot: int) -> None:
        """Stop following a spot."""
        if self._spots.pop(spot, None) is not None:
            self._orders.append(ReleaseSpot(spot))

    def release_all(self) -> None:
        """Stop following every spot."""
        for spot in tuple(self._spots):
            self.release(spot)

    def views(self, frame: Frame) -> SpotViews:
        """Predicted view of each spot in a picture; spots outside the picture are left out."""
        rows = self._camera.picture_rows(frame) if self._spots else None
        views = {}
        if rows is not None:
            seen = {number: self._predicted(spot, rows) for number, spot in self._spots.items()}
            views = {number: in_picture(view, rows.scaling) for number, view in seen.items() if view is not None}
        return SpotViews(frame.picture or 0, views)

    def _predicted(self, spot: ClickedSpot, rows: PictureRows) -> SpotView | None:
        """Predicted view of one spot. The camera's pose at the middle row gives the spot's row, whose pose is used."""
        middle = self._camera.view_at(rows.middle_ns)
        at = None if middle is None else middle.pixel_of(spot.place_ned)
        camera = None if at is None else self._camera.view_at(rows.host_ns(at[1]))
        return None if camera is None else spot_view(camera, spot.place_ned, spot.sigma_m)

    def on_tracks(self, tracks: Iterable[Track]) -> None:
        """Update each spot's place from its track. After the track's end the spot is searched at its last place."""
        of_spot: dict[int, Track] = {}
        alive = set()
        for track in tracks:
            alive.add(track.id)
            fix = track.fix
            if fix is not None and track.label == CLICK_LABEL and fix.sighting.detection.detector_id is not None:
                of_spot[fix.sighting.detection.detector_id] = track
        for number, track in of_spot.items():
            spot = self._spots.get(number)
            if spot is not None:
                spot.place_ned, spot.sigma_m = track.apparent_ned, larger_semi_axis(track.relative_cov)
                spot.track = track.id
        for spot in self._spots.values():
            if spot.track is not None and spot.track not in alive:
                spot.track, spot.sigma_m = None, max(spot.sigma_m, LOST_SIGMA_M)

    def on_refused(self, spot: int) -> None:
        """Forget a spot that the camera process cannot follow."""
        self._spots.pop(spot, None)

    @property
    def has_orders(self) -> bool:
        """Whether :meth:`take_orders` would return any orders."""
        return bool(self._orders)

    def take_orders(self) -> list[SpotMessage]:
        """Orders for the camera process since the last call."""
        made, self._orders = self._orders, []
        return made


def spot_view(camera: CameraView, place_ned: Vector3, sigma_m: float) -> SpotView | None:
    """Predicted view of a place on the ground; None where it or its surroundings are outside the picture."""
    at = camera.pixel_of(place_ned)
    north, east = (camera.pixel_of(add(place_ned, step)) for step in ((STEP_M, 0.0, 0.0), (0.0, STEP_M, 0.0)))
    if at is None or north is None or east is None:
        return None
    columns = [((there[0] - at[0]) / STEP_M, (there[1] - at[1]) / STEP_M) for there in (north, east)]
    (u_north, v_north), (u_east, v_east) = columns
    if abs(u_north * v_east - u_east * v_north) < 1e-3 * hypot(u_north, v_north) * hypot(u_east, v_east):
        return None  # seen edge-on
    scale_px_m = max(hypot(u_north, v_north), hypot(u_east, v_east))
    reach_px = LEAST_REACH_PX + SIGMAS * sigma_m * min(scale_px_m, _largest_scale(camera, place_ned))
    return SpotView(at, (u_north, u_east, v_north, v_east), reach_px)


def in_picture(view: SpotView, scaling: Scaling) -> SpotView:
    """The view converted from pixels of the calibration to pixels of the picture."""
    if scaling.horizontal == scaling.vertical == 1.0:
        return view
    h, v = scaling.horizontal, scaling.vertical
    u_north, u_east, v_north, v_east = view.pixel_from_ground
    return SpotView(
        at=((view.at[0] + 0.5) / h - 0.5, (view.at[1] + 0.5) / v - 0.5),
        pixel_from_ground=(u_north / h, u_east / h, v_north / v, v_east / v),
        reach_px=view.reach_px / min(h, v),
    )


def _largest_scale(camera: CameraView, place_ned: Vector3) -> float:
    """Pixels per metre across the ray: the lens's largest scale over the distance."""
    width, _ = camera.lens.image_size
    return width / max(norm(subtract(place_ned, camera.camera_ned)), 0.1)
