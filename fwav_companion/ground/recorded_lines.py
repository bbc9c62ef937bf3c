"""Reads lines of a targets file, or of a recording of this program, into the picture. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from math import atan2, degrees
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.ground.covariances import ellipse_of
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.views import PictureUpdate, TargetView

VEHICLE = "1"
"""Name of the vehicle of a targets file, which has one vehicle and does not name it."""

NOT_RECORDED = ("id", "revision", "number", "heard_unix", "quiet", "silent", "ready_unix", "contradicted_unix")
"""Fields of a recorded vehicle that the picture makes itself."""


class RecordedLines:
    """Takes the lines of one recording in their order."""

    def __init__(self, picture: GroundPicture) -> None:
        self._picture = picture
        self._plane: TangentPlane | None = None
        self._heading_deg: float | None = None
        self._first: dict[str, float] = {}
        self.offset_s = 0.0
        """Recording's clock minus the companion's monotonic clock, seconds."""

    def take(self, line: Mapping[str, Any], now: float) -> None:
        """Process one line. Lines of other kinds have no data for the picture."""
        match line.get("type"):
            case "header":
                self.offset_s = line.get("unix_offset_s") or 0.0
                self._on_origin(line)
            case "origin":
                self._on_origin(line)
            case "sighting":
                self._on_sighting(line)
            case "target":
                self._on_target(line, now)
            case "picture":
                self._on_picture(line, now)

    def _on_origin(self, line: Mapping[str, Any]) -> None:
        if (origin := line.get("origin")) is not None:
            place = Geodetic.from_degrees(origin["lat"], origin["lon"], origin["alt_amsl"])
            self._plane = TangentPlane(place)

    def _on_sighting(self, line: Mapping[str, Any]) -> None:
        if (q := line.get("q_ned_body")) is not None:
            w, x, y, z = q
            self._heading_deg = degrees(atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))) % 360.0

    def _on_target(self, line: Mapping[str, Any], now: float) -> None:
        relative = line.get("relative")
        if relative is not None and self._plane is not None:
            self._on_vehicle(self._plane, line, relative, now)
        if line["lat"] is None:
            return
        identity = f"{VEHICLE}/{line['track']}"
        cov = line["cov"]
        view = TargetView(
            id=identity,
            vehicle=VEHICLE,
            track=str(line["track"]),
            label=line["label"],
            state=line["state"],
            lat=line["lat"],
            lon=line["lon"],
            alt_amsl=line["alt_amsl"],
            ellipse=ellipse_of(cov),
            radius95_m=radius_95(cov),
            first_unix=self._first.setdefault(identity, now),
            seen_unix=now,
            source="recording",
        )
        self._picture.on_target(view, now)

    def _on_vehicle(
        self, plane: TangentPlane, line: Mapping[str, Any], relative: Mapping[str, float], now: float
    ) -> None:
        """Place the vehicle: target minus the target relative to the vehicle."""
        ned = tuple(line[axis] - relative[axis] for axis in ("north", "east", "down"))
        place = plane.geodetic_from_ned((ned[0], ned[1], ned[2]))
        changes: dict[str, Any] = {"lat": place.lat_deg, "lon": place.lon_deg, "alt_amsl": place.alt_amsl_m}
        if self._heading_deg is not None:
            changes["heading_deg"] = self._heading_deg
        heard = {"position": now, "attitude": now}
        self._picture.on_vehicle(VEHICLE, now, heard=heard, kind="recording", height_m=-ned[2], **changes)

    def _on_picture(self, line: Mapping[str, Any], now: float) -> None:
        """Take an update that `--record` has written."""
        update = msgspec.convert(line["update"], PictureUpdate)
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
