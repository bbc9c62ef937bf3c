"""A sighting and a ground give a point on the ground with its covariance, or a named refusal. Pure."""

from fwav_companion.localization.flat_grounds import FixedGround, HomeGround
from fwav_companion.localization.ground import Ground, Meeting
from fwav_companion.localization.localizer import Localizer

__all__ = ["FixedGround", "Ground", "HomeGround", "Localizer", "Meeting"]
