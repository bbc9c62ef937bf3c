"""JSON schemas of the topics for Foxglove and Lichtblick: well-known names, with the fields that are written. Pure.

A viewer chooses its panel by the schema's name, and reads the fields by the schema. ``fwav.*`` are for plots.
"""

from __future__ import annotations

from typing import Any, Final

import msgspec

NUMBER: Final = {"type": "number"}
TEXT: Final = {"type": "string"}
BYTES: Final = {"type": "string", "contentEncoding": "base64"}


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _array(items: Any) -> dict[str, Any]:
    return {"type": "array", "items": items}


TIME: Final = _object(sec={"type": "integer"}, nsec={"type": "integer"})
VECTOR: Final = _object(x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION: Final = _object(x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE: Final = _object(position=VECTOR, orientation=QUATERNION)
COLOUR: Final = _object(r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
POINT2: Final = _object(x=NUMBER, y=NUMBER)

CYLINDER: Final = _object(pose=POSE, size=VECTOR, bottom_scale=NUMBER, top_scale=NUMBER, color=COLOUR)
SPHERE: Final = _object(pose=POSE, size=VECTOR, color=COLOUR)
LABEL: Final = _object(
    pose=POSE, billboard={"type": "boolean"}, font_size=NUMBER, scale_invariant={"type": "boolean"}, color=COLOUR,
    text=TEXT,
)  # fmt: skip
ENTITY: Final = _object(
    timestamp=TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=TIME,
    cylinders=_array(CYLINDER),
    spheres=_array(SPHERE),
    texts=_array(LABEL),
)
POINTS: Final = _object(
    timestamp=TIME, type={"type": "integer"}, points=_array(POINT2), outline_color=COLOUR, thickness=NUMBER
)
PIXEL_TEXT: Final = _object(timestamp=TIME, position=POINT2, text=TEXT, font_size=NUMBER, text_color=COLOUR)

SCHEMAS: Final[dict[str, dict[str, Any]]] = {
    "foxglove.FrameTransform": _object(
        timestamp=TIME, parent_frame_id=TEXT, child_frame_id=TEXT, translation=VECTOR, rotation=QUATERNION
    ),
    "foxglove.LocationFix": _object(
        timestamp=TIME, frame_id=TEXT, latitude=NUMBER, longitude=NUMBER, altitude=NUMBER,
        position_covariance=_array(NUMBER), position_covariance_type={"type": "integer"},
    ),
    "foxglove.SceneUpdate": _object(deletions=_array(_object(id=TEXT)), entities=_array(ENTITY)),
    "foxglove.ImageAnnotations": _object(points=_array(POINTS), texts=_array(PIXEL_TEXT)),
    "foxglove.CompressedImage": _object(timestamp=TIME, frame_id=TEXT, data=BYTES, format=TEXT),
    "foxglove.CameraCalibration": _object(
        timestamp=TIME, frame_id=TEXT, width={"type": "integer"}, height={"type": "integer"}, distortion_model=TEXT,
        D=_array(NUMBER), K=_array(NUMBER), R=_array(NUMBER), P=_array(NUMBER),
    ),
    "foxglove.Log": _object(timestamp=TIME, level={"type": "integer"}, message=TEXT, name=TEXT),
    "fwav.Target": _object(
        timestamp=TIME, track={"type": "integer"}, label=TEXT, state=TEXT, north=NUMBER, east=NUMBER, down=NUMBER,
        sigma_north=NUMBER, sigma_east=NUMBER, sigma_down=NUMBER, major95=NUMBER,
    ),
    "fwav.Clock": _object(
        timestamp=TIME, host_from_autopilot_s=NUMBER, sigma_s=NUMBER, bound_s=NUMBER, round_trip_s=NUMBER, status=TEXT
    ),
    "fwav.SelfCalibration": _object(
        timestamp=TIME, time_offset_s=NUMBER, time_offset_sigma_s=NUMBER, mount_x_deg=NUMBER, mount_y_deg=NUMBER,
        mount_z_deg=NUMBER, mount_sigma_x_deg=NUMBER, mount_sigma_y_deg=NUMBER, mount_sigma_z_deg=NUMBER, status=TEXT,
    ),
}  # fmt: skip

TOPICS: Final = {
    "/tf": "foxglove.FrameTransform",
    "/vehicle/location": "foxglove.LocationFix",
    "/targets/location": "foxglove.LocationFix",
    "/targets/scene": "foxglove.SceneUpdate",
    "/targets/estimates": "fwav.Target",
    "/camera/image": "foxglove.CompressedImage",
    "/camera/annotations": "foxglove.ImageAnnotations",
    "/camera/calibration": "foxglove.CameraCalibration",
    "/clock": "fwav.Clock",
    "/self_calibration": "fwav.SelfCalibration",
    "/log": "foxglove.Log",
}
"""The schema of every topic."""


def schema_text(name: str) -> bytes:
    """A schema as JSON."""
    return msgspec.json.encode({"title": name, "$comment": "fwav-companion", **SCHEMAS[name]})
