"""Sightings to ground fixes: the intersection of a ray with the ground, its covariance and error budget. Pure.

:class:`Localizer` intersects the ray of a sighting with one :class:`Ground` and propagates every error of the sighting
to the point. The result is a fix with noise and biases apart, or a named refusal.
"""

from fwav_companion.localization.elevation import ElevationModel, ElevationTile
from fwav_companion.localization.ground import AltitudeGround, FixedGround, Ground, HomeGround, Intersection
from fwav_companion.localization.landmark_sights import LandmarkSights
from fwav_companion.localization.localizer import Localizer
from fwav_companion.localization.rangefinder_ground import RangefinderGround
from fwav_companion.localization.terrain_ground import Datum, TerrainGround, TerrainShift

__all__ = [
    "AltitudeGround",
    "Datum",
    "ElevationModel",
    "ElevationTile",
    "FixedGround",
    "Ground",
    "HomeGround",
    "Intersection",
    "LandmarkSights",
    "Localizer",
    "RangefinderGround",
    "TerrainGround",
    "TerrainShift",
]
