"""The record of one flight of a study: its drawn values, the target's errors, and the claimed errors. PURE."""

from __future__ import annotations

from typing import Final

import msgspec

from fwav_companion.recording.error_statistics import CHI2_999
from fwav_companion.tools.study.causes import CAUSES
from fwav_companion.tools.study.keys import Value

POINTS: Final = 30
"""Instants of a flight at which error and claim are kept: the k-th is k / 30 of its duration."""
DRAWN: Final = (
    "attitude_roll_deg", "attitude_pitch_deg", "heading_deg", "mount_x_deg", "mount_y_deg", "mount_z_deg",
    "time_offset_s", "height_m", "position_sigma_m", "readout_s", "position_delay_s", "lever_x_m", "lever_y_m",
    "lever_z_m",
)  # fmt: skip
"""Names of the drawn errors, estimate minus truth, and of the true readout."""
FLOWN: Final = ("height_m", "radius_m", "speed_m_s", "pitch_deg", "flap_hz", "flap_deg", "wind_m_s", "miss_rate")
CAUSE_NAMES: Final = tuple(CAUSES)

FOUND: Final = "found"


class FlightRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One flight. Metres, degrees, seconds; None where there is no answer."""

    index: int
    arm: str
    varied: dict[str, Value]
    """Values of the varied keys."""
    flown: dict[str, float]
    """Values by the names of FLOWN."""
    drawn: dict[str, float]
    """Values by the names of DRAWN."""
    state: str
    """found | fixed (fixes, but never confirmed) | missed."""
    no_answer: str
    """Why there is no answer; empty where there is one."""
    error_m: float | None = None
    """Horizontal error of the target at the end."""
    north_error_m: float | None = None
    east_error_m: float | None = None
    claimed95_m: float | None = None
    """Larger semi-axis of the claimed 95 % ellipse at the end."""
    normalised2: float | None = None
    """Square of the error over its claimed covariance, 2 degrees of freedom."""
    errors_m: list[float | None] = []
    """Error at each of the instants of POINTS."""
    claims95_m: list[float | None] = []
    """Claimed radius at each of the instants of POINTS."""
    squares: list[float | None] = []
    """Normalised square at each of the instants of POINTS."""
    calibrated_s: float | None = None
    """Instant at which self-calibration first knew delay and mount; None if it never did or was off."""
    calibration: str = ""
    """Status of self-calibration at the end; empty where it was off."""
    calibration_lacks: str = ""
    """The condition that was missing for ``calibrated`` at the end."""
    ghosts: int = 0
    """Confirmed tracks that belong to no target."""
    frames: int = 0
    in_view: int = 0
    """Pictures in which the target was in view."""
    fixes: int = 0
    limits_m: dict[str, float] = {}
    """Horizontal error due to each cause at the end, one sigma: it would vanish if that cause were exactly known."""

    @property
    def is_answered(self) -> bool:
        """Whether the flight ended with a confirmed target."""
        return self.state == FOUND

    @property
    def is_wrong(self) -> bool:
        """Whether the claim at the end is wrong beyond 99.9 %."""
        return self.normalised2 is not None and self.normalised2 > CHI2_999
