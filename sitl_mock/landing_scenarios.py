"""Scenarios of a copter that lands by the LANDING_TARGET that it receives."""

from __future__ import annotations

from typing import Any

from sitl_mock.copter_scenarios import COPTER, PAD_OF_THREE, WIDE_ANGLE
from sitl_mock.target_options import PadTagOptions, TargetOptions

TAG_SIZE_M = 0.2
ONE_TAG = TargetOptions(label="pad", heading_deg=65.0, tags=(PadTagOptions(label="tag36h11:0", size_m=TAG_SIZE_M),))
ASIDE_M = -2.0
"""Where tags lie, right of the landing point, that the copter lands beside."""


def _beside(target: TargetOptions) -> TargetOptions:
    """The target with its tags beside the landing point."""
    tags = tuple(
        PadTagOptions(
            label=tag.label,
            size_m=tag.size_m,
            forward_m=tag.forward_m,
            right_m=tag.right_m + ASIDE_M,
            yaw_deg=tag.yaw_deg,
        )
        for tag in target.tags
    )
    return TargetOptions(label=target.label, heading_deg=target.heading_deg, tags=tags)


LANDING: dict[str, Any] = {
    **COPTER,
    "flight.pattern": "landing",
    "flight.wander_m": 0.0,
    "flight.height_m": 6.0,
    "flight.offset_m": (-0.8, 0.5),
    "flight.fixed_heading_deg": 30.0,
    "autopilot.position_wander": "smooth",
    "camera.clutter": 0.0,
    "camera.corner_noise_px": 0.3,
    "targets": (ONE_TAG,),
    "seconds": 60.0,
}
"""Held at 6 m a metre beside the pad, LAND after 6 s; corners of a sharp print."""
INDOORS: dict[str, Any] = {**LANDING, "autopilot.gps": False, "autopilot.flow": True, "lander.at_s": 13.0}
"""LAND once the service has waited for a global position."""
BOAT: dict[str, Any] = {
    **LANDING,
    "flight.height_m": 7.0,
    "lander.moving_target": True,
    "targets": (
        TargetOptions(
            label="pad",
            up=0.5,
            speed_m_s=0.5,
            course_deg=40.0,
            heave_m=0.2,
            heading_deg=PAD_OF_THREE.heading_deg,
            turn_deg_s=5.0,
            tags=PAD_OF_THREE.tags,
        ),
    ),
}

ASIDE: dict[str, Any] = {
    **LANDING,
    **WIDE_ANGLE,
    "camera.mount_deg": (0.0, -55.0, -90.0),
    "flight.fixed_heading_deg": 65.0,
}
"""The camera looks 35 deg to the left of straight down, where the tags are: it sees them to half a metre."""

LANDING_SCENARIOS: dict[str, tuple[str, dict[str, Any]]] = {
    "land": ("a copter lands from 6 m on a tag of 0.2 m, by LANDING_TARGET", LANDING),
    "land_jump": (
        "the same with a GNSS position that jumps by 2 m at 5 m height",
        {**LANDING, "autopilot.position_shifts": ((8.4, 8.4, 1.6, -1.2),)},
    ),
    "land_indoors": ("the same without GNSS, by optical flow and rangefinder", INDOORS),
    "land_tag_size": (
        "the same without GNSS and without a rangefinder",
        {**INDOORS, "autopilot.rangefinder": False},
    ),
    "land_pad": (
        "a copter lands from 7 m on a pad of three tags of 0.4, 0.12 and 0.04 m",
        {**LANDING, "flight.height_m": 7.0, "targets": (PAD_OF_THREE,)},
    ),
    "land_beside_tag": (
        "a copter lands 2 m beside a tag of 0.2 m, with a wide camera that looks 35 deg to the left",
        {**ASIDE, "targets": (_beside(ONE_TAG),)},
    ),
    "land_beside_pad": (
        "a copter lands 2 m beside a pad of three tags, with the same camera",
        {**ASIDE, "targets": (_beside(PAD_OF_THREE),)},
    ),
    "land_boat": (
        "a copter lands on a pad on a boat: 0.5 m/s, 0.2 m of heave, turning by 5 deg/s",
        BOAT,
    ),
}
"""name: (one-line description, differences from the default)."""
