"""DISTANCE_SENSOR (132) from the size of a tag alone, for vehicles without a rangefinder. Pure.

It is the range to the surface below, never from the autopilot's own height: an estimator would otherwise be confirmed
by itself. The autopilot may stream what it received as its own DISTANCE_SENSOR: a reading that is one of ours is
recognised, and is neither a measurement nor a rangefinder.
"""

from __future__ import annotations

from collections import deque
from math import cos, hypot, radians
from typing import Any, Final

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.geometry.vectors import Vector3, transform
from fwav_companion.types.messages import Destination, Outgoing
from fwav_companion.types.sightings import Sighting
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

SENSOR_ID: Final = 77
"""Id of our sensor; autopilots count theirs from 0."""
DOWN: Final = 25
"""MAV_SENSOR_ROTATION_PITCH_270."""
UNKNOWN_KIND: Final = 4
"""MAV_DISTANCE_SENSOR_UNKNOWN."""
STRAIGHT_DOWN: Final = cos(radians(15.0))
"""Cosine of the largest angle of the tag's direction from straight down."""
INTERVAL_NS: Final = 50 * NS_PER_MS
"""Least time between two messages: 20 Hz."""
LEAST_CM, MOST_CM = 5, 5000
MOST_SIGMA_M: Final = 0.159
"""Largest sigma that the message can state: 254 square centimetres; PX4 reads 255, unknown, as 0.16 m."""
REMEMBERED_NS: Final = NS_PER_S
"""Time within which the autopilot repeats a reading."""
SAME_CM: Final = 1
"""Difference of a repeated reading: it was rounded twice."""
RANGEFINDER_NS: Final = 5 * NS_PER_S
"""Time after a reading of another sensor in which none of ours is sent."""


class TagRange:
    """Sends the range by a tag's size, while no real rangefinder is heard."""

    def __init__(self, camera_position_m: Vector3, component: int) -> None:
        """``camera_position_m``: of the camera in body FRD; ``component``: the sender."""
        self._camera_position_m = camera_position_m
        self._component = component
        self._sent: deque[tuple[HostNs, int]] = deque()
        self._next_ns = HostNs(0)
        self._other_ns: HostNs | None = None
        """Last reading of a real rangefinder that looks down."""
        self.returned = 0
        """Number of our readings that came back."""

    def is_ours(self, fields: Any, now: HostNs) -> bool:
        """Whether a DISTANCE_SENSOR of the autopilot repeats one of our readings; it notes a real rangefinder."""
        if fields.orientation != DOWN:
            return False
        self._forget(now)
        if any(abs(fields.current_distance - cm) <= SAME_CM for _, cm in self._sent):
            self.returned += 1
            return True
        if fields.min_distance < fields.current_distance < fields.max_distance:
            self._other_ns = now
        return False

    def on_own(self, range_cm: int, now: HostNs) -> None:
        """Remember a reading of ours; in a replay, a recorded one."""
        self._sent.append((now, range_cm))

    def on_tracks(self, tracks: tuple[Track, ...], situation: Situation) -> Outgoing | None:
        """The message of the nearest tag that this frame shows; None without one, and beside a real rangefinder."""
        now = situation.now_ns
        if self._other_ns is not None and now - self._other_ns < RANGEFINDER_NS:
            return None
        if now < self._next_ns:
            return None
        seen = [track.fix.sighting for track in tracks if track.fix is not None and track.fix.sighting.size_height]
        readings = [reading for sighting in seen if (reading := self._reading(sighting)) is not None]
        if not readings:
            return None
        sigma_m, range_m, boot_ns = min(readings)
        self._next_ns = HostNs(now + INTERVAL_NS)
        self._forget(now)
        fields: dict[str, Any] = {
            "time_boot_ms": boot_ns // NS_PER_MS % (1 << 32),
            "min_distance": LEAST_CM,
            "max_distance": MOST_CM,
            "current_distance": round(100.0 * range_m),
            "type": UNKNOWN_KIND,
            "id": SENSOR_ID,
            "orientation": DOWN,
            "covariance": max(1, min(254, round((100.0 * sigma_m) ** 2))),
            "horizontal_fov": 0.0,
            "vertical_fov": 0.0,
            "quaternion": (0.0, 0.0, 0.0, 0.0),
            "signal_quality": max(2, min(100, round(100.0 * (1.0 - sigma_m / MOST_SIGMA_M)))),
        }
        self.on_own(fields["current_distance"], now)
        return Outgoing(name="DISTANCE_SENSOR", fields=fields, to=Destination.AUTOPILOT, component=self._component)

    def _reading(self, sighting: Sighting) -> tuple[float, float, int] | None:
        """One sigma and the range along the body's down axis, metres, and the instant; None where it may not be sent.

        The range counts from the vehicle's origin, as autopilots assume without a sensor's position.
        """
        size = sighting.size_height
        if size is None or transform(sighting.ned_from_camera, sighting.ray.direction)[2] < STRAIGHT_DOWN:
            return None
        ned_from_body = matrix_from_quaternion(sighting.state.ned_from_body)
        upright = ned_from_body[2][2]
        if upright < STRAIGHT_DOWN:
            return None
        arm_down_m = transform(ned_from_body, self._camera_position_m)[2]
        range_m = (size.height_m + arm_down_m) / upright
        sigma_m = hypot(size.noise_m, size.scale_sigma * size.height_m) / upright
        if sigma_m > MOST_SIGMA_M or not LEAST_CM < 100.0 * range_m < MOST_CM:
            return None
        return sigma_m, range_m, int(sighting.boot_ns)

    def _forget(self, now: HostNs) -> None:
        while self._sent and now - self._sent[0][0] > REMEMBERED_NS:
            self._sent.popleft()
