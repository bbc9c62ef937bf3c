"""Messages for Foxglove and Lichtblick from the lines of a targets file. Pure.

The frame ``map`` is ENU about the origin, as viewers expect; ``vehicle`` and ``camera`` hang below it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Final

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.recording.exports.base import ellipse95
from fwav_companion.recording.exports.viewer_scene import (
    COLOURS,
    Message,
    Stamp,
    deletion,
    entity,
    location,
    stamp,
    transform,
)
from fwav_companion.recording.line_types import (
    CalibrationLine,
    ClockEstimateLine,
    HeaderLine,
    HomeLine,
    Line,
    OriginLine,
    OriginObject,
    TargetLine,
    TerrainLine,
)

CAMERA = "camera"
LOG_INFO, LOG_WARNING = 2, 3
CLOCK_KEYS: Final = ("host_from_autopilot_s", "sigma_s", "bound_s", "round_trip_s", "status")
PIXEL_LOOP = 2
"""PointsAnnotation.LINE_LOOP."""


class ViewerMessages:
    """Turns lines into messages, in order."""

    def __init__(self) -> None:
        self._plane: TangentPlane | None = None
        self._unix_offset_s = 0.0
        self._last_ns = 0
        self._last_pose_ns = -1
        self._has_altitude = True

    def of_line(self, line: Line) -> list[Message]:
        """The messages of one line of a targets file."""
        if isinstance(line, HeaderLine):
            self._unix_offset_s = line.unix_offset_s
        match line:
            case HeaderLine() | OriginLine():
                self._on_origin(line.origin)
            case TargetLine():
                return self._of_target(line)
            case ClockEstimateLine():
                at_ns = self._at(line.time_monotonic + self._unix_offset_s)
                return [
                    ("/clock", at_ns, {"timestamp": stamp(at_ns), **{key: getattr(line, key) for key in CLOCK_KEYS}})
                ]
            case CalibrationLine():
                return self._of_calibration(line)
            case TerrainLine():
                text = f"terrain: shift_m {line.shift_m}, sigma_m {line.sigma_m}, source {line.source}"
                return [self._log(self._at(line.time_unix), text, LOG_INFO)]
            case HomeLine(time_unix=float(at_s)):
                return [self._log(self._at(at_s), f"home: down {line.down}", LOG_INFO)]
        return []

    def _on_origin(self, origin: OriginObject | None) -> None:
        if origin is not None:
            self._plane, self._has_altitude = origin.plane, origin.alt_amsl is not None

    def _of_target(self, line: TargetLine) -> list[Message]:
        at_ns, cov = self._at(line.time_unix), line.cov
        at = stamp(at_ns)
        place: Vector3 = (line.north, line.east, line.down)
        ellipse = ellipse95(cov)
        estimate = {
            "timestamp": at,
            "track": line.track,
            "label": line.label,
            "state": line.state,
            "north": place[0],
            "east": place[1],
            "down": place[2],
            "sigma_north": sqrt(max(0.0, cov[0][0])),
            "sigma_east": sqrt(max(0.0, cov[1][1])),
            "sigma_down": sqrt(max(0.0, cov[2][2])),
            "major95": ellipse.major_m,
        }
        name, state = f"track {line.track}", line.state
        if state == "dropped":
            scene = {"deletions": [deletion(at, name)], "entities": []}
        else:
            text = f"{line.label or 'target'} {line.track}"
            scene = {"deletions": [], "entities": [entity(at, name, text, state, place, ellipse)]}
        messages: list[Message] = [("/targets/scene", at_ns, scene), ("/targets/estimates", at_ns, estimate)]
        if line.lat_lon is not None and line.alt_amsl is not None:
            fix = location(at, *line.lat_lon, line.alt_amsl, cov)
            messages.append(("/targets/location", at_ns, fix))
        relative = line.relative
        if relative is not None and at_ns != self._last_pose_ns:
            self._last_pose_ns = at_ns  # one pose a frame, by its first target
            north, east, down = place
            vehicle_ned = (north - relative.north, east - relative.east, down - relative.down)
            messages += self._of_vehicle(at_ns, at, vehicle_ned)
        if state == "dropped":
            messages.append(self._log(at_ns, f"track {line.track} dropped: {line.reason or ''}", LOG_INFO))
        return messages

    def _of_vehicle(self, at_ns: int, at: Stamp, vehicle_ned: Vector3) -> list[Message]:
        messages: list[Message] = [("/tf", at_ns, transform(at, "vehicle", vehicle_ned))]
        if self._plane is not None and self._has_altitude:
            place = self._plane.geodetic_from_ned(vehicle_ned)
            fix = location(at, place.lat_deg, place.lon_deg, place.alt_amsl_m, None)
            messages.append(("/vehicle/location", at_ns, fix))
        return messages

    def _of_calibration(self, line: CalibrationLine) -> list[Message]:
        at_ns = self._at(line.time_unix)
        axes = {f"mount_{axis}_deg": line.mount_deg[i] for i, axis in enumerate("xyz")}
        sigmas = {f"mount_sigma_{axis}_deg": line.mount_sigma_deg[i] for i, axis in enumerate("xyz")}
        said = {key: getattr(line, key) for key in ("time_offset_s", "time_offset_sigma_s", "status")}
        messages: list[Message] = [("/self_calibration", at_ns, {"timestamp": stamp(at_ns), **said, **axes, **sigmas})]
        if line.mistake:
            messages.append(self._log(at_ns, f"camera mount: {line.mistake}", LOG_WARNING))
        return messages

    def _log(self, at_ns: int, text: str, level: int) -> Message:
        content = {"timestamp": stamp(at_ns), "level": level, "message": text, "name": "fwav-companion"}
        return "/log", at_ns, content

    def _at(self, time_unix: float) -> int:
        self._last_ns = max(0, round(time_unix * 1e6) * 1000)  # lines have microseconds
        return self._last_ns


class DrawnDetection(msgspec.Struct):
    """A recorded detection, with what is drawn of it, pixels."""

    u: float | None = None
    v: float | None = None
    box: tuple[float, float, float, float] | None = None
    label: str | None = None


def image(at_ns: int, data: bytes, form: str) -> Message:
    """A recorded picture. The JSON encoder writes bytes as base64, as the schema has them."""
    content = {"timestamp": stamp(at_ns), "frame_id": CAMERA, "data": data, "format": form}
    return "/camera/image", at_ns, content


def drawn_detections(at_ns: int, detections: Sequence[DrawnDetection]) -> Message:
    """The detections of one frame, drawn into its picture."""
    points, texts = [], []
    for each in detections:
        u, v = each.u, each.v
        if u is None or v is None:
            continue
        left, top, right, bottom = each.box or (u - 8.0, v - 8.0, u + 8.0, v + 8.0)
        corners = [{"x": x, "y": y} for x, y in ((left, top), (right, top), (right, bottom), (left, bottom))]
        orange = COLOURS["confirmed"]
        points.append(
            {
                "timestamp": stamp(at_ns),
                "type": PIXEL_LOOP,
                "points": corners,
                "outline_color": orange,
                "thickness": 2.0,
            }
        )
        texts.append(
            {
                "timestamp": stamp(at_ns),
                "position": {"x": left, "y": top},
                "text": each.label or "",
                "font_size": 14.0,
                "text_color": orange,
            }
        )
    return "/camera/annotations", at_ns, {"points": points, "texts": texts}


def camera_calibration(at_ns: int, size: tuple[int, int], matrix: list[float], distortion: list[float]) -> Message:
    """The lens: ``matrix`` row by row, ``distortion`` k1, k2, p1, p2, k3."""
    fx, _, cx, _, fy, cy, *_ = matrix
    content = {
        "timestamp": stamp(at_ns),
        "frame_id": CAMERA,
        "width": size[0],
        "height": size[1],
        "distortion_model": "plumb_bob",
        "D": distortion,
        "K": matrix,
        "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "P": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
    return "/camera/calibration", at_ns, content
