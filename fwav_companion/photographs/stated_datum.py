"""What the user says about the datum of the pictures' altitudes, in place of what their tags say. PURE."""

from __future__ import annotations

import msgspec

from fwav_companion.photographs.makers import BAROMETER, DISPUTED, GNSS_HEIGHT
from fwav_companion.photographs.picture_pose import AltDatum, Altitude, PicturePose


def with_stated_datum(pose: PicturePose, datum: AltDatum | None) -> PicturePose:
    """The pose whose absolute altitude counts from ``datum``; None: as its tags say.

    Above the take-off it is the height of pictures that have no other. An error that was the datum's alone goes.
    """
    absolute = pose.absolute
    if datum is None or absolute is None:
        return pose
    if datum is AltDatum.TAKEOFF:
        above = pose.above_takeoff or Altitude(absolute.metres, AltDatum.TAKEOFF, BAROMETER)
        return msgspec.structs.replace(pose, absolute=None, above_takeoff=above)
    sigma = GNSS_HEIGHT if absolute.sigma == DISPUTED else absolute.sigma
    return msgspec.structs.replace(pose, absolute=Altitude(absolute.metres, datum, sigma))
