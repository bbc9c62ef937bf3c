"""``study --preset paper``: the paper's case as a study: a hover at 10 m, 90 pictures, the paper's three noises. PURE.

The bird does not flap, and nothing has a bias; the target is 4 m ahead and 3 m to the left. The paper's filter is the
low-pass with alpha = 0.125; ``--set tracking.filter=lowpass`` studies it, ``--set flight.flap_deg=5`` the wings.
"""

from __future__ import annotations

from math import radians
from typing import Final

from fwav_companion.tools.study.keys import Variation
from fwav_companion.tools.study.study_plan import RadialLens, StudyPlan

SECONDS: Final = 8.0
"""Five seconds until clock and position are known, then 90 pictures at 30 a second."""
FIRST_PICTURE_S: Final = 5.0
CONFIG: Final = """\
# The paper's case: three noises, no bias.

[camera]
calibration = "camera.yaml"
readout_s = 0.0

[uncertainty]
pixel_noise_px = 4.0
attitude_noise_deg = 0.1
height_noise_m = 0.5
attitude_bias_deg = 0.0
heading_bias_deg = 0.0
position_noise_m = 0.0
position_bias_m = 0.0
position_delay_sigma_s = 0.0
lever_arm_sigma_m = 0.0
height_bias_m = 0.0
mount_bias_deg = 0.0
time_offset_sigma_s = 0.0
attitude_stamp_delay_s = 0.0
"""
LENS: Final = RadialLens((3.55, 0.03, 0.0, 0.0, 0.0), (188.0, 188.0), (320.0, 240.0), (640, 480), radians(75.0))
SETTINGS: Final = (
    ("flight.height_m", "10.0"),
    ("flight.pitch_deg", "37.0"),
    ("flight.flap_deg", "0.0"),
    ("flight.wind_m_s", "0.0"),
    ("flight.miss_rate", "0.0"),
    ("tracking.self_calibration", "false"),
)
NOTES: Final = (
    (
        "Noises as the paper states them, one sigma: 4 px, 0.1 degrees, 0.5 m of height. The scatter in its Table I is "
        "that of an image noise of 1 mm: --set uncertainty.pixel_noise_px=188."
    ),
    (
        "Heights come at 10 Hz and attitudes at 100 Hz here, as an autopilot sends them. Pictures share them, so "
        "averaging gains less than with a noise of every picture: `fwav-companion paper` has its equations."
    ),
    "The low-pass starts at the first fix here. The paper's starts at zero, which draws its means toward the vehicle.",
)
"""Notes on these figures for a reader of the paper."""
TARGET_M: Final = (4.0, -3.0)
"""North and east of the vehicle, whose heading is north."""


def paper_plan(
    flights: int, seed: int, settings: tuple[tuple[str, str], ...], variations: tuple[Variation, ...]
) -> StudyPlan:
    """The plan of the paper's case, with the user's settings over it."""
    return StudyPlan(
        config=CONFIG,
        config_name="paper",
        lens=LENS,
        flights=flights,
        seconds=SECONDS,
        pattern="hover",
        seed=seed,
        settings=(*SETTINGS, *settings),
        variations=variations,
        preset="paper",
    )
