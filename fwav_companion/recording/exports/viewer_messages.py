"""Messages for Foxglove and Lichtblick from the lines of a targets file. Pure.

The frame ``map`` is ENU about the origin, as viewers expect; ``vehicle`` and ``camera`` hang below it.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt
from typing import Any, Final

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.ellipses import ellipse_outline
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.recording.exports.base import SHARE, ellipse95
from fwav_companion.recording.lines import Line

Message = tuple[str, int, dict[str, Any]]
"""Topic, time in Unix nanoseconds, content."""
MAP, CAMERA = "map", "camera"
UPRIGHT: Final = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
COLOURS: Final = {
    "confirmed": (0.9, 0.25, 0.05), "coasting": (0.85, 0.65, 0.0), "tentative": (0.5, 0.5, 0.5),
    "dropped": (0.3, 0.3, 0.3),
}  # fmt: skip
LOG_INFO, LOG_WARNING = 2, 3
AXES: Final = ("north", "east", "down")
CLOCK_KEYS: Final = ("host_from_autopilot_s", "sigma_s", "bound_s", "round_trip_s", "status")
KNOWN_COVARIANCE = 3
LOOP = 1
"""LinePrimitive.LINE_LOOP."""
PIXEL_LOOP = 2
"""PointsAnnotation.LINE_LOOP."""


class ViewerMessages:
    """Turns lines into messages, in order."""

    def __init__(self) -> None:
        self._plane: TangentPlane | None = None
        self._unix_offset_s = 0.0
        self._last_ns = 0
        self._placed_ns = -1

    def of_line(self, line: Line) -> Iterator[Message]:
        """The messages of one line of a targets file."""
        kind = line["type"]
        if kind == "header":
            self._unix_offset_s = line.get("unix_offset_s", 0.0)
        if kind in ("header", "origin") and line.get("origin") is not None:
            origin = line["origin"]
            self._plane = TangentPlane(Geodetic.from_degrees(origin["lat"], origin["lon"], origin["alt_amsl"]))
        if kind == "target":
            yield from self._of_target(line)
        elif kind == "clock":
            at_ns = self._at(line["time_monotonic"] + self._unix_offset_s)
            yield "/clock", at_ns, {"timestamp": stamp(at_ns), **{key: line[key] for key in CLOCK_KEYS}}
        elif kind == "calibration":
            yield from self._of_calibration(line)
        elif kind in ("terrain", "home"):
            at_ns = self._at(line["time_unix"])
            text = ", ".join(f"{key} {value}" for key, value in line.items() if key not in ("type", "time_unix"))
            yield self._log(at_ns, f"{kind}: {text}", LOG_INFO)

    def _of_target(self, line: Line) -> Iterator[Message]:
        at_ns = self._at(line["time_unix"])
        place: Vector3 = (line["north"], line["east"], line["down"])
        yield "/targets/scene", at_ns, _scene(at_ns, line, place)
        sigmas = [sqrt(max(0.0, line["cov"][i][i])) for i in range(3)]
        yield (
            "/targets/estimates",
            at_ns,
            {
                "timestamp": stamp(at_ns),
                **{key: line[key] for key in ("track", "label", "state", "north", "east", "down")},
                "sigma_north": sigmas[0],
                "sigma_east": sigmas[1],
                "sigma_down": sigmas[2],
                "major95": ellipse95(line["cov"]).major_m,
            },
        )
        if line["lat"] is not None:
            yield "/targets/location", at_ns, _location(at_ns, line["lat"], line["lon"], line["alt_amsl"], line["cov"])
        relative = line.get("relative")
        if relative is not None and at_ns != self._placed_ns:
            self._placed_ns = at_ns  # one pose a frame, by its first target
            yield from self._of_vehicle(at_ns, tuple(p - relative[key] for p, key in zip(place, AXES, strict=True)))
        if line["state"] == "dropped":
            yield self._log(at_ns, f"track {line['track']} dropped: {line.get('reason', '')}", LOG_INFO)

    def _of_vehicle(self, at_ns: int, vehicle_ned: tuple[float, ...]) -> Iterator[Message]:
        north, east, down = vehicle_ned
        yield (
            "/tf",
            at_ns,
            {
                "timestamp": stamp(at_ns),
                "parent_frame_id": MAP,
                "child_frame_id": "vehicle",
                "translation": enu((north, east, down)),
                "rotation": UPRIGHT,
            },
        )
        if self._plane is not None:
            at = self._plane.geodetic_from_ned((north, east, down))
            yield "/vehicle/location", at_ns, _location(at_ns, at.lat_deg, at.lon_deg, at.alt_amsl_m, None)

    def _of_calibration(self, line: Line) -> Iterator[Message]:
        at_ns = self._at(line["time_unix"])
        axes = {f"mount_{axis}_deg": line["mount_deg"][i] for i, axis in enumerate("xyz")}
        sigmas = {f"mount_sigma_{axis}_deg": line["mount_sigma_deg"][i] for i, axis in enumerate("xyz")}
        said = {key: line[key] for key in ("time_offset_s", "time_offset_sigma_s", "status")}
        yield "/self_calibration", at_ns, {"timestamp": stamp(at_ns), **said, **axes, **sigmas}
        if "mistake" in line:
            yield self._log(at_ns, f"camera mount: {line['mistake']}", LOG_WARNING)

    def _log(self, at_ns: int, text: str, level: int) -> Message:
        content = {"timestamp": stamp(at_ns), "level": level, "message": text, "name": "fwav-companion"}
        return "/log", at_ns, content

    def _at(self, time_unix: float) -> int:
        self._last_ns = max(0, round(time_unix * 1e6) * 1000)  # lines have microseconds
        return self._last_ns


def image(at_ns: int, jpeg_base64: str, form: str) -> Message:
    """A recorded picture."""
    content = {"timestamp": stamp(at_ns), "frame_id": CAMERA, "data": jpeg_base64, "format": form}
    return "/camera/image", at_ns, content


def drawn_detections(at_ns: int, detections: list[dict[str, Any]]) -> Message:
    """The detections of one frame, drawn into its picture."""
    points, texts = [], []
    for each in detections:
        u, v = each.get("u"), each.get("v")
        if u is None or v is None:
            continue
        left, top, right, bottom = each.get("box") or (u - 8.0, v - 8.0, u + 8.0, v + 8.0)
        corners = [{"x": x, "y": y} for x, y in ((left, top), (right, top), (right, bottom), (left, bottom))]
        orange = _colour("confirmed")
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
                "text": str(each.get("label") or ""),
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


def stamp(at_ns: int) -> dict[str, int]:
    """An instant as viewers have it."""
    return {"sec": at_ns // 10**9, "nsec": at_ns % 10**9}


def enu(ned: Vector3) -> dict[str, float]:
    """A place in the frame ``map``."""
    return {"x": ned[1], "y": ned[0], "z": -ned[2]}


def _scene(at_ns: int, line: Line, place: Vector3) -> dict[str, Any]:
    name, colour = f"track {line['track']}", _colour(line["state"])
    if line["state"] == "dropped":
        return {"deletions": [{"timestamp": stamp(at_ns), "type": 0, "id": name}], "entities": []}
    outline = ellipse_outline(line["north"], line["east"], line["cov"], SHARE)
    pose = {"position": enu(place), "orientation": UPRIGHT}
    entity = {
        "timestamp": stamp(at_ns),
        "frame_id": MAP,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "lines": [
            {
                "type": LOOP,
                "pose": {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": UPRIGHT},
                "thickness": 2.0,
                "scale_invariant": True,
                "points": [enu((north, east, place[2])) for north, east in outline],
                "color": colour,
            }
        ],
        "spheres": [{"pose": pose, "size": {"x": 0.3, "y": 0.3, "z": 0.3}, "color": colour}],
        "texts": [
            {
                "pose": pose,
                "billboard": True,
                "font_size": 14.0,
                "scale_invariant": True,
                "color": colour,
                "text": f"{line['label'] or 'target'} {line['track']}",
            }
        ],
    }
    return {"deletions": [], "entities": [entity]}


def _location(at_ns: int, lat: float, lon: float, alt_amsl: float, cov: Any) -> dict[str, Any]:
    """A place with its covariance in ENU; the altitude is above mean sea level, as the file's metadata says."""
    order = (1, 0, 2)
    signs = (1.0, 1.0, -1.0)
    flat = (
        [0.0] * 9
        if cov is None
        else [signs[i] * signs[j] * cov[order[i]][order[j]] for i in range(3) for j in range(3)]
    )
    return {
        "timestamp": stamp(at_ns),
        "frame_id": MAP,
        "latitude": lat,
        "longitude": lon,
        "altitude": alt_amsl,
        "position_covariance": flat,
        "position_covariance_type": 0 if cov is None else KNOWN_COVARIANCE,
    }


def _colour(state: str) -> dict[str, float]:
    r, g, b = COLOURS.get(state, COLOURS["tentative"])
    return {"r": r, "g": g, "b": b, "a": 1.0}
