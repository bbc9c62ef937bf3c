"""Patch tracking: follows any spot that an operator clicked, by its look, where the geometry predicts it. PURE.

``pictures`` keeps the newest pictures within a bound of bytes; ``appearance`` holds how the spot looked;
``patch_tracker`` finds it in the next picture, or says why it is not found; ``spots`` has all that are followed, and
the messages about them. Runs in the vision process.
"""

from fwav_companion.vision.patch.patch_tracker import NoMatch, PatchMatch, PatchTracker, PatchView
from fwav_companion.vision.patch.pictures import KeptPictures
from fwav_companion.vision.patch.spots import FollowedSpots, SpotOrder, SpotRelease, SpotViews

__all__ = [
    "FollowedSpots",
    "KeptPictures",
    "NoMatch",
    "PatchMatch",
    "PatchTracker",
    "PatchView",
    "SpotOrder",
    "SpotRelease",
    "SpotViews",
]
