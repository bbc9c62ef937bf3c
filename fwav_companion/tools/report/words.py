"""The words of a report: names for people. Pure."""

from __future__ import annotations

CAUSE_NAMES = {
    "position": "the vehicle's own position (GNSS)",
    "heading": "its heading (compass)",
    "attitude": "its roll and pitch",
    "mount": "how the camera is mounted",
    "height": "its height above the ground",
    "time": "when the picture was taken",
    "pixel": "where in the picture",
    "terrain": "the ground's own shape",
}
REASONS = {
    "no_clock": "The autopilot's clock could not be placed on this board's yet: the first seconds after it is heard.",
    "no_attitude": "No attitude of the vehicle near the picture's instant.",
    "attitude_gap": "A hole in the stream of attitudes, too wide to bridge.",
    "stale_attitude": "The newest attitude was too old.",
    "no_position": "No position of the vehicle near the picture's instant.",
    "outside_lens": "Beyond the range in which the lens is calibrated.",
    "above_horizon": "The line of sight does not meet the ground.",
    "too_shallow": "The line of sight is so flat that small errors move the point far.",
    "too_low": "The vehicle was below the least height.",
    "no_height": "The height above ground was not known.",
    "too_late": "It arrived longer than half a second after its capture.",
    "from_the_future": "Stamped after it arrived.",
    "duplicate_frame": "The same frame came twice.",
    "low_score": "The detector was not sure enough.",
    "other_label": "A label that was not asked for.",
}
SHORT_CAUSES = {
    "position": "GNSS",
    "heading": "compass",
    "attitude": "attitude",
    "mount": "the mount",
    "height": "height",
    "time": "timing",
    "pixel": "detector",
    "terrain": "terrain",
}


def short(label: str) -> str:
    """How a person would call it."""
    family, _, tag = label.rpartition(":")
    if family.startswith("tag"):
        return f"tag {tag}"
    return label or "target"


def length(metres: float) -> str:
    """As a person would say it: 0.013 is "1.3 cm"."""
    if metres >= 1.0:
        return f"{metres:.2f} m"
    if metres >= 0.0995:
        return f"{100.0 * metres:.0f} cm"
    return f"{100.0 * metres:.1f} cm" if metres >= 0.00095 else f"{1000.0 * metres:.1f} mm"


def metres(value: float) -> str:
    """For a table, whose rows are compared: 1.44 m, 0.019 m."""
    return f"{value:.2f} m" if value >= 0.0995 else f"{value:.3f} m"


def words(reason: str) -> str:
    """A recording's name of a reason, as words."""
    return reason.replace("_", " ")
