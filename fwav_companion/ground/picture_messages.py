"""Messages for Foxglove and Lichtblick from the picture of ``ground``: the topics of an exported recording. Pure.

The frame ``map`` is ENU about the first place that is known. The picture has nothing for the topics of the camera and
of the plots.
"""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.geometry.vectors import Matrix3, Vector3
from fwav_companion.ground.covariances import SCALE_95
from fwav_companion.ground.views import PictureUpdate, TargetView, VehicleView
from fwav_companion.recording.exports.base import Ellipse95
from fwav_companion.recording.exports.viewer_scene import Message, Stamp, deletion, entity, location, stamp, transform

ALL_ENTITIES = 1
"""SceneEntityDeletion.ALL."""
DRAWN_AS = {"selected": "confirmed", "reported": "confirmed", "lost": "coasting"}
"""State of a track by those states of the picture that tracks do not have."""
LOG_INFO, LOG_WARNING, LOG_ERROR = 2, 3, 4
MAV_ERROR, MAV_WARNING = 3, 4
"""MAV_SEVERITY, the lower the worse."""


class PictureMessages:
    """Turns updates of the picture into messages."""

    def __init__(self) -> None:
        self._plane: TangentPlane | None = None
        self._frames: dict[str, str] = {}
        self._said_revision = 0
        self._placed_unix: dict[str, float] = {}

    def of_update(self, update: PictureUpdate) -> Iterator[Message]:
        """The messages of one update. A whole one replaces every entity of the scene."""
        at_ns = round(update.now_unix * NS_PER_S)
        at = stamp(at_ns)
        if update.whole:
            self._placed_unix.clear()
        for vehicle in update.vehicles:
            yield from self._of_vehicle(vehicle)
        ended = [target.id for target in update.targets if target.state == "dropped"] + update.removed
        deletions = [{"timestamp": at, "type": ALL_ENTITIES, "id": ""}] if update.whole else []
        deletions += [deletion(at, name) for name in ended]
        entities = []
        for target in update.targets:
            if target.state != "dropped":
                place = self._place(target.lat, target.lon, target.alt_amsl)
                state = DRAWN_AS.get(target.state, target.state)
                text = f"{target.label or 'target'} {target.track or target.id}"
                entities.append(entity(at, target.id, text, state, place, _ellipse(target)))
                yield "/targets/location", at_ns, _location(at, target)
        if deletions or entities:
            yield "/targets/scene", at_ns, {"deletions": deletions, "entities": entities}
        for said in update.texts:
            if said.revision > self._said_revision:
                self._said_revision = said.revision
                level = LOG_ERROR if said.severity <= MAV_ERROR else LOG_WARNING
                content = {
                    "timestamp": stamp(round(said.time_unix * NS_PER_S)),
                    "level": level if said.severity <= MAV_WARNING else LOG_INFO,
                    "message": said.text,
                    "name": f"vehicle {said.vehicle}",
                }
                yield "/log", at_ns, content

    def _of_vehicle(self, vehicle: VehicleView) -> Iterator[Message]:
        """The place of a vehicle at its own instant; nothing where the place is that of the last update."""
        placed_unix = vehicle.heard.get("position", vehicle.heard_unix)
        if vehicle.lat is None or vehicle.lon is None or self._placed_unix.get(vehicle.id) == placed_unix:
            return
        self._placed_unix[vehicle.id] = placed_unix
        at_ns = round(placed_unix * NS_PER_S)
        at = stamp(at_ns)
        frame = self._frames.setdefault(vehicle.id, f"vehicle {vehicle.id}" if self._frames else "vehicle")
        yield "/tf", at_ns, transform(at, frame, self._place(vehicle.lat, vehicle.lon, vehicle.alt_amsl))
        yield "/vehicle/location", at_ns, location(at, vehicle.lat, vehicle.lon, vehicle.alt_amsl or 0.0, None)

    def _place(self, lat: float, lon: float, alt_amsl: float | None) -> Vector3:
        """A place in ``map``, NED; an unknown altitude is that of its origin."""
        if self._plane is None:
            self._plane = TangentPlane(Geodetic.from_degrees(lat, lon, alt_amsl or 0.0))
        known = self._plane.origin.alt_amsl_m if alt_amsl is None else alt_amsl
        return self._plane.ned_from_geodetic(Geodetic.from_degrees(lat, lon, known))


def _ellipse(target: TargetView) -> Ellipse95 | None:
    if target.ellipse is not None:
        return Ellipse95(target.ellipse.major_m, target.ellipse.minor_m, target.ellipse.bearing_deg)
    return None if target.radius95_m is None else Ellipse95(target.radius95_m, target.radius95_m, 0.0)


def _location(at: Stamp, target: TargetView) -> dict[str, object]:
    """A fix with the horizontal covariance of the circle of 95 %, which is wider than the ellipse."""
    cov: Matrix3 | None = None
    if target.radius95_m is not None:
        variance = (target.radius95_m / SCALE_95) ** 2
        cov = ((variance, 0.0, 0.0), (0.0, variance, 0.0), (0.0, 0.0, 0.0))
    return location(at, target.lat, target.lon, target.alt_amsl or 0.0, cov)
