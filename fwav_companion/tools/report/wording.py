"""Words and numbers of a report: names of error causes, explanations of reasons, lengths as text. Pure."""

from __future__ import annotations

CAUSE_NAMES = {
    "position": "the vehicle's own position (GNSS)",
    "heading": "its heading (compass)",
    "attitude": "its roll and pitch",
    "mount": "how the camera is mounted",
    "height": "its height above the ground",
    "time": "when the picture was taken",
    "pixel": "the detected pixel",
    "terrain": "the height of the ground itself",
    "target": "the target's own height",
}
REASONS = {
    "malformed": "The datagram or line is not a frame in the documented format.",
    "no_time": "The frame needs exactly one of time_unix, time_monotonic and time_boot.",
    "no_monotonic_map": "A recording cannot place a stamp of the board's monotonic clock.",
    "wrong_units": "The time stamp is not in seconds.",
    "not_finite": "A pixel, a stamp or a sigma is not a finite number, or a sigma is not positive.",
    "outside_image": "The pixel is outside the image.",
    "wrong_size": "The size of the frame does not fit the camera file.",
    "from_the_future": "The time stamp is later than the arrival.",
    "across_clock_step": "The wall clock was stepped between the time stamp and the arrival.",
    "too_many_detections": "The frame has more than 256 detections.",
    "too_many_frames": "More frames were waiting than half a second of any camera holds.",
    "overload": "Frames came faster than the board handles them, and newer ones were taken.",
    "internal_fault": "An error of the service dropped the frame.",
    "too_late": "The frame arrived more than half a second after its capture.",
    "duplicate_frame": "The same frame arrived twice.",
    "low_score": "The detector's score is below the configured minimum.",
    "other_label": "The label is not one of the configured labels.",
    "no_clock": "The offset between the autopilot's and this board's clock was not known, as in the first seconds.",
    "no_attitude": "No attitude of the vehicle was close enough to the capture time.",
    "stale_attitude": "The newest attitude was too old.",
    "attitude_gap": "Attitudes were too far apart for the vehicle's motion.",
    "before_history": "The capture is older than the attitudes that are kept, or than the first one.",
    "two_grounds": "An edge of the elevation model lies within the error: the ray meets the ground at two places.",
    "no_gimbal": "No attitude of the gimbal was close enough to the capture time.",
    "stale_gimbal": "The newest attitude of the gimbal was too old.",
    "gimbal_gap": "The gimbal moved too fast between its messages.",
    "gimbal_horizon": "It was unknown whether the gimbal's angles count from the horizon or from the body.",
    "gimbal_flags": "The gimbal's flags contradicted each other.",
    "gimbal_setpoint": "The gimbal reported setpoints, not where it looked.",
    "no_position": "No position of the vehicle was close enough to the capture time.",
    "no_pose": "The picture has no row in the file of poses.",
    "outside_lens": "The pixel is outside the calibrated range of the lens.",
    "above_horizon": "The line of sight does not meet the ground.",
    "too_shallow": "The line of sight is so flat that small angle errors move the point far.",
    "too_low": "The camera was below the minimum height.",
    "no_height": "The height above the ground was not known.",
    "no_range": "The rangefinder had no usable reading at the capture time.",
    "range_tilted": "The rangefinder did not point down at the capture time.",
    "no_terrain": "The line of sight meets a void of the elevation model that is too wide to be filled.",
    "beyond_terrain": "The line of sight leaves the elevation model before it meets the ground.",
    "terrain_unfit": "The elevation model disagrees with the take-off height.",
    "part_of_pad": "The tag counts in the sighting of its pad: no refusal.",
    "no_pad_pose": "The tag came without corners, or edge-on: it does not show where its pad is.",
    "tag_copy": "The tag was in the picture twice; this one agrees less with its pad.",
    "contradicts_pad": "The tag is not where its pad has it, as the pad's other tags show.",
    "weak_evidence": "The detection alone did not show whether it was of a known target near it.",
}


def length(metres: float) -> str:
    """A length for a sentence: 0.013 is "1.3 cm"."""
    if metres >= 1.0:
        return f"{metres:.2f} m"
    if metres >= 0.0995:
        return f"{100.0 * metres:.0f} cm"
    return f"{100.0 * metres:.1f} cm" if metres >= 0.00095 else f"{1000.0 * metres:.1f} mm"


def table_length(metres: float) -> str:
    """A length for a table, all in metres, so that rows can be compared: 1.44 m, 0.019 m."""
    return f"{metres:.2f} m" if metres >= 0.0995 else f"{metres:.3f} m"


def spaced(reason: str) -> str:
    """The name of a reason as words: "no_clock" is "no clock"."""
    return reason.replace("_", " ")
