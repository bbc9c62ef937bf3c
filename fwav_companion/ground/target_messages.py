"""Decodes MAVLink messages to targets, texts and readiness. Pure.

CAMERA_TRACKING_GEO_STATUS has the selected target of a vehicle; TGT_ID and TGT_R95 have its number and the radius of
its 95 % circle. Other targets are known from the texts that report them found or lost.
"""

from __future__ import annotations

import re
from math import isfinite
from typing import Any

import msgspec

from fwav_companion.geometry.ellipses import ELLIPSE_95
from fwav_companion.ground.picture import GroundPicture
from fwav_companion.ground.text_chunks import TextChunks
from fwav_companion.ground.views import EllipseView, TargetView
from fwav_companion.publishing.enums import (
    CAMERA_TRACKING_STATUS_FLAGS_ACTIVE,
    CAMERA_TRACKING_STATUS_FLAGS_COASTING,
)
from fwav_companion.types import Message

VALUE_AGE_S = 2.0
"""Age of a named value beyond which it no longer belongs to the status message."""
AUTOPILOT = 1
REPORTED = re.compile(
    r"(?P<what>found|lost) (?P<label>.+) (?P<track>\d+)(?: \([^)]*\))?: (?:last at )?"
    r"(?P<lat>-?\d+\.\d+), (?P<lon>-?\d+\.\d+), 95 % within (?P<radius>\d+(?:\.\d+)?) m"
)
"""Texts of the companion about targets."""
CONTRADICTED = re.compile(r"camera mount: .+|landmarks .+ contradict one another")
"""Texts of the companion that say that the claimed accuracy does not hold. It does not take them back."""
NO_PICTURES = "not ready: no pictures"
NO_PICTURES_AGE_S = 6.0
"""Age of the newest picture when this is reported, seconds: 3 without one, and 3 for which that has held."""
AUTOPILOT_LOST = "autopilot lost: "
READY = re.compile(r"(?P<not>not )?ready: (?P<text>.+)")


class NamedValues(msgspec.Struct):
    """Named values of the selected target of one vehicle, with their instants."""

    track: int = 0
    track_unix: float = 0.0
    radius95_m: float | None = None
    radius_unix: float = 0.0


class TargetMessages:
    """Decodes messages about targets."""

    def __init__(self, picture: GroundPicture) -> None:
        self._picture = picture
        self._texts = TextChunks()
        self._values: dict[int, NamedValues] = {}
        self._labels: dict[str, str] = {}

    def on_message(self, message: Message, now: float) -> None:
        """Process one message of a known vehicle."""
        match message.name:
            case "CAMERA_TRACKING_GEO_STATUS":
                self._on_geo_status(message, now)
            case "NAMED_VALUE_FLOAT":
                self._on_value(message, now)
            case "STATUSTEXT":
                text = self._texts.add((message.system, message.component), message.fields, now)
                if text is not None:
                    self._on_text(message.system, message.component, message.fields.severity, text=text, now=now)

    def flush(self, now: float) -> None:
        """Show texts whose missing chunks did not arrive."""
        for system, severity, text in self._texts.overdue(now):
            self._picture.say(str(system), text, now, severity=severity)

    def _on_geo_status(self, message: Message, now: float) -> None:
        fields, vehicle = message.fields, str(message.system)
        active = fields.tracking_status & CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
        if not active or not -900000000 <= fields.lat <= 900000000 or (fields.lat == 0 and fields.lon == 0):
            return
        values = self._values.get(message.system, NamedValues())
        numbered = values.track > 0 and now <= values.track_unix + VALUE_AGE_S
        track = str(values.track) if numbered else ""
        radius, bound = self._radius(values, fields.h_acc, now)
        coasting = fields.tracking_status & CAMERA_TRACKING_STATUS_FLAGS_COASTING
        identity = f"{vehicle}/{track or 'selected'}"
        known = self._picture.targets.get(identity)
        seen_unix = now if known is None or not coasting else known.seen_unix
        if numbered:
            self._picture.remove_target(f"{vehicle}/selected")
        self._picture.on_target(
            TargetView(
                id=identity,
                vehicle=vehicle,
                track=track,
                label=self._labels.get(identity, ""),
                state="coasting" if coasting else "selected",
                lat=fields.lat / 1e7,
                lon=fields.lon / 1e7,
                alt_amsl=_finite(fields.alt),
                ellipse=None if radius is None else EllipseView(radius, radius, 0.0),
                radius95_m=radius,
                bound=bound,
                first_unix=now,
                seen_unix=seen_unix,
                source="mavlink",
            ),
            now,
        )

    def _radius(self, values: NamedValues, sigma_m: float, now: float) -> tuple[float | None, bool]:
        """Radius of the 95 % circle, and whether it is an upper bound."""
        if values.radius95_m is not None and now <= values.radius_unix + VALUE_AGE_S:
            return values.radius95_m, False
        return (ELLIPSE_95 * sigma_m, True) if isfinite(sigma_m) and sigma_m > 0.0 else (None, False)

    def _on_value(self, message: Message, now: float) -> None:
        fields = message.fields
        if fields.name not in ("TGT_ID", "TGT_R95"):
            return
        values = self._values.setdefault(message.system, NamedValues())
        if fields.name == "TGT_ID":
            values.track = int(fields.value) if isfinite(fields.value) else 0
            values.track_unix = now
        else:
            values.radius95_m, values.radius_unix = _finite(fields.value), now

    def _on_text(self, system: int, component: int, severity: int, *, text: str, now: float) -> None:
        vehicle = str(system)
        self._picture.say(vehicle, text, now, severity=severity)
        if component == AUTOPILOT:
            return
        if (ready := READY.match(text)) is not None:
            heard: dict[str, float | None] = {"companion": now, "readiness": now, "detector": None}
            if text.startswith(NO_PICTURES):
                heard["detector"] = now - NO_PICTURES_AGE_S
                self._picture.on_silence_reported(vehicle, "detector")
            self._picture.on_vehicle(vehicle, now, heard=heard, ready=ready["not"] is None, readiness=text)
        elif text.startswith(AUTOPILOT_LOST):
            self._picture.on_silence_reported(vehicle, "autopilot")
        elif CONTRADICTED.match(text) is not None:
            self._picture.on_vehicle(vehicle, now, contradicted=text)
        elif (report := REPORTED.match(text)) is not None:
            self._on_report(vehicle, report, now)

    def _on_report(self, vehicle: str, report: re.Match[str], now: float) -> None:
        """Add a target that a text reports found or lost; it does not replace a track that the camera reports."""
        identity = f"{vehicle}/{report['track']}"
        self._labels[identity] = report["label"]
        while len(self._labels) > 4096:
            del self._labels[next(iter(self._labels))]
        lost = report["what"] == "lost"
        known = self._picture.targets.get(identity)
        if known is not None and known.source != "text" and not lost:
            return
        radius = float(report["radius"])
        view = TargetView(
            id=identity,
            vehicle=vehicle,
            track=report["track"],
            label=report["label"],
            state="lost" if lost else "reported",
            lat=float(report["lat"]),
            lon=float(report["lon"]),
            ellipse=EllipseView(radius, radius, 0.0),
            radius95_m=radius,
            first_unix=now,
            seen_unix=now,
            source="text",
        )
        self._picture.on_target(view, now)


def _finite(value: Any) -> float | None:
    return float(value) if isfinite(value) else None
