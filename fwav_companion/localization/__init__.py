"""A sighting and a ground give a point on the ground with its covariance, or a named refusal. Pure."""

from fwav_companion.localization.elevation import ElevationModel, ElevationTile
from fwav_companion.localization.flat_grounds import FixedGround, HomeGround
from fwav_companion.localization.ground import Ground, Intersection
from fwav_companion.localization.localizer import Localizer
from fwav_companion.localization.rangefinder_ground import RangefinderGround
from fwav_companion.localization.terrain_ground import Datum, TerrainGround

__all__ = [
    "Datum",
    "ElevationModel",
    "ElevationTile",
    "FixedGround",
    "Ground",
    "HomeGround",
    "Intersection",
    "Localizer",
    "RangefinderGround",
    "TerrainGround",
]
