"""Tracking: ground fixes become targets, by filters, association, a track life cycle, and reordering of late frames.

Pure: frames come in with their own capture times, tracks go out. Reading order: ``options``; ``filters`` (one target);
``detector_model``, ``lifecycle``, ``track_state``, ``self_calibrated`` (one track); ``clutter``, ``coarse_gate``,
``pair_costs``, ``assignment``, ``joint_compatibility``, ``joint_association``, ``association`` (tracks and fixes);
``reacquisition``, ``new_tracks``, ``track_merging``, ``frame_association``, ``frame_update``, ``snapshot``, ``tracker``
(many targets); ``filter_factory``, ``reorder``; ``landmarks``; ``bias_shares`` (error budget of a target, for studies).
"""

from fwav_companion.tracking.bias_shares import bias_shares
from fwav_companion.tracking.filter_factory import make_tracker, smoothed_tracker, tracker_with
from fwav_companion.tracking.frame_tracker import FrameTracker
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.tracking.reorder import Reorder, Settled
from fwav_companion.tracking.tracker import Tracker

__all__ = [
    "FrameTracker",
    "Reorder",
    "Settled",
    "Tracker",
    "TrackingOptions",
    "bias_shares",
    "make_tracker",
    "smoothed_tracker",
    "tracker_with",
]
