"""One track of a filter of single targets."""

from __future__ import annotations

from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.smoothed.smoothed_track import SmoothedTrack


class FilterTrack(SmoothedTrack, frozen=True, kw_only=True, gc=False):
    """One live track. Immutable."""

    target: TargetState
    """The filter's state, predicted to the newest frame."""
