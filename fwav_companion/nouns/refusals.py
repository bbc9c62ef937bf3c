"""Why there is no answer. Every reason has a name, is counted under it, and stands for one situation."""

from __future__ import annotations

from enum import StrEnum


class Reason(StrEnum):
    """Names as they appear in recordings, the status file and reports."""

    # A frame or a detection, at the door.
    MALFORMED = "malformed"
    """Not JSON of the documented form, or a field of the wrong type."""
    NO_TIME = "no_time"
    """Not exactly one of time_unix, time_monotonic, time_boot."""
    NO_MONOTONIC_MAP = "no_monotonic_map"
    """A recording cannot place a stamp of the board's monotonic clock."""
    WRONG_UNITS = "wrong_units"
    """The stamp is evidently in other units (milliseconds, nanoseconds)."""
    NOT_FINITE = "not_finite"
    """A pixel, a stamp or a sigma is not a finite number, or a sigma is not positive."""
    OUTSIDE_IMAGE = "outside_image"
    """The pixel lies outside [-0.5, size - 0.5]."""
    WRONG_SIZE = "wrong_size"
    """The frame's size has not the calibration's shape."""
    FROM_THE_FUTURE = "from_the_future"
    """Captured after it arrived, beyond 5 ms and three sigma of the clock."""
    ACROSS_CLOCK_STEP = "across_clock_step"
    """Stamped by the wall clock before a step of it that came before the frame's arrival."""
    TOO_MANY_DETECTIONS = "too_many_detections"
    """More than 256 in one frame: the frame is refused whole."""
    TOO_MANY_FRAMES = "too_many_frames"
    """More frames wait than half a second of any camera can hold."""
    TOO_LATE = "too_late"
    """Captured longer ago than the reorder window of 0.5 s when it arrived."""
    DUPLICATE_FRAME = "duplicate_frame"
    """A frame of the same number and capture time has been taken already."""
    LOW_SCORE = "low_score"
    """Below [detections] min_score."""
    OTHER_LABEL = "other_label"
    """Not among [detections] labels."""

    # Pairing.
    NO_CLOCK = "no_clock"
    """The autopilot's clock cannot be placed on the host's yet, or not well enough."""
    NO_ATTITUDE = "no_attitude"
    """No attitude was ever heard, or none so near the capture that it may be used."""
    STALE_ATTITUDE = "stale_attitude"
    """The newest attitude is older than may be bridged by the body rates."""
    ATTITUDE_GAP = "attitude_gap"
    """The capture lies in a hole of the attitude stream that is too wide to interpolate."""
    BEFORE_HISTORY = "before_history"
    """The capture is older than the attitudes that are kept."""
    NO_POSITION = "no_position"
    """A position is expected but there is none near the capture."""

    # Lens.
    OUTSIDE_LENS = "outside_lens"
    """The pixel lies beyond the valid range of the lens model."""

    # Localization.
    ABOVE_HORIZON = "above_horizon"
    """The ray does not descend: there is no ground on it."""
    TOO_SHALLOW = "too_shallow"
    """The ray descends so little that an error of attitude moves the point beyond what a Gaussian can tell."""
    TOO_LOW = "too_low"
    """The camera is below [ground] min_height_m."""
    NO_HEIGHT = "no_height"
    """No height above the ground is known at the capture."""
    NO_RANGE = "no_range"
    """The rangefinder has no usable reading at the capture."""
    BEYOND_TERRAIN = "beyond_terrain"
    """The ray leaves the elevation model, or meets a void, before it meets the ground."""

    # The end of a track.
    NEVER_CONFIRMED = "never_confirmed"
    """A tentative track was not seen again."""
    NOT_SEEN = "not_seen"
    """Frames looked where the target should be and saw nothing."""
    NOT_SEEN_LONG = "not_seen_long"
    """No frame could look for longer than a track is kept."""
    ORIGIN_SET = "origin_set"
    """A position came after all, and the world's origin with it."""
    AUTOPILOT_REBOOTED = "autopilot_rebooted"
    """The autopilot restarted: its clock and frame are new."""
    REPLACED = "replaced"
    """Two tracks turned out to be one target; the younger one ended."""
    TOO_MANY_TRACKS = "too_many_tracks"
    """The table of tracks was full; the least certain one ended."""
