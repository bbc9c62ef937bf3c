"""Patch tracking: follows any spot that an operator clicked, by its look, where the geometry predicts it. PURE.

``pictures`` keeps the newest pictures within a bound of bytes; ``appearance`` holds how the spot looked;
``patch_tracker`` finds it in the next picture, or says why it is not found; ``spots`` has all that are followed;
``look_rate`` keeps its cost below a tenth of a core. Runs in the vision process.
"""

from fwav_companion.vision.patch.look_rate import LookRate
from fwav_companion.vision.patch.patch_tracker import NoMatch, PatchMatch, PatchTracker
from fwav_companion.vision.patch.pictures import KeptPictures
from fwav_companion.vision.patch.spots import FollowedSpots

__all__ = ["FollowedSpots", "KeptPictures", "LookRate", "NoMatch", "PatchMatch", "PatchTracker"]
