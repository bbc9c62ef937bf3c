"""Tracking: from ground fixes to targets, with filters, association, the life of a track, and late frames.

Pure: frames come in with their own capture times, tracks go out. Reading order: ``options``; ``filters`` (one target);
``detector_model``, ``lifecycle``, ``coarse_gate``, ``assignment``, ``association``, ``track_state``, ``visibility``,
``track_merging``, ``reacquisition``, ``tracker`` (many targets);
``filter_factory``, ``reorder``; ``bias_shares`` (what limits a target, for studies).
"""

from fwav_companion.tracking.bias_shares import bias_shares
from fwav_companion.tracking.filter_factory import make_tracker, tracker_with
from fwav_companion.tracking.options import TrackingOptions
from fwav_companion.tracking.reorder import Reorder, Settled
from fwav_companion.tracking.tracker import Tracker

__all__ = ["Reorder", "Settled", "Tracker", "TrackingOptions", "bias_shares", "make_tracker", "tracker_with"]
