"""NAMED_VALUE_FLOAT (251): the selected target as numbers that Mission Planner can show in its quick view."""

from __future__ import annotations

from math import degrees, nan
from typing import Any

from fwav_companion.geometry.ellipses import radius_95
from fwav_companion.publishing.target_report import boot_ms, float32, target_report
from fwav_companion.types.situation import Situation
from fwav_companion.types.tracks import Track

NAMES = ("TGT_ID", "TGT_N", "TGT_E", "TGT_DIST", "TGT_BRG", "TGT_ACC", "TGT_R95")
"""At most ten characters, all that the message holds."""


def named_values(track: Track | None, situation: Situation) -> list[dict[str, Any]]:
    """The track's number, metres north and east of the origin, distance from the vehicle, bearing in degrees from
    north, one sigma along the larger semi-axis, and the radius of the 95 % circle. Without a target the number is 0
    and the rest is NaN.
    """
    values = (0.0, *(nan,) * (len(NAMES) - 1)) if track is None else _values(track, situation)
    stamp = boot_ms(situation.now_ns)
    return [
        {"time_boot_ms": stamp, "name": name, "value": float32(value)}
        for name, value in zip(NAMES, values, strict=True)
    ]


def _values(track: Track, situation: Situation) -> tuple[float, ...]:
    target = target_report(track, situation)
    return (
        float(track.id),
        target.position_ned[0],
        target.position_ned[1],
        target.distance_m,
        degrees(target.bearing) % 360.0,
        target.horizontal_sigma_m,
        radius_95(track.cov),
    )
