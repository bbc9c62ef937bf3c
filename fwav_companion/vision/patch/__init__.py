"""Patch tracking: follows any spot that an operator clicked, by its appearance near the predicted place. PURE.

``pictures`` keeps the newest pictures within a bound of bytes; ``appearance`` keeps views of the spot;
``patch_tracker`` finds it in the next picture, or gives the reason why not; ``spots`` has all followed spots;
``look_rate`` keeps their cost below a tenth of a core. Runs in the vision process.
"""

from fwav_companion.vision.patch.look_rate import LookRate
from fwav_companion.vision.patch.patch_tracker import NoMatch, PatchMatch, PatchTracker
from fwav_companion.vision.patch.pictures import KeptPictures
from fwav_companion.vision.patch.spots import FollowedSpots

__all__ = ["FollowedSpots", "KeptPictures", "LookRate", "NoMatch", "PatchMatch", "PatchTracker"]
