"""Reads lines of a targets file, or of a recording of this program, into the picture. Pure."""

from __future__ import annotations

from math import atan2, degrees
from typing import Any, TypeAlias

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.ground.covariances import ellipse_of
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.views import PictureUpdate, TargetView
from fwav_companion.recording.line_types import (
    HeaderLine,
    Line,
    OriginLine,
    OriginObject,
    PlaceObject,
    SightingLine,
    TargetLine,
)

VEHICLE = "1"
"""Name of the vehicle of a targets file, which has one vehicle and does not name it."""

NOT_RECORDED = ("id", "revision", "number", "heard_unix", "quiet", "silent", "ready_unix", "contradicted_unix")
"""Fields of a recorded vehicle that the picture makes itself."""


class PictureLine(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="picture"):
    """What changed in the picture, as `ground --record` writes it once a second."""

    time_unix: float
    update: PictureUpdate


RecordedLine: TypeAlias = Line | PictureLine


class RecordedLines:
    """Takes the lines of one recording in their order."""

    def __init__(self, picture: GroundPicture) -> None:
        self._picture = picture
        self._plane: TangentPlane | None = None
        self._heading_deg: float | None = None
        self._first: dict[str, float] = {}
        self.offset_s = 0.0
        """Recording's clock minus the companion's monotonic clock, seconds."""

    def take(self, line: RecordedLine, now: float) -> None:
        """Process one line. Lines of other kinds have no data for the picture."""
        match line:
            case HeaderLine():
                self.offset_s = line.unix_offset_s
                self._on_origin(line.origin)
            case OriginLine():
                self._on_origin(line.origin)
            case SightingLine():
                self._on_sighting(line)
            case TargetLine():
                self._on_target(line, now)
            case PictureLine():
                self._on_picture(line.update, now)

    def _on_origin(self, origin: OriginObject | None) -> None:
        if origin is not None:
            self._plane = origin.plane

    def _on_sighting(self, line: SightingLine) -> None:
        if line.q_ned_body is not None:
            w, x, y, z = line.q_ned_body
            self._heading_deg = degrees(atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))) % 360.0

    def _on_target(self, line: TargetLine, now: float) -> None:
        if line.relative is not None and self._plane is not None:
            self._on_vehicle(self._plane, line, line.relative, now)
        if line.lat_lon is None:
            return
        lat, lon = line.lat_lon
        identity = f"{VEHICLE}/{line.track}"
        cov = line.cov
        view = TargetView(
            id=identity,
            vehicle=VEHICLE,
            track=str(line.track),
            label=line.label,
            state=line.state,
            lat=lat,
            lon=lon,
            alt_amsl=line.alt_amsl,
            ellipse=ellipse_of(cov),
            radius95_m=radius_95(cov),
            first_unix=self._first.setdefault(identity, now),
            seen_unix=now,
            source="recording",
        )
        self._picture.on_target(view, now)

    def _on_vehicle(self, plane: TangentPlane, line: TargetLine, relative: PlaceObject, now: float) -> None:
        """Place the vehicle: target minus the target relative to the vehicle."""
        ned = (line.north - relative.north, line.east - relative.east, line.down - relative.down)
        place = plane.geodetic_from_ned(ned)
        changes: dict[str, Any] = {"lat": place.lat_deg, "lon": place.lon_deg, "alt_amsl": place.alt_amsl_m}
        if self._heading_deg is not None:
            changes["heading_deg"] = self._heading_deg
        heard = {"position": now, "attitude": now}
        self._picture.on_vehicle(VEHICLE, now, heard=heard, kind="recording", height_m=-ned[2], **changes)

    def _on_picture(self, update: PictureUpdate, now: float) -> None:
        """Take an update that `--record` has written."""
        for vehicle in update.vehicles:
            fields = msgspec.structs.asdict(vehicle)
            for name in NOT_RECORDED:
                del fields[name]
            heard = fields.pop("heard") or {"position": now}
            self._picture.on_vehicle(vehicle.id, now, heard=heard, **fields)
        for target in update.targets:
            self._picture.on_target(target, now)
        for target_id in update.removed:
            self._picture.remove_target(target_id)
        for text in update.texts:
            self._picture.say(text.vehicle, text.text, now, severity=text.severity)
