"""Causes of error: the configuration keys that state them, their names, and what reduces each. PURE."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import msgspec


class ErrorCause(msgspec.Struct, frozen=True):
    """One cause of error that lasts through a flight."""

    keys: tuple[str, ...]
    """Keys of [uncertainty] for the sigmas of the cause; empty for the readout, which the configuration may state."""
    name: str
    remedy: str
    """What to change."""


CAUSES: Final[Mapping[str, ErrorCause]] = {
    "position": ErrorCause(
        ("position_bias_m",), "the vehicle's own position (GNSS)", "RTK corrections, or a surveyed landmark in view"
    ),
    "heading": ErrorCause(("heading_bias_deg",), "its heading (compass)", "a heading from two antennas"),
    "attitude": ErrorCause(("attitude_bias_deg",), "its roll and pitch", "level the autopilot (AHRS trim)"),
    "mount": ErrorCause(
        ("mount_bias_deg",), "how the camera is mounted", "measure the mount: check --shake, or self-calibration"
    ),
    "height": ErrorCause(("height_bias_m",), "its height above the ground", "a rangefinder, or corrected heights"),
    "time": ErrorCause(
        ("time_offset_sigma_s",), "when the picture was taken", "measure the delay: check --shake, or self-calibration"
    ),
    "readout": ErrorCause((), "how fast the image is read", "set [camera] readout_s from the sensor's data sheet"),
    "position_delay": ErrorCause(
        ("position_delay_sigma_s",), "how old the position is", "set [vehicle] position_delay_s from a log"
    ),
    "lever_arm": ErrorCause(
        ("lever_arm_sigma_m",), "where camera and antenna are on the body", "measure [camera.mount] position_m"
    ),
    "terrain": ErrorCause(("terrain_m",), "the height of the ground itself", "a better elevation model"),
}
"""Causes by the names of the shares that the tracker reports."""

NOISES: Final[Mapping[str, ErrorCause]] = {
    "pixel_noise": ErrorCause(("pixel_noise_px",), "the noise of the detected pixel", "a finer detector or lens"),
    "attitude_noise": ErrorCause(("attitude_noise_deg",), "the noise of the attitude", "a better autopilot"),
    "height_noise": ErrorCause(("height_noise_m",), "the noise of the height", "a rangefinder"),
}
"""The paper's three errors: independent in every sample, so that more pictures average them out."""


def error_cause(name: str) -> ErrorCause:
    """The cause or noise with this name."""
    return CAUSES.get(name) or NOISES[name]
