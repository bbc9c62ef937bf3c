"""What viewers draw of targets and vehicles: entities of a scene, places, frames. Pure.

The frame ``map`` is ENU about an origin.
"""

from __future__ import annotations

from math import cos, radians, sin
from typing import Any, Final

import msgspec

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.recording.exports.base import Ellipse95

Message = tuple[str, int, dict[str, Any]]
"""Topic, time in Unix nanoseconds, content."""
Stamp = dict[str, int]
"""An instant as viewers have it."""
MAP: Final = "map"
RGB: Final = {
    "confirmed": (0.9, 0.25, 0.05),
    "coasting": (0.85, 0.65, 0.0),
    "tentative": (0.5, 0.5, 0.5),
    "dropped": (0.3, 0.3, 0.3),
}


def _encoded(content: dict[str, Any]) -> msgspec.Raw:
    """A part that most messages share, encoded once."""
    return msgspec.Raw(msgspec.json.encode(content))


def _colours(opacity: float) -> dict[str, msgspec.Raw]:
    return {state: _encoded({"r": r, "g": g, "b": b, "a": opacity}) for state, (r, g, b) in RGB.items()}


UPRIGHT: Final = _encoded({"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0})
FOREVER: Final = _encoded({"sec": 0, "nsec": 0})
DOT: Final = _encoded({"x": 0.3, "y": 0.3, "z": 0.3})
COLOURS: Final = _colours(1.0)
DISC_COLOURS: Final = _colours(0.4)
THIN_M = 0.02
"""Thickness of an ellipse's disc."""
KNOWN_COVARIANCE = 3


def stamp(at_ns: int) -> Stamp:
    """An instant as viewers have it."""
    return {"sec": at_ns // 10**9, "nsec": at_ns % 10**9}


def enu(ned: Vector3) -> dict[str, float]:
    """A place in the frame ``map``."""
    return {"x": ned[1], "y": ned[0], "z": -ned[2]}


def entity(at: Stamp, name: str, text: str, state: str, place: Vector3, ellipse: Ellipse95 | None) -> dict[str, Any]:
    """A target with its ellipse and text. ``place``: NED, metres. ``name``: what a later entity replaces."""
    known = state if state in COLOURS else "tentative"
    position, colour = enu(place), COLOURS[known]
    pose = {"position": position, "orientation": UPRIGHT}
    return {
        "timestamp": at,
        "frame_id": MAP,
        "id": name,
        "lifetime": FOREVER,
        "cylinders": [] if ellipse is None else [_disc(position, ellipse, DISC_COLOURS[known])],
        "spheres": [{"pose": pose, "size": DOT, "color": colour}],
        "texts": [
            {
                "pose": pose,
                "billboard": True,
                "font_size": 14.0,
                "scale_invariant": True,
                "color": colour,
                "text": text,
            }
        ],
    }


def deletion(at: Stamp, name: str) -> dict[str, Any]:
    """The end of an entity."""
    return {"timestamp": at, "type": 0, "id": name}


def transform(at: Stamp, child: str, vehicle_ned: Vector3) -> dict[str, Any]:
    """The place of a vehicle's frame in ``map``."""
    return {
        "timestamp": at,
        "parent_frame_id": MAP,
        "child_frame_id": child,
        "translation": enu(vehicle_ned),
        "rotation": UPRIGHT,
    }


def _disc(position: dict[str, float], ellipse: Ellipse95, colour: msgspec.Raw) -> dict[str, Any]:
    """The 95 % ellipse as a flat elliptic cylinder. Its x axis is the larger one; angles count from east to north."""
    half = 0.5 * radians(90.0 - ellipse.bearing_deg)
    return {
        "pose": {"position": position, "orientation": {"x": 0.0, "y": 0.0, "z": sin(half), "w": cos(half)}},
        "size": {"x": 2.0 * ellipse.major_m, "y": 2.0 * ellipse.minor_m, "z": THIN_M},
        "bottom_scale": 1.0,
        "top_scale": 1.0,
        "color": colour,
    }


def location(at: Stamp, lat: float, lon: float, alt_amsl: float, cov: Any) -> dict[str, Any]:
    """A place with its covariance in ENU; the altitude is above mean sea level, as a file's metadata says."""
    flat = [0.0] * 9
    if cov is not None:
        (nn, ne, nd), (_, ee, ed), (_, _, dd) = cov
        flat = [ee, ne, -ed, ne, nn, -nd, -ed, -nd, dd]
    return {
        "timestamp": at,
        "frame_id": MAP,
        "latitude": lat,
        "longitude": lon,
        "altitude": alt_amsl,
        "position_covariance": flat,
        "position_covariance_type": 0 if cov is None else KNOWN_COVARIANCE,
    }
