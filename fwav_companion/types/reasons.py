"""Named reasons why a frame, a detection or a track gives no result. Each is counted under its name."""

from __future__ import annotations

from enum import StrEnum


class Reason(StrEnum):
    """Reasons by the names that recordings, the status file and reports show.

    ``tools/reasons.toml`` says what each means and what to do.
    """

    # A frame or a detection, as it arrives.
    MALFORMED = "malformed"
    NO_TIME = "no_time"
    NO_MONOTONIC_MAP = "no_monotonic_map"
    WRONG_UNITS = "wrong_units"
    NOT_FINITE = "not_finite"
    OUTSIDE_IMAGE = "outside_image"
    WRONG_SIZE = "wrong_size"
    FROM_THE_FUTURE = "from_the_future"
    ACROSS_CLOCK_STEP = "across_clock_step"
    TOO_MANY_DETECTIONS = "too_many_detections"
    TOO_MANY_FRAMES = "too_many_frames"
    OVERLOAD = "overload"
    TOO_LATE = "too_late"
    DUPLICATE_FRAME = "duplicate_frame"
    LOW_SCORE = "low_score"
    OTHER_LABEL = "other_label"

    # Pairing.
    NO_CLOCK = "no_clock"
    NO_ATTITUDE = "no_attitude"
    STALE_ATTITUDE = "stale_attitude"
    ATTITUDE_GAP = "attitude_gap"
    BEFORE_HISTORY = "before_history"
    NO_GIMBAL = "no_gimbal"
    STALE_GIMBAL = "stale_gimbal"
    GIMBAL_GAP = "gimbal_gap"
    GIMBAL_HORIZON = "gimbal_horizon"
    GIMBAL_FLAGS = "gimbal_flags"
    GIMBAL_SETPOINT = "gimbal_setpoint"
    NO_POSITION = "no_position"
    NO_POSE = "no_pose"

    # Lens.
    OUTSIDE_LENS = "outside_lens"

    # Pads and tags of known size.
    PART_OF_PAD = "part_of_pad"
    NO_PAD_POSE = "no_pad_pose"
    TAG_COPY = "tag_copy"
    CONTRADICTS_PAD = "contradicts_pad"

    # Localization.
    ABOVE_HORIZON = "above_horizon"
    TOO_SHALLOW = "too_shallow"
    TOO_LOW = "too_low"
    NO_HEIGHT = "no_height"
    NO_RANGE = "no_range"
    RANGE_TILTED = "range_tilted"
    TWO_GROUNDS = "two_grounds"
    BEYOND_TERRAIN = "beyond_terrain"
    NO_TERRAIN = "no_terrain"
    TERRAIN_UNFIT = "terrain_unfit"
    WEAK_EVIDENCE = "weak_evidence"

    # Deletion of a track.
    NEVER_CONFIRMED = "never_confirmed"
    NOT_SEEN = "not_seen"
    NOT_SEEN_LONG = "not_seen_long"
    VEHICLE_CHANGED = "vehicle_changed"
    ORIGIN_SET = "origin_set"
    INTERNAL_FAULT = "internal_fault"
    REPLACED = "replaced"
    TOO_MANY_TRACKS = "too_many_tracks"
