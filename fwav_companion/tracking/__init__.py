"""Tracking: ground fixes become targets, by association, a track life cycle, and reordering of late frames.

Pure: frames come in with their own capture times, tracks go out. Two trackers share the life of a track and the costs
of its fixes: ``smoothed`` estimates all errors of a vehicle and its targets together (``estimation``), ``filters`` has
one state a target, the paper's low-pass or one's own.
Reading order: ``options``; ``detector_model``, ``crowd``, ``detector_ids``, ``lifecycle``, ``track_table``,
``visibility``, ``live_track`` (one track); ``clutter``, ``assignment``, ``pair_assignment``, ``id_pairs`` (its fixes);
``frame_tracks``, ``frame_tracker``, ``filters``, ``smoothed``, ``filter_factory``, ``reorder``.
"""

from fwav_companion.tracking.filter_factory import filter_tracker, smoothed_tracker
from fwav_companion.tracking.filters.base import shares_of
from fwav_companion.tracking.frame_tracker import FrameTracker
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.tracking.reorder import Reorder, Settled

__all__ = [
    "FrameTracker",
    "Reorder",
    "Settled",
    "TrackingOptions",
    "filter_tracker",
    "shares_of",
    "smoothed_tracker",
]
