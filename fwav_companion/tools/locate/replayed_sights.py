"""The errors that all pictures of a replay share, by the sights of its confirmed targets. PURE, numpy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians
from statistics import median

from fwav_companion.config import Config
from fwav_companion.geometry.vectors import Vector3, add, scale
from fwav_companion.recording.summary_types import SharedErrorObject
from fwav_companion.tools.locate.answers import shared_error
from fwav_companion.tools.locate.estimate import locate
from fwav_companion.tools.locate.shots import SHARED_COUNT, SharedError, Shot, Sight, SightsEstimate
from fwav_companion.tools.locate.surfaces import FlatSurface, Surface
from fwav_companion.types import Lens, Sighting

RELIEF_M = 4.0
LEAST_SIGHTS = 2


class LevelOfFixes:
    """Starts targets at the level where they were fixed, and says nothing about the ground: for elevation models."""

    def __init__(self, down_m: float) -> None:
        self._down = down_m

    def meet(self, camera_ned: Vector3, direction: Vector3) -> Vector3 | str:
        """The intersection with that level."""
        if direction[2] <= 0.0 or camera_ned[2] >= self._down:
            return "above_horizon"
        return add(camera_ned, scale(direction, (self._down - camera_ned[2]) / direction[2]))

    def shape_sigma_m(self, camera_ned: Vector3, direction: Vector3, point: Vector3, tilt: float) -> float | str:  # noqa: ARG002
        """0: it is not used."""
        return 0.0

    def level(self, north: float, east: float) -> tuple[float, float, float] | None:  # noqa: ARG002
        """None: the ground's height is not known here."""
        return None

    def sigma_m(self, height_m: float, north: float, east: float) -> float:  # noqa: ARG002
        """0: it is not used."""
        return 0.0


def shared_errors(
    sights: Mapping[int, Sequence[Sighting]], lens: Lens, config: Config, downs: Sequence[float] = ()
) -> list[SharedErrorObject]:
    """The shared errors whose sigma the sights at least halve; ``config`` has their priors.

    ``downs``: levels of the targets where the ground is an elevation model.
    """
    seen = {track: each for track, each in sights.items() if len(each) >= LEAST_SIGHTS}
    if not seen:
        return []
    shots: list[Shot] = []
    index: dict[int, int] = {}
    looks: list[Sight] = []
    for track, each in seen.items():
        for sighting in each:
            if sighting.frame not in index:
                index[sighting.frame] = len(shots)
                shots.append(_shot(sighting, lens))
            pixel = (sighting.detection.u, sighting.detection.v)
            looks.append(Sight(index[sighting.frame], pixel, str(track), max(sighting.pixel_sigma)))
    surface: Surface
    if config.ground.model == "terrain":
        surface = LevelOfFixes(median(downs) if downs else 0.0)
    else:
        terrain_m = config.uncertainty.terrain_m
        surface = FlatSurface(0.0, RELIEF_M if terrain_m == "auto" else max(0.01, float(terrain_m)))
    estimate = locate(shots, looks, surface, [_priors(config)])
    return [shared_error(each) for each in estimate.shared] if isinstance(estimate, SightsEstimate) else []


def _shot(sighting: Sighting, lens: Lens) -> Shot:
    state = sighting.state
    forward, right, down = state.rates
    height_m = state.height_sigma_m
    return Shot(
        name=str(sighting.frame),
        camera_ned=sighting.camera_ned,
        ned_from_camera=sighting.ned_from_camera,
        lens=lens,
        own_position_m=state.position_sigma_m,
        own_height_m=state.position_sigma_m if height_m is None else height_m,
        own_attitude=state.attitude_sigma,
        velocity_ned=state.velocity_ned or (0.0, 0.0, 0.0),
        turn=(right, down, forward),
    )


def _priors(config: Config) -> tuple[float, ...]:
    given, values = config.uncertainty, [0.0] * SHARED_COUNT
    values[SharedError.NORTH] = values[SharedError.EAST] = given.position_sigma_m
    values[SharedError.HEIGHT] = given.height_bias_m
    for error in (SharedError.MOUNT_X, SharedError.MOUNT_Y, SharedError.MOUNT_Z):
        values[error] = radians(given.mount_bias_deg)
    values[SharedError.HEADING] = radians(given.heading_bias_deg)
    values[SharedError.DELAY] = given.time_offset_sigma_s
    return tuple(values)
