"""Pictures and ground on one vertical scale: which altitude of a picture counts, from which level, how certain. PURE.

The absolute altitude of a consumer drone is barometric. Where the take-off's altitude is not known, the answer counts
from the ground at the take-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, sqrt
from statistics import median

import msgspec

from fwav_companion.errors import InputFileError
from fwav_companion.geometry.geoid import TWO_GEOIDS_SIGMA_M, Geoid
from fwav_companion.photographs.makers import DISPUTED
from fwav_companion.photographs.picture_pose import AltDatum, Altitude, PicturePose, Sigma
from fwav_companion.photographs.stated_datum import with_stated_datum

TRUSTED_M = 5.0
"""Largest shared sigma of an absolute altitude that is used without the take-off's, metres."""
PRECISE_M = 0.5
"""Own sigma of an absolute altitude below which it counts in place of the barometer's: RTK."""
WARN_BETWEEN_M = 15.0
"""Difference of absolute altitude and take-off plus relative height beyond which it is reported, metres."""


class VerticalOptions(msgspec.Struct, frozen=True, kw_only=True):
    """What the user says about altitudes; above EGM96, metres."""

    alt_datum: AltDatum | None = None
    """Datum of the pictures' absolute altitudes; None: by their own tags."""
    takeoff_alt_m: float | None = None
    takeoff_sigma_m: float = 0.0
    ground_alt_m: float | None = None
    has_terrain: bool = False


class CameraHeight(msgspec.Struct, frozen=True):
    """Height of a camera above the level of its :class:`VerticalScale`, metres."""

    metres: float
    sigma: Sigma


class VerticalScale(msgspec.Struct, frozen=True, kw_only=True):
    """The cameras' heights on one scale."""

    level: AltDatum
    """egm96, or takeoff."""
    heights: tuple[CameraHeight, ...]
    flat_ground_m: float | None
    """Height of flat ground on this scale; None with an elevation model."""
    flat_ground_sigma_m: float = 0.0
    """One sigma of it in addition to the relief, metres: of a take-off below cameras whose altitude is by RTK."""
    takeoff_alt_m: float | None
    """Altitude of the take-off above EGM96; None where it is not known."""
    takeoff_sigma_m: float = 0.0
    notes: tuple[str, ...] = ()


def vertical_scale(
    names: Sequence[str], poses: Sequence[PicturePose], geoid: Geoid, options: VerticalOptions
) -> VerticalScale:
    """The cameras' heights. InputFileError names the picture and what to give."""
    notes: list[str] = []
    poses = [with_stated_datum(pose, options.alt_datum) for pose in poses]
    absolutes = [_above_geoid(pose, geoid, notes) for pose in poses]
    relatives = [pose.above_takeoff for pose in poses]
    if options.has_terrain or options.ground_alt_m is not None:
        heights = [
            _absolute_height(name, absolute, relative, options, notes)
            for name, absolute, relative in zip(names, absolutes, relatives, strict=True)
        ]
        ground = None if options.has_terrain else options.ground_alt_m
        if ground is not None:
            notes.append(f"flat ground at {ground:g} m above sea level")
        return VerticalScale(
            level=AltDatum.EGM96,
            heights=tuple(heights),
            flat_ground_m=ground,
            takeoff_alt_m=options.takeoff_alt_m,
            takeoff_sigma_m=options.takeoff_sigma_m,
            notes=tuple(dict.fromkeys(notes)),
        )
    return _above_flat_takeoff(names, absolutes, relatives, options, notes)


def _above_flat_takeoff(
    names: Sequence[str],
    absolutes: Sequence[Altitude | None],
    relatives: Sequence[Altitude | None],
    options: VerticalOptions,
    notes: list[str],
) -> VerticalScale:
    """Heights above level ground at the take-off, whose altitude is given, estimated from RTK, or unknown."""
    both = [
        (absolute, relative)
        for absolute, relative in zip(absolutes, relatives, strict=True)
        if absolute is not None and relative is not None and absolute.sigma.shared <= TRUSTED_M
    ]
    takeoff, takeoff_sigma = options.takeoff_alt_m, options.takeoff_sigma_m
    if takeoff is None and both:
        takeoff = median(absolute.metres - relative.metres for absolute, relative in both)
        takeoff_sigma = hypot(both[0][0].sigma.shared, both[0][1].sigma.shared)
    heights, ground_sigma = [], 0.0
    for name, absolute, relative in zip(names, absolutes, relatives, strict=True):
        precise = absolute is not None and takeoff is not None and absolute.sigma.own < PRECISE_M
        if precise and absolute is not None and relative is not None and takeoff is not None:
            # Above the sea these heights are exact. How far the take-off is below them is by the barometer, whose error
            # is one of the ground's height: it moves the place, and not the altitude of what is seen from two sides.
            heights.append(CameraHeight(absolute.metres - takeoff, absolute.sigma))
            if options.takeoff_alt_m is None:
                ground_sigma = hypot(relative.sigma.shared, relative.sigma.own / sqrt(len(both)))
        elif relative is not None:
            heights.append(CameraHeight(relative.metres, relative.sigma))
        elif absolute is not None and takeoff is not None:
            heights.append(CameraHeight(absolute.metres - takeoff, absolute.sigma))
        else:
            raise InputFileError(
                f"{name}: no height above the take-off in its tags; "
                "give --terrain FILE, --ground-alt M or --takeoff-alt M"
            )
    notes.append("flat ground at take-off height: give --terrain FILE for hills")
    if takeoff is None:
        notes.append("the take-off's altitude is not known: give --takeoff-alt M for an altitude above sea level")
    return VerticalScale(
        level=AltDatum.TAKEOFF,
        heights=tuple(heights),
        flat_ground_m=0.0,
        flat_ground_sigma_m=ground_sigma,
        takeoff_alt_m=takeoff,
        takeoff_sigma_m=takeoff_sigma if ground_sigma == 0.0 else 0.0,
        notes=tuple(dict.fromkeys(notes)),
    )


def _above_geoid(pose: PicturePose, geoid: Geoid, notes: list[str]) -> Altitude | None:
    """The absolute altitude above EGM96: the height above the ellipsoid less the undulation (H = h - N)."""
    absolute = pose.absolute
    if absolute is None:
        return None
    if absolute.note:
        better = "; give --alt-datum egm96 or ellipsoid if you know it" if absolute.sigma == DISPUTED else ""
        notes.append(f"{absolute.note} (one sigma {absolute.sigma.shared:g} m){better}")
    metres = absolute.metres
    if absolute.datum is AltDatum.ELLIPSOID:
        metres -= geoid.undulation_m(pose.lat_deg, pose.lon_deg)
    return Altitude(metres, AltDatum.EGM96, absolute.sigma)


def _absolute_height(
    name: str, absolute: Altitude | None, relative: Altitude | None, options: VerticalOptions, notes: list[str]
) -> CameraHeight:
    """Height above EGM96: an absolute altitude that is trusted, else take-off plus relative, else any absolute one."""
    by_takeoff = None
    if options.takeoff_alt_m is not None and relative is not None:
        shared = hypot(relative.sigma.shared, options.takeoff_sigma_m)
        by_takeoff = CameraHeight(options.takeoff_alt_m + relative.metres, Sigma(relative.sigma.own, shared))
    if absolute is not None and (absolute.sigma.shared <= TRUSTED_M or by_takeoff is None):
        if by_takeoff is None and absolute.sigma.shared > TRUSTED_M:
            notes.append(
                f"WARNING: the absolute altitude counts with {absolute.sigma.shared:g} m: "
                "give --takeoff LAT,LON or --takeoff-alt M"
            )
        return CameraHeight(absolute.metres, absolute.sigma)
    if by_takeoff is None:
        raise InputFileError(f"{name}: no altitude that counts; give --takeoff LAT,LON or --takeoff-alt M")
    if absolute is not None and abs(absolute.metres - by_takeoff.metres) > WARN_BETWEEN_M:
        apart = absolute.metres - by_takeoff.metres
        notes.append(
            f"WARNING: {name}: its absolute altitude is {apart:+.0f} m from take-off plus relative height; not used"
        )
    return by_takeoff


def ground_sigma_m(terrain_sigma_m: float, poses: Sequence[PicturePose], other_geoid: bool) -> float:
    """One sigma of an elevation model's heights against the pictures', with the difference of two geoids."""
    mixed = other_geoid or any(p.absolute is not None and p.absolute.datum is AltDatum.ELLIPSOID for p in poses)
    return hypot(terrain_sigma_m, TWO_GEOIDS_SIGMA_M) if mixed else terrain_sigma_m
