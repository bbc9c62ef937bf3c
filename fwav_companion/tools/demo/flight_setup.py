"""The flight of a demonstration: the service's configuration, and the same numbers for the mock. Pure.

The mock draws the vehicle's errors from the priors that the configuration states, by the seed. The service does not
know the drawn errors.
"""

from __future__ import annotations

from random import Random
from typing import Any

import msgspec

from fwav_companion.config import Config

CONFIG_FILE, CAMERA_FILE, PIPE = "fwav-companion.toml", "camera.yaml", "frames.pipe"
SCENARIO = "demo"
READOUT_S = (0.015, 0.033)
"""Range of the drawn readout time, seconds: small sensors by their data sheets. The configuration states the value."""
CAMERA_COMES_UP_S = 1.5
"""Time from the autopilot's start to the first frame, seconds, as on a board that boots."""
PRIORS = (
    "attitude_noise_deg", "attitude_bias_deg", "heading_bias_deg", "position_noise_m", "position_bias_m",
    "position_bias_time_s", "position_delay_sigma_s", "lever_arm_sigma_m",
    "height_noise_m", "height_bias_m", "mount_bias_deg", "time_offset_sigma_s",
)  # fmt: skip
"""Keys of [uncertainty] that the mock draws from, by the same names. Pixels have no prior: pictures are rendered."""


def mock_priors(config: Config) -> dict[str, Any]:
    """The mock's options for the sigmas that the configuration states; "auto" is what the mock has by itself."""
    stated = {name: getattr(config.uncertainty, name) for name in PRIORS}
    return {f"priors.{name}": value for name, value in stated.items() if value != "auto"}


class FlightSetup(msgspec.Struct, frozen=True):
    """One demonstration."""

    seed: int
    seconds: float
    scenario: str = SCENARIO

    @property
    def readout_s(self) -> float:
        """Time from the first image row to the last, drawn by the seed, seconds."""
        return round(Random(self.seed).uniform(*READOUT_S), 4)  # noqa: S311  # a drawn flight, no secret

    def config_text(self, autopilot_port: int, ground_port: int) -> str:
        """The service's configuration as a user would write it, TOML."""
        return f"""\
# Configuration of the demonstration. Keys that are not here have their defaults: `fwav-companion init` shows them.

[[link]]
name = "autopilot"
url = "udpin://127.0.0.1:{autopilot_port}"
role = "autopilot"

[[link]]
name = "ground"
url = "udpout://127.0.0.1:{ground_port}"
role = "gcs"

[camera]
calibration = "{CAMERA_FILE}"
readout_s = {self.readout_s}             # a rolling shutter, from its data sheet

[detections]
url = ""                      # no other process sends detections

[vision]
source = "{PIPE}"       # pictures with time stamps, as a camera's driver delivers them
detector = "apriltag"

[record]
directory = "recording"
sync_s = 0.4

[status]
file = "status.json"
"""

    def mock_arguments(self, config: Config) -> list[str]:
        """Command line arguments for the mock autopilot and the mock camera."""
        chosen = mock_priors(config)
        chosen |= {"camera.readout_s": self.readout_s, "camera.first_frame_s": CAMERA_COMES_UP_S}
        sets = [f"--set={name}={value!r}" for name, value in chosen.items()]
        return [f"--scenario={self.scenario}", f"--seed={self.seed}", f"--seconds={self.seconds}", *sets]
