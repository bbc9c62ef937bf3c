"""Photographs and ground to cameras and a surface in one local world. PURE."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from math import radians

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.geoid import Geoid
from fwav_companion.geometry.geoid_file import GtxGeoid
from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.localization import ElevationModel
from fwav_companion.photographs.picture_pose import AltDatum, PicturePose, PoseSigmas, Sigma
from fwav_companion.tools.locate.heights import VerticalScale, ground_sigma_m
from fwav_companion.tools.locate.shots import SHARED_COUNT, SharedError, Shot
from fwav_companion.tools.locate.surfaces import FlatSurface, Surface, TerrainSurface
from fwav_companion.types import Lens

UNSTATED_DELAY_S = 0.01
"""What `init` writes for the delay of a camera's own stamps; it says nothing about a video's telemetry."""
RELIEF_M, RELIEF_PER_HEIGHT = 4.0, 0.05
"""One sigma of the relief of ground that is taken as flat: a floor, and a part of the height above ground."""


class PosedPicture(msgspec.Struct, frozen=True):
    """A picture with all that its camera needs."""

    name: str
    pose: PicturePose
    lens: Lens
    focal_sigma: float


class PictureWorld(msgspec.Struct, frozen=True):
    """Cameras and ground about one origin."""

    plane: TangentPlane
    shots: tuple[Shot, ...]
    shared_sigmas: tuple[tuple[float, ...], ...]
    surface: Surface
    scale: VerticalScale
    ground_claim: str
    """For the user: how certain the ground's level is taken to be."""


class Configured(msgspec.Struct, frozen=True, kw_only=True):
    """Sigmas that the configuration states; None: by the pictures' source."""

    position_bias_m: float | None = None
    height_bias_m: float | None = None
    mount_bias_deg: float | None = None
    heading_bias_deg: float | None = None
    terrain_m: float | None = None
    time_offset_sigma_s: float | None = None


def stated_uncertainty(text: str) -> Configured:
    """The numbers of [uncertainty] in a configuration that was found valid; "auto" is by the pictures' source.

    The defaults that the file does not write down are those of a vehicle and do not count.
    """
    table = tomllib.loads(text).get("uncertainty", {})
    if table.get("time_offset_sigma_s") == UNSTATED_DELAY_S:
        del table["time_offset_sigma_s"]
    known = {name: table[name] for name in Configured.__struct_fields__ if isinstance(table.get(name), int | float)}
    return Configured(**known)


def make_world(
    pictures: Sequence[PosedPicture],
    scale: VerticalScale,
    geoid: Geoid,
    *,
    elevation: ElevationModel | None = None,
    terrain_datum: str = "egm96",
    configured: Configured | None = None,
    egm2008: GtxGeoid | None = None,
) -> PictureWorld:
    """The cameras about the first picture's place; down is counted from the level of ``scale``."""
    configured = configured or Configured()
    first = pictures[0].pose
    plane = TangentPlane(Geodetic.from_degrees(first.lat_deg, first.lon_deg, 0.0))
    groups: dict[tuple[str, float, float, float], int] = {}
    shots, shared = [], []
    for picture, height in zip(pictures, scale.heights, strict=True):
        motion = picture.pose.motion
        delay_sigma_s = 0.0 if motion is None else motion.delay_sigma_s
        key = (picture.pose.layout, height.sigma.shared, picture.focal_sigma, delay_sigma_s)
        if key not in groups:
            groups[key] = len(groups)
            sigmas = _shared(picture.pose.sigmas, height.sigma, picture.focal_sigma, configured)
            sigmas[SharedError.DELAY] = either(configured.time_offset_sigma_s, delay_sigma_s) if motion else 0.0
            shared.append(tuple(sigmas))
        shots.append(_shot(picture, plane, height.metres, height.sigma.own, groups[key]))
    surface: Surface
    if elevation is None:
        flat = scale.flat_ground_m or 0.0
        relief = RELIEF_M if configured.terrain_m is None else configured.terrain_m
        per_height = RELIEF_PER_HEIGHT if configured.terrain_m is None else 0.0
        surface = FlatSurface(-flat, relief, per_height, scale.flat_ground_sigma_m)
        claim = _flat_claim(relief, per_height, scale.flat_ground_sigma_m)
    else:
        raised = -geoid.undulation_m(first.lat_deg, first.lon_deg) if terrain_datum == "ellipsoid" else 0.0
        apart = None
        if terrain_datum == "egm2008" and egm2008 is not None:
            apart = egm2008.undulation_m(first.lat_deg, first.lon_deg)
            raised = 0.0 if apart is None else apart - geoid.undulation_m(first.lat_deg, first.lon_deg)
        sigma = RELIEF_M if configured.terrain_m is None else configured.terrain_m
        poses = [picture.pose for picture in pictures]
        sigma = (
            ground_sigma_m(sigma, poses, other_geoid=terrain_datum == AltDatum.ELLIPSOID or terrain_datum == "egm2008")
            if apart is None
            else sigma
        )
        surface = TerrainSurface(elevation, plane, raised, sigma)
        claim = f"the elevation model's heights are right within {sigma:.2g} m (one sigma)"
    return PictureWorld(plane, tuple(shots), tuple(shared), surface, scale, claim)


def _flat_claim(relief_m: float, per_height: float, level_sigma_m: float) -> str:
    claim = f"the true ground lies within {relief_m:g} m of the flat one (one sigma)"
    if per_height > 0.0:
        claim += f", or {per_height:.0%} of the height above ground if that is more"
    if level_sigma_m > 0.0:
        claim += f"; the flat one's level is by the barometer, within {level_sigma_m:.1f} m"
    return claim


def _shot(picture: PosedPicture, plane: TangentPlane, height_m: float, own_height_m: float, group: int) -> Shot:
    pose = picture.pose
    roll, pitch, yaw = map(radians, (pose.roll_deg, pose.pitch_deg, pose.yaw_deg))
    return Shot(
        name=picture.name,
        camera_ned=plane.ned_from_geodetic(Geodetic.from_degrees(pose.lat_deg, pose.lon_deg, height_m)),
        ned_from_camera=body_from_camera_from_euler(roll, pitch, yaw),
        lens=picture.lens,
        own_position_m=pose.sigmas.position_m.own,
        own_height_m=own_height_m,
        own_attitude=radians(pose.sigmas.attitude_deg.own),
        velocity_ned=(0.0, 0.0, 0.0) if pose.motion is None else pose.motion.velocity_ned,
        turn=(0.0, 0.0, 0.0) if pose.motion is None else _about_camera_axes(pose.motion.turn),
        group=group,
    )


def _about_camera_axes(turn: Vector3) -> Vector3:
    """Gimbal axes are forward, right, down; the camera's are right, down, forward."""
    forward, right, down = turn
    return (right, down, forward)


def either(given: float | None, by_source: float) -> float:
    """What is configured, else what the pictures' source suggests."""
    return by_source if given is None else given


def _shared(sigmas: PoseSigmas, height: Sigma, focal: float, configured: Configured) -> list[float]:
    values = [0.0] * SHARED_COUNT
    values[SharedError.NORTH] = values[SharedError.EAST] = either(configured.position_bias_m, sigmas.position_m.shared)
    values[SharedError.HEIGHT] = either(configured.height_bias_m, height.shared)
    mount = radians(either(configured.mount_bias_deg, sigmas.attitude_deg.shared))
    for error in (SharedError.MOUNT_X, SharedError.MOUNT_Y, SharedError.MOUNT_Z):
        values[error] = mount
    values[SharedError.HEADING] = radians(either(configured.heading_bias_deg, sigmas.heading_deg))
    values[SharedError.FOCAL] = focal
    return values
