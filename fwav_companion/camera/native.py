"""The project's own camera file: the paper's constants by their names."""

from __future__ import annotations

from math import radians

from fwav_companion.camera.fields import Fields
from fwav_companion.camera.intrinsics import CameraMatrix, checked
from fwav_companion.camera.kannala_brandt import KannalaBrandt

MODEL = "kannala_brandt"


def native_lens(fields: Fields) -> KannalaBrandt:
    """The lens of a file with ``k_mm``, ``pixels_per_mm``, ``principal_point``, ``image_size``, ``max_angle_deg``."""
    known = {"model", "k_mm", "pixels_per_mm", "principal_point", "image_size", "max_angle_deg"}
    for key in fields:
        if key not in known:
            raise fields.refusal(key, f"only {', '.join(sorted(known))}")
    image_size = fields.size("image_size")
    k_mm = fields.numbers("k_mm", 1, 2, 3, 4, 5)
    if k_mm[0] <= 0.0:
        raise fields.refusal("k_mm", "a positive first coefficient")
    m_u, m_v = fields.numbers("pixels_per_mm", 2)
    if min(m_u, m_v) <= 0.0:
        raise fields.refusal("pixels_per_mm", "two positive numbers")
    u0, v0 = fields.numbers("principal_point", 2)
    checked(fields, "principal_point", CameraMatrix((m_u, m_v), (u0, v0), image_size))
    max_angle = None
    if "max_angle_deg" in fields:
        max_angle = radians(fields.positive("max_angle_deg"))
        if max_angle > radians(180.0):
            raise fields.refusal("max_angle_deg", "an angle from the optical axis of at most 180 degrees")
    return KannalaBrandt(k_mm, (m_u, m_v), (u0, v0), image_size, max_angle)
