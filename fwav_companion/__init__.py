"""An onboard MAVLink companion: camera detections become ground positions with honest uncertainty."""

__version__ = "0.1.0"
