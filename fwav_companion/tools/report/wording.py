"""Words and numbers of a report: names of error causes, lengths as text. Pure."""

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
